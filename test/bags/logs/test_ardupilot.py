# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Logs of ArduPilot, binary and text: every message that is read, and damaged files."""

import sys

import dataflash
import numpy as np
import pytest
import ulog
from refusals import problems_of

import imu_sim_ros as ims
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.commands import inspect
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError, MissingDependencyError, Remark
from imu_sim_ros.inputs.poses import write_tum

pytest.importorskip("pymavlink")
pytestmark = pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
FLOAT32 = 2.0**-24
"""Relative rounding of the numbers in a log."""
LATITUDE, LONGITUDE = -35.363262, 149.165237


@pytest.fixture(scope="module")
def flight():
    return ims.simulate(
        imu="bmi088", trajectory="figure_eight", duration=5, rate=100, seed=1, start_time=50.0
    )


def stamps(t_ns):
    return {"TimeUS": np.asarray(t_ns) // 1000}


def triads(readings, names=("Gyr", "Acc")):
    columns = {}
    for name, values in zip(names, (readings.gyro, readings.accel), strict=True):
        columns |= {f"{name}{a}": ulog.frd(values)[:, k] for k, a in enumerate("XYZ")}
    return columns


def quaternion(truth):
    return {f"Q{k + 1}": column for k, column in enumerate(ulog.q_ned_frd(truth.q_wb).T)}


def angles(truth):
    degrees = np.degrees(rotation.to_euler(ulog.q_ned_frd(truth.q_wb)))
    degrees[:, 2] %= 360.0
    return dict(zip(("Roll", "Pitch", "Yaw"), degrees.T, strict=True))


def motion(truth):
    position, velocity = ulog.ned(truth.position), ulog.ned(truth.velocity)
    return {
        **{f"P{a}": position[:, k] for k, a in enumerate("NED")},
        **{f"V{a}": velocity[:, k] for k, a in enumerate("NED")},
    }


@pytest.fixture(scope="module")
def tables(flight):
    readings, truth = flight.readings, flight.truth
    t, n = stamps(readings.t_ns), len(readings)
    slow = stamps(readings.t_ns[::20])
    few = len(slow["TimeUS"])
    full = np.full(few, 1.0)
    return {
        "IMU/0": {**t, **triads(readings), "T": np.full(n, 31.5)},
        "IMU/1": {**t, "I": np.ones(n), **triads(readings), "T": np.full(n, 33.5)},
        "XKF1": {**stamps(truth.t_ns), **angles(truth), **motion(truth)},
        "XKQ": {**stamps(truth.t_ns), **quaternion(truth)},
        "ATT": {**stamps(truth.t_ns), **angles(truth)},
        "POS": {**slow, "Lat": full * LATITUDE, "Lng": full * LONGITUDE, "Alt": full * 584.0},
        "GPS": {
            **slow, "Status": full * 3, "Lat": full * LATITUDE, "Lng": full * LONGITUDE,
            "Alt": full * 584.1, "Spd": full * 2.0, "GCrs": full * 90.0, "VZ": full * 0.5,
        },
        "GPA": {**slow, "HAcc": full * 0.8, "VAcc": full * 1.2, "SAcc": full * 0.3},
        "MAG": {**slow, "MagX": full * 200, "MagY": full * 50, "MagZ": full * 450},
        "BARO": {**slow, "Press": full * 94500.0, "Temp": full * 35.0},
        "VIBE": {**slow, "Clip": np.maximum(np.arange(few) - few + 4, 0)},
    }  # fmt: skip


@pytest.fixture(scope="module", params=["binary", "text"])
def path(request, tables, tmp_path_factory):
    folder = tmp_path_factory.mktemp("dataflash")
    if request.param == "binary":
        return dataflash.write(folder / "flight.bin", tables)
    return dataflash.write_text(folder / "flight.log", tables)


def test_readings_are_those_of_the_flight(path, flight):
    for topic in (None, "IMU/1", "IMU2", "IMU_0"):
        readings = ims.read_readings(path, topic)
        np.testing.assert_array_equal(readings.t_ns, flight.readings.t_ns)
        np.testing.assert_allclose(readings.gyro, flight.readings.gyro, atol=4 * FLOAT32)
        np.testing.assert_allclose(readings.accel, flight.readings.accel, atol=32 * FLOAT32)


def test_the_filter_s_states_are_those_of_the_truth(path, flight):
    states, truth = ims.read_states(path), flight.truth
    np.testing.assert_allclose(states.position, truth.position, atol=32 * FLOAT32)
    np.testing.assert_allclose(states.velocity, truth.velocity, atol=64 * FLOAT32)
    turn = rotation.multiply(rotation.conjugate(states.q_wb), truth.q_wb)
    assert np.linalg.norm(rotation.log(turn), axis=1).max() < 8 * FLOAT32
    # Central differences of the attitude over 20 ms: the error is w'' dt^2 / 6, below 2e-4.
    np.testing.assert_allclose(
        states.angular_velocity[1:-1], truth.angular_velocity[1:-1], atol=1e-3
    )
    track = ims.dead_reckon(path)
    of_flight = ims.dead_reckon(flight)
    # Rounding of the readings is 1e-6 m/s^2, and of the start 1e-6 m and 1e-6 m/s.
    np.testing.assert_allclose(track.position, of_flight.position, atol=1e-3)


def test_positions_have_the_attitude_of_att(path, flight):
    states = ims.read_states(path, "POS")
    np.testing.assert_allclose(states.position, 0.0, atol=1e-6)
    assert states.velocity is None
    turn = rotation.multiply(rotation.conjugate(states.q_wb), flight.truth.q_wb[::20])
    # Angles are logged in hundredths of a degree: half of one in three axes is 1.5e-4.
    assert np.linalg.norm(rotation.log(turn), axis=1).max() < 2e-4


def test_a_bag_keeps_all_sensors(path, flight, tmp_path):
    conversion = ims.convert(path, tmp_path / "flight.bag")
    n, few = len(flight.readings), len(flight.readings.t_ns[::20])
    assert conversion.messages == {
        **dict.fromkeys(("/IMU_0", "/IMU_0/temperature", "/IMU_1", "/IMU_1/temperature"), n),
        "/XKF1_0": n,
        **dict.fromkeys(("/POS_0", "/GPS_0", "/GPS_0/velocity", "/MAG_0", "/BARO_0"), few),
    }
    field = ims.read_magnetometer(path).values
    np.testing.assert_allclose(field, np.tile([2e-5, -5e-6, -4.5e-5], (few, 1)), rtol=1e-12)
    assert ims.read_pressure(path).values[0] == pytest.approx(94500.0)
    from rosbags.highlevel import AnyReader

    with AnyReader([conversion.output]) as reader:
        messages = {c.topic: reader.deserialize(d, c.msgtype) for c, _, d in reader.messages()}
    fix = messages["/GPS_0"]
    assert (fix.latitude, fix.longitude) == pytest.approx((LATITUDE, LONGITUDE), abs=1e-7)
    assert fix.altitude == pytest.approx(584.1)
    np.testing.assert_allclose(fix.position_covariance[[0, 4, 8]], [0.64, 0.64, 1.44])
    linear = messages["/GPS_0/velocity"].twist.twist.linear
    assert (linear.x, linear.y, linear.z) == pytest.approx((2.0, 0.0, -0.5), abs=1e-12)
    assert messages["/IMU_1/temperature"].temperature == 33.5


def write_flight(path, flight):
    """Write the IMU and the filter of a flight."""
    readings, t = flight.readings, stamps(flight.truth.t_ns)
    return dataflash.write(path, {
        "IMU": {**stamps(readings.t_ns), **triads(readings)},
        "XKF1": {**t, **motion(flight.truth)}, "XKQ": {**t, **quaternion(flight.truth)},
    })  # fmt: skip


def test_allan_and_calibration_are_those_of_the_readings(tmp_path):
    still = ims.simulate(imu="bmi088", trajectory="static", duration=60, rate=50, seed=3)
    noise, expected = (ims.allan(x) for x in (write_flight(tmp_path / "still.bin", still), still))
    for triad in ("gyroscope", "accelerometer"):
        densities = [getattr(result, triad).noise_density.high for result in (noise, expected)]
        # Rounding to float32 is 1e-6 m/s^2, a thousandth of the noise of a reading.
        np.testing.assert_allclose(*densities, rtol=1e-3)
    turned = ims.simulate(imu="lecture", trajectory="six_position", rate=20, seed=1)
    biases = [
        ims.calibrate_six_position(x).parameters["accelerometer_bias"].value
        for x in (write_flight(tmp_path / "six.bin", turned), turned)
    ]
    np.testing.assert_allclose(*biases, atol=1e-5)


def test_a_twin_and_a_comparison_are_those_of_the_flight(tmp_path):
    """The flight's own states are the truth; an estimate is compared with the filter's."""
    flight = ims.simulate(imu="bmi088", trajectory="figure_eight", duration=12, rate=100, seed=1)
    log = write_flight(tmp_path / "flight.bin", flight)
    biases = [
        ims.twin(recording, truth).errors["gyroscope_bias"].value
        for recording, truth in ((log, log), (flight, flight.truth))
    ]
    np.testing.assert_allclose(*biases, atol=1e-5)
    write_tum(tmp_path / "estimate.tum", flight.truth)
    # Rounding of positions of at most 32 m to float32.
    assert ims.evaluate(tmp_path / "estimate.tum", log, align="none").rms_position < 32 * FLOAT32


def test_clipping_is_a_finding(path, capsys):
    (finding,) = (f for f in ims.inspect(path).findings if f.kind == "readings_clipped")
    assert "the accelerometer clipped 3 times" in finding.evidence
    assert finding.source.endswith("IMU/0")
    assert inspect.main([str(path), "--fail-on", "readings_clipped"]) == 3
    assert "readings_clipped" in capsys.readouterr().out


def test_old_names_are_instances(tmp_path, flight):
    t = stamps(flight.readings.t_ns)
    names = {"IMU": dataflash.FORMATS["IMU"], "IMU2": dataflash.FORMATS["IMU2"]}
    assert "I," not in names["IMU2"][1].split("TimeUS,")[1][:2]
    log = dataflash.write(tmp_path / "old.bin", {"IMU2": {**t, **triads(flight.readings)}})
    with open_bag(log) as bag:
        assert [info.name for info in bag.topics] == ["/IMU_1"]
    assert len(ims.read_readings(log, "IMU2")) == len(flight.readings)


def test_fast_samples_are_paired(tmp_path, flight):
    readings = flight.readings
    sampled = readings.t_ns // 1000
    columns = triads(readings)
    log = dataflash.write(tmp_path / "fast.bin", {
        name: {"TimeUS": sampled + 900, "SampleUS": sampled,
               **{f: v for f, v in columns.items() if f.lower().startswith(name.lower())}}
        for name in ("GYR", "ACC")
    })  # fmt: skip
    pair = ims.read_readings(log, "ACC/0")
    np.testing.assert_array_equal(pair.t_ns, readings.t_ns)
    np.testing.assert_allclose(pair.gyro, readings.gyro, atol=4 * FLOAT32)


def test_the_truth_of_the_simulator_is_the_truth(tmp_path, flight):
    t = stamps(flight.truth.t_ns)
    log = dataflash.write(tmp_path / "sim.bin", {
        "IMU": {**stamps(flight.readings.t_ns), **triads(flight.readings)},
        "SIM": {**t, **quaternion(flight.truth)}, "SIM2": {**t, **motion(flight.truth)},
        "XKF1": {**t, **angles(flight.truth), **motion(flight.truth)},
    })  # fmt: skip
    states = ims.read_states(log, "ground_truth/odom")
    np.testing.assert_allclose(states.position, flight.truth.position, atol=32 * FLOAT32)
    # The attitude of XKF1 alone has hundredths of a degree.
    turned = rotation.multiply(
        rotation.conjugate(ims.read_states(log, "XKF1").q_wb), flight.truth.q_wb
    )
    assert 1e-5 < np.linalg.norm(rotation.log(turned), axis=1).max() < 2e-4


def test_batches_are_unrolled_by_rate_and_multiplier(tmp_path):
    """Each triad has its own batches; the last one of a batch may be cut, and heads be missing."""
    rng = np.random.default_rng(2)
    counts = rng.integers(-3000, 3000, (3, 2, 32, 3)).astype("<i2")
    heads = {
        "TimeUS": np.array([1_000_100, 2_000_100]), "N": np.array([65535, 0]),
        "type": np.array([1, 0]), "instance": np.array([0, 0]), "mul": np.array([1000, 100]),
        "smp_cnt": np.array([64, 40]), "SampleUS": np.array([1_000_000, 2_000_000]),
        "smp_rate": np.array([1000.0, 2000.0]),
    }  # fmt: skip
    data = {
        "TimeUS": 1_000_200 + np.array([0, 1, 1_000_000, 1_000_001, 2_000_000, 2_000_001]),
        "N": np.array([65535, 65535, 0, 0, 9, 9]), "seqno": np.array([0, 1] * 3),
        **{a: counts[..., k].reshape(6, 32) for k, a in enumerate("xyz")},
    }  # fmt: skip
    log = dataflash.write(tmp_path / "batch.bin", {"ISBH": heads, "ISBD": data})
    with pytest.warns(Remark, match="1 batches left out"):
        gyro = ims.read_readings(log, "ISBH/gyro/0")
    accel = ims.read_readings(log, "ISBH/accel/0")
    assert (gyro.accel, accel.gyro) == (None, None)
    np.testing.assert_array_equal(gyro.t_ns, 10**9 + 10**6 * np.arange(64))
    np.testing.assert_array_equal(accel.t_ns, 2 * 10**9 + 500_000 * np.arange(40))
    turn = [1, -1, -1]
    np.testing.assert_allclose(gyro.gyro, counts[0].reshape(64, 3) / 1000 * turn)
    np.testing.assert_allclose(accel.accel, counts[1].reshape(64, 3)[:40] / 100 * turn)


def test_foreign_logs_and_a_missing_library(tmp_path, flight, monkeypatch):
    log = dataflash.write(tmp_path / "cpu.bin", {"CPU": stamps(flight.readings.t_ns[:5])})
    with pytest.raises(InputError, match="log of ArduPilot without sensors or poses; it has CPU"):
        ims.read_readings(log)
    looped = bytearray(log.read_bytes())
    looped[4 + 89] = 0  # length of the second definition
    log.write_bytes(looped)
    with pytest.raises(InputError, match="damaged: defines CPU with 0 bytes"):
        ims.read_readings(log)
    monkeypatch.setitem(sys.modules, "pymavlink.DFReader", None)
    log = dataflash.write(tmp_path / "copy.bin", {"CPU": stamps(flight.readings.t_ns[:6])})
    with pytest.raises(MissingDependencyError, match="pip install pymavlink"):
        ims.read_readings(log)


def test_damaged_and_cut_files_are_told_in_lines(path, capfd):
    rng = np.random.default_rng(4)
    content = path.read_bytes()[:20_000]
    copy = path.with_name(f"damaged{path.suffix}")
    for number in range(50):
        data = bytearray(content)
        for position in rng.integers(0, rng.choice([1500, len(data)]), rng.integers(1, 30)):
            data[position] = rng.integers(0, 256)
        copy.write_bytes(data[: rng.integers(0, len(data))] if number % 2 else data)
        for reader in (ims.read_readings, ims.inspect):
            for line in problems_of(reader, copy):
                assert copy.name in line
    assert capfd.readouterr() == ("", "")
