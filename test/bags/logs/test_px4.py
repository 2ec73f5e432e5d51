# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ULog files of PX4: every topic that is read, in every program, and damaged files."""

import importlib
import sys

import numpy as np
import pytest
import ulog
from refusals import problems_of

import imu_sim_ros as ims
from imu_sim_ros.bags.logs import catalogue, px4
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError, MachineError, MissingDependencyError, Remark

pytest.importorskip("pyulog")
pytestmark = pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
FLOAT32 = 2.0**-24
"""Relative rounding of the numbers in a log."""
START = 100.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("ulog")


@pytest.fixture(scope="module")
def flight():
    return ims.simulate(
        imu="bmi088", trajectory="figure_eight", duration=12, rate=100, seed=1, start_time=START
    )


@pytest.fixture(scope="module")
def flight_log(folder, flight):
    return ulog.write(folder / "flown.ulg", ulog.flight_topics(flight))


@pytest.fixture(scope="module")
def still(folder):
    flight = ims.simulate(imu="bmi088", trajectory="static", duration=60, rate=50, seed=2)
    return flight, ulog.write(folder / "still.ulg", ulog.flight_topics(flight, ""))


@pytest.fixture(scope="module")
def six(folder):
    """Return a calibration by six positions, of an instance of each triad."""
    flight = ims.simulate(imu="lecture", trajectory="six_position", rate=20, seed=1)
    topics = instance(0, flight.readings)
    return ulog.write(folder / "six.ulg", topics)


@pytest.fixture(scope="module")
def warm(folder):
    """Return rests at several temperatures."""
    flight = ims.simulate(imu="bmi088", trajectory="temperature_soak", rate=5, seed=1)
    degrees = flight.temperature
    return ulog.write(folder / "warm.ulg", instance(0, flight.readings, degrees))


def instance(number, readings, degrees=None, delay_ns=0):
    """Return gyroscope and accelerometer as topics of their own.

    :param delay_ns: by which the stamps of the accelerometer are later.
    """
    topics = {}
    for name, values, late in (
        ("sensor_gyro", readings.gyro, 0),
        ("sensor_accel", readings.accel, delay_ns),
    ):
        columns = {axis: ulog.frd(values)[:, k] for k, axis in enumerate("xyz")}
        warmth = np.full(len(values), 25.0) if degrees is None else degrees
        topics[f"{name}/{number}"] = {
            **ulog.stamps(readings.t_ns + late), **columns, "temperature": warmth.astype("f4"),
        }  # fmt: skip
    return topics


def bag(path, flight):
    flight.save(path)
    return path


def test_readings_and_truth_are_those_of_the_flight(flight_log, flight):
    readings, truth = ims.read_readings(flight_log), ims.read_states(flight_log)
    np.testing.assert_array_equal(readings.t_ns, flight.readings.t_ns)
    largest = np.abs(flight.readings.accel).max()
    np.testing.assert_allclose(readings.gyro, flight.readings.gyro, atol=FLOAT32 * 4)
    np.testing.assert_allclose(readings.accel, flight.readings.accel, atol=FLOAT32 * largest)
    np.testing.assert_array_equal(truth.t_ns, flight.truth.t_ns)
    # Of a float32: rounding relative to 32 m, and to the unit quaternion.
    np.testing.assert_allclose(truth.position, flight.truth.position, atol=32 * FLOAT32)
    np.testing.assert_allclose(truth.velocity, flight.truth.velocity, atol=16 * FLOAT32)
    np.testing.assert_allclose(
        truth.angular_velocity, flight.truth.angular_velocity, atol=4 * FLOAT32
    )
    turn = rotation.multiply(rotation.conjugate(truth.q_wb), flight.truth.q_wb)
    assert np.linalg.norm(rotation.log(turn), axis=1).max() < 8 * FLOAT32


def test_dead_reckoning_is_that_of_the_bag(flight_log, flight, folder):
    of_bag = ims.dead_reckon(bag(folder / "flown.mcap", flight))
    of_log = ims.dead_reckon(flight_log)
    # Rounding of 16 m/s^2 is 1e-6 m/s^2, over 12 s 1e-4 m at most.
    np.testing.assert_allclose(of_log.position, of_bag.position, atol=1e-3)
    drift = of_log.drift()
    assert drift.final_position == pytest.approx(of_bag.drift().final_position, abs=1e-3)


def test_allan_is_that_of_the_readings(still):
    flight, path = still
    expected, noise = ims.allan(flight.readings), ims.allan(path)
    for triad in ("gyroscope", "accelerometer"):
        value, estimate = (getattr(n, triad).noise_density.value for n in (expected, noise))
        # Rounding to float32 is 1e-6 m/s^2, a thousandth of the noise of a reading.
        np.testing.assert_allclose(estimate, value, rtol=1e-3)


@pytest.mark.parametrize(
    "line",
    [
        "inspect {flown}",
        "dead_reckon {flown} --initial-state truth",
        "dead_reckon {still} --initial-state level",
        "twin {flown} --truth {flown} -o {folder}/twin",
        "calibrate temperature {warm} -o {folder}/temperature",
        "calibrate six_position {six} -o {folder}/six",
        "evaluate {folder}/flown.tum {flown}",
        "convert_bag {flown} -o {folder}/converted.mcap",
        "convert_bag {flown} -o {folder}/converted.bag",
        "convert_bag {flown} -o {folder}/euroc --format euroc",
        "add_errors {still} -o {folder}/errors.mcap --imu bmi088",
        "report {flown} -o {folder}/report.html",
    ],
)
def test_every_program_takes_it(line, flight_log, still, six, warm, folder, capsys):
    ims.convert(flight_log, folder / "flown.tum", force=True)
    program, *arguments = line.format(
        flown=flight_log, still=still[1], six=six, warm=warm, folder=folder
    ).split()
    status = importlib.import_module(f"imu_sim_ros.commands.{program}").main(arguments)
    assert status == 0, capsys.readouterr().err


def test_instances_have_topics_of_their_own(folder, flight):
    """Triads of one chip share their stamps; of others the second triad is interpolated."""
    readings = flight.readings
    topics = {**instance(0, readings), **instance(1, readings, delay_ns=3_000_000)}
    path = ulog.write(folder / "instances.ulg", topics)
    with open_bag(path) as bag:
        names = [info.name for info in bag.topics if info.type.endswith("/Imu")]
    assert names == ["/sensor_gyro_0", "/sensor_gyro_1", "/sensor_accel_1"]
    for topic in ("sensor_gyro/0", "sensor_accel/0", "sensor_gyro_0", "sensor_accel_0"):
        pair = ims.read_readings(path, topic)
        np.testing.assert_allclose(pair.gyro, readings.gyro, atol=4 * FLOAT32)
        np.testing.assert_allclose(pair.accel, readings.accel, atol=32 * FLOAT32)
    of_gyro, of_accel = (ims.read_readings(path, f"sensor_{n}/1") for n in ("gyro", "accel"))
    np.testing.assert_array_equal(of_gyro.t_ns, readings.t_ns[1:])
    np.testing.assert_array_equal(of_accel.t_ns, readings.t_ns[:-1] + 3_000_000)
    np.testing.assert_allclose(of_accel.accel, readings.accel[:-1], atol=32 * FLOAT32)
    fraction = 1.0 - 3.0 / 10.0
    between = (1 - fraction) * readings.accel[:-1] + fraction * readings.accel[1:]
    np.testing.assert_allclose(of_gyro.accel, between, atol=32 * FLOAT32)
    with pytest.raises(InputError, match="several topics.*sensor_gyro_0.*sensor_accel_1"):
        ims.read_readings(path)
    with pytest.raises(InputError, match="no topic sensor_accel/2"):
        ims.read_readings(path, "sensor_accel/2")
    with pytest.warns(Remark, match="sensor_gyro_1: the accelerometer is interpolated"):
        ims.read_readings(path, "sensor_gyro/1")


def test_batches_are_unrolled_by_dt_and_scale(folder):
    """The last sample of a batch is at its stamp; those behind the number of samples are none."""
    rng = np.random.default_rng(3)
    sizes, dt_us = np.array([8, 32, 1, 7]), 125.0
    counts = rng.integers(-30000, 30000, (4, 32, 3)).astype("i2")
    ends_us = 1_000_000 + np.cumsum(sizes) * 125
    topics = {}
    for name, scale in (("gyro", 0.001), ("accel", 0.01)):
        topics[f"sensor_{name}_fifo/0"] = {
            "timestamp": (ends_us + 77).astype("u8"), "timestamp_sample": ends_us.astype("u8"),
            "dt": np.full(4, dt_us, "f4"), "scale": np.full(4, scale, "f4"),
            "samples": sizes.astype("u1"),
            **{axis: counts[:, :, k] for k, axis in enumerate("xyz")},
        }  # fmt: skip
    path = ulog.write(folder / "fifo.ulg", topics)
    readings = ims.read_readings(path, "sensor_gyro_fifo/0")
    t_ns = 1_000_000_000 + 125_000 * np.arange(1, 49)
    values = np.concatenate([batch[:size] for batch, size in zip(counts, sizes, strict=True)])
    np.testing.assert_array_equal(readings.t_ns, t_ns)
    expected = np.float64(np.float32(0.001)) * values * [1, -1, -1]
    np.testing.assert_allclose(readings.gyro, expected, rtol=1e-15)
    expected = np.float64(np.float32(0.01)) * values * [1, -1, -1]
    np.testing.assert_allclose(readings.accel, expected, rtol=1e-15)


def test_delta_angles_are_mean_rates(folder):
    n = 50
    t_ns = 10**9 + 4_000_000 * np.arange(n)
    rates, forces = np.tile([0.1, 0.2, 0.3], (n, 1)), np.tile([1.0, 2.0, 9.0], (n, 1))
    dt_us = np.where(np.arange(n) % 2, 4000, 5000)
    dt_us[7] = 0
    topics = {"vehicle_imu/1": {
        **ulog.stamps(t_ns),
        "delta_angle": ulog.frd(rates * dt_us[:, None] * 1e-6),
        "delta_velocity": ulog.frd(forces * dt_us[:, None] * 1e-6),
        "delta_angle_dt": dt_us.astype("u4"), "delta_velocity_dt": dt_us.astype("u4"),
    }}  # fmt: skip
    with pytest.warns(Remark, match="vehicle_imu/1: 1 integrals over no time"):
        readings = ims.read_readings(ulog.write(folder / "imu.ulg", topics), "vehicle_imu/1")
    assert readings.t_ns.tolist() == np.delete(t_ns, 7).tolist()
    np.testing.assert_allclose(readings.gyro, rates[1:], rtol=4 * FLOAT32)
    np.testing.assert_allclose(readings.accel, forces[1:], rtol=4 * FLOAT32)


def odometry(truth, frame, velocity_frame, velocity, legacy=False):
    """Return odometry in a NED (1) or FRD (2) world; before firmware 1.14: 0 or 1."""
    turn = np.diag([1, -1, -1.0])
    position = ulog.ned(truth.position) if frame == 1 else (truth.position @ turn).astype("f4")
    q = ulog.q_ned_frd(truth.q_wb)
    if frame == 2:
        q = rotation.from_matrix(turn @ rotation.to_matrix(truth.q_wb) @ turn)
    n = len(q)
    rates = ulog.frd(truth.angular_velocity)
    head = {**ulog.stamps(truth.t_ns), "q": q.astype("f4")}
    if legacy:
        axes = {axis: position[:, k] for k, axis in enumerate("xyz")}
        speeds = {f"v{axis}": velocity[:, k] for k, axis in enumerate("xyz")}
        turns = dict(zip(("rollspeed", "pitchspeed", "yawspeed"), rates.T, strict=True))
        frames = {"local_frame": np.full(n, frame - 1, "u1")}
        frames["velocity_frame"] = np.full(n, velocity_frame, "u1")
        return {**head, **frames, **axes, **speeds, **turns}
    return {
        **head, "pose_frame": np.full(n, frame, "u1"), "position": position,
        "velocity_frame": np.full(n, velocity_frame, "u1"), "velocity": velocity,
        "angular_velocity": rates,
        "position_variance": np.tile([1.0, 4.0, 9.0], (n, 1)).astype("f4"),
        "orientation_variance": np.tile([1e-4, 1e-4, 1e-4], (n, 1)).astype("f4"),
        "velocity_variance": np.full((n, 3), 0.01, "f4"),
    }  # fmt: skip


@pytest.mark.parametrize("legacy", [False, True])
@pytest.mark.parametrize("frame", [1, 2])
@pytest.mark.parametrize("velocity_frame", ["world", "body"])
def test_odometry_of_any_frame(folder, flight, frame, velocity_frame, legacy):
    truth = flight.truth
    in_world = ulog.ned if frame == 1 else ulog.frd
    velocity = in_world(truth.velocity)
    if velocity_frame == "body":
        velocity = ulog.frd(rotation.rotate_inverse(truth.q_wb, truth.velocity))
    number = 3 if velocity_frame == "body" else frame - legacy
    topics = {"vehicle_odometry": odometry(truth, frame, number, velocity, legacy)}
    path = ulog.write(folder / f"odometry_{frame}_{velocity_frame}_{legacy}.ulg", topics)
    states = ims.read_states(path, "vehicle_odometry")
    np.testing.assert_allclose(states.position, truth.position, atol=32 * FLOAT32)
    np.testing.assert_allclose(states.velocity, truth.velocity, atol=64 * FLOAT32)
    np.testing.assert_allclose(states.angular_velocity, truth.angular_velocity, atol=4 * FLOAT32)
    turn = rotation.multiply(rotation.conjugate(states.q_wb), truth.q_wb)
    assert np.linalg.norm(rotation.log(turn), axis=1).max() < 8 * FLOAT32
    assert states.frame_id == ("world" if frame == 1 else "odom")
    if not legacy:
        expected = [4.0, 1.0, 9.0] if frame == 1 else [1.0, 4.0, 9.0]
        np.testing.assert_allclose(states.covariance[0].diagonal()[:3], expected)
        np.testing.assert_allclose(states.covariance[5].diagonal()[3:], 1e-4, rtol=1e-6)


def test_poses_of_a_camera_have_no_velocity_and_unknown_ones_are_told(folder, flight):
    columns = odometry(flight.truth, 2, 0, np.full((len(flight.truth), 3), np.nan, "f4"))
    columns["position"][3:5] = np.nan
    columns["q"][10, 0] = np.nan
    path = ulog.write(folder / "vision.ulg", {"vehicle_visual_odometry": columns})
    with pytest.warns(Remark, match="vehicle_visual_odometry: 3 poses left out"):
        states = ims.read_states(path, "vehicle_visual_odometry")
    assert (len(states), states.velocity) == (len(flight.truth) - 3, None)
    np.testing.assert_allclose(
        states.position, np.delete(flight.truth.position, [3, 4, 10], axis=0), atol=32 * FLOAT32
    )


def test_local_positions_that_are_invalid_are_left_out(folder, flight):
    topics = ulog.flight_topics(flight, "")
    topics["vehicle_local_position"]["xy_valid"] = np.arange(len(flight.truth)) >= 100
    path = ulog.write(folder / "invalid.ulg", topics)
    with pytest.warns(Remark, match="vehicle_local_position: 100 poses left out"):
        states = ims.read_states(path)
    assert states.t_ns[0] == flight.truth.t_ns[100]


def sensors(t_ns, legacy=False):
    n = len(t_ns)
    field_g = np.tile([0.2, 0.05, 0.45], (n, 1))
    pressure = np.full(n, 1013.25 if legacy else 101325.0, "f4")
    name = "vehicle_gps_position" if legacy else "sensor_gps/0"
    place = (
        {"lat": np.full(n, 473977420, "i4"), "lon": np.full(n, 85455940, "i4"),
         "alt": np.full(n, 488000, "i4"), "alt_ellipsoid": np.full(n, 535000, "i4")}
        if legacy else
        {"latitude_deg": np.full(n, 47.397742), "longitude_deg": np.full(n, 8.545594),
         "altitude_msl_m": np.full(n, 488.0), "altitude_ellipsoid_m": np.full(n, 535.0)}
    )  # fmt: skip
    fix_type = np.full(n, 3, "u1")
    fix_type[0] = 1
    return {
        "sensor_mag/0": {
            **ulog.stamps(t_ns), **{a: ulog.frd(field_g)[:, k] for k, a in enumerate("xyz")}
        },
        "sensor_baro/0": {**ulog.stamps(t_ns), "pressure": pressure},
        name: {
            **ulog.stamps(t_ns), **place, "fix_type": fix_type,
            "eph": np.full(n, 0.5, "f4"), "epv": np.full(n, 1.0, "f4"),
            "s_variance_m_s": np.full(n, 0.1, "f4"), "vel_n_m_s": np.full(n, 1.0, "f4"),
            "vel_e_m_s": np.full(n, 2.0, "f4"), "vel_d_m_s": np.full(n, 3.0, "f4"),
            "vel_ned_valid": np.ones(n, bool),
        },
    }  # fmt: skip


@pytest.mark.parametrize("legacy", [False, True])
def test_a_bag_keeps_all_sensors(folder, flight, legacy):
    """Names are those that ROS accepts; the values are in SI units, by another reader."""
    from rosbags.highlevel import AnyReader

    readings = flight.readings
    topics = {
        **ulog.flight_topics(flight, ""), **instance(0, readings), **instance(1, readings),
        "vehicle_odometry": odometry(flight.truth, 1, 1, ulog.ned(flight.truth.velocity)),
        **sensors(readings.t_ns[::10], legacy),
    }  # fmt: skip
    path = ulog.write(folder / f"all_{legacy}.ulg", topics)
    written = ims.convert(path, folder / f"all_{legacy}.bag")
    receiver = "/vehicle_gps_position" if legacy else "/sensor_gps_0"
    n, few = len(readings), len(readings.t_ns[::10])
    assert written.messages == {
        **dict.fromkeys(("/sensor_combined", "/sensor_gyro_0", "/sensor_gyro_1"), n),
        **{f"/sensor_{t}_{k}/temperature": n for t in ("gyro", "accel") for k in (0, 1)},
        **dict.fromkeys(("/vehicle_local_position", "/vehicle_odometry"), n),
        **dict.fromkeys(("/sensor_mag_0", "/sensor_baro_0", receiver), few),
        f"{receiver}/velocity": few,
    }
    messages = {}
    with AnyReader([written.output]) as reader:
        for connection, _, data in reader.messages():
            assert all(not part[0].isdigit() for part in connection.topic[1:].split("/"))
            message = reader.deserialize(data, connection.msgtype)
            messages.setdefault(connection.topic, []).append(message)
    field = messages["/sensor_mag_0"][0].magnetic_field
    np.testing.assert_allclose([field.x, field.y, field.z], [2e-5, 5e-6, 4.5e-5], rtol=1e-6)
    assert messages["/sensor_baro_0"][0].fluid_pressure == pytest.approx(101325.0, rel=1e-6)
    fixes = messages[receiver]
    assert [fixes[k].status.status for k in (0, 1)] == [-1, 0]
    place = (fixes[1].latitude, fixes[1].longitude, fixes[1].altitude)
    assert place == pytest.approx((47.397742, 8.545594, 535.0), abs=1e-9)
    np.testing.assert_allclose(
        fixes[1].position_covariance.reshape(3, 3).diagonal(), [0.25, 0.25, 1]
    )
    linear = messages[f"{receiver}/velocity"][0].twist.twist.linear
    assert (linear.x, linear.y, linear.z) == (2.0, 1.0, -3.0)
    of_log = ims.read_magnetometer(path, "sensor_mag/0")
    np.testing.assert_allclose(of_log.values[0], [2e-5, 5e-6, 4.5e-5], rtol=1e-6)


def test_a_file_of_another_kind_and_a_missing_library(folder, flight_log, monkeypatch):
    text = folder / "text.ulg"
    text.write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match="text.ulg: not a bag"):
        ims.read_readings(text)
    cpu_log = ulog.write(folder / "other.ulg", {"cpuload": ulog.stamps([10**9, 2 * 10**9])})
    with pytest.raises(InputError, match="ULog file without sensors or poses; it has cpuload"):
        ims.inspect(cpu_log)
    monkeypatch.setitem(sys.modules, "pyulog", None)
    copy = folder / "copy.ulg"
    copy.write_bytes(flight_log.read_bytes())
    with pytest.raises(MissingDependencyError, match="pip install pyulog"):
        ims.read_readings(copy)


def test_the_memory_for_a_large_log_is_told(folder, flight_log, monkeypatch):
    copy = folder / "large.ulg"
    copy.write_bytes(flight_log.read_bytes())
    monkeypatch.setattr(catalogue, "_LARGE", 1000)
    with pytest.warns(Remark, match="large.ulg: .*read as a whole.* MB of memory"):
        ims.read_readings(copy)

    def fail(path):
        raise MemoryError

    monkeypatch.setattr(px4, "contents", fail)
    copy.write_bytes(flight_log.read_bytes() + b" ")
    with pytest.raises(MachineError, match="large.ulg: is read as a whole, which takes up to"):
        ims.read_readings(copy)


def test_cut_files_are_read_as_far_as_they_go(folder, flight_log):
    content = flight_log.read_bytes()
    cut = folder / "cut.ulg"
    for size in (*range(0, 700, 23), len(content) // 2, len(content) - 5):
        cut.write_bytes(content[:size])
        assert len(problems_of(ims.read_readings, cut)) <= 1
    cut.write_bytes(content[: len(content) // 2])
    assert 400 < len(ims.read_readings(cut)) < 600


def test_damaged_files_are_told_in_lines(folder, flight_log):
    """Each error is lines that name the file; what pyulog prints is not on the output."""
    rng = np.random.default_rng(4)
    content = flight_log.read_bytes()[:20_000]
    path = folder / "damaged.ulg"
    for _ in range(60):
        data = bytearray(content)
        for position in rng.integers(0, rng.choice([700, len(data)]), rng.integers(1, 30)):
            data[position] = rng.integers(0, 256)
        path.write_bytes(data)
        for reader in (ims.read_readings, ims.read_states, ims.inspect):
            for line in problems_of(reader, path):
                assert str(path) in line or path.name in line


def test_a_definition_larger_than_a_message_is_refused(folder):
    path = folder / "huge.ulg"
    huge = ulog.message("F", b"sensor_combined:uint64_t timestamp;uint8_t[2000000000] x;")
    path.write_bytes(ulog.MAGIC + bytes(8) + huge)
    with pytest.raises(InputError, match="larger than 64 kB"):
        ims.read_readings(path)
