# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of phones by Sensor Logger and phyphox: axes, signs, units, stamps, damage."""

import device_logs
import numpy as np
import pytest
from device_logs import EPOCH, HEIGHT, LATITUDE, LONGITUDE, G
from refusals import problems_of

import imu_sim_ros as ims
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError, Remark

pytestmark = pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")


@pytest.fixture(scope="module")
def flight():
    return ims.simulate(
        imu="bmi088", trajectory="figure_eight", duration=3, rate=100, seed=1, start_time=50.0
    )


def assert_readings(readings, flight, t_ns=None, atol=1e-9):
    expected = flight.readings
    np.testing.assert_array_equal(readings.t_ns, expected.t_ns + EPOCH if t_ns is None else t_ns)
    np.testing.assert_allclose(readings.gyro, expected.gyro, atol=atol)
    np.testing.assert_allclose(readings.accel, expected.accel, atol=atol)


def messages_of(path, tmp_path):
    """Return the last message of each topic of a recording, converted to a ROS 1 bag."""
    from rosbags.highlevel import AnyReader

    written = ims.convert(path, tmp_path / "phone.bag")
    with AnyReader([written.output]) as reader:
        return {c.topic: reader.deserialize(d, c.msgtype) for c, _, d in reader.messages()}


SYSTEMS = [("android", False), ("ios", False), ("ios", True), (None, False)]


@pytest.mark.parametrize(("system", "standard"), SYSTEMS)
def test_sensor_logger_has_the_signs_of_the_system(tmp_path, flight, system, standard):
    folder = device_logs.sensor_logger(tmp_path / "run", flight, system, standard)
    assert_readings(ims.read_readings(folder), flight)
    raw = ims.read_readings(folder, "AccelerometerUncalibrated.csv")
    np.testing.assert_allclose(raw.accel, flight.readings.accel + 0.1, atol=1e-9)
    np.testing.assert_allclose(raw.gyro, flight.readings.gyro + 0.01, atol=1e-9)
    messages = messages_of(folder, tmp_path)
    q = messages["/Gyroscope"].orientation
    turn = rotation.multiply(rotation.conjugate(flight.truth.q_wb[-1]), [q.w, q.x, q.y, q.z])
    assert np.linalg.norm(rotation.log(turn)) < 1e-9
    field = messages["/Magnetometer"].magnetic_field
    np.testing.assert_allclose([field.x, field.y, field.z], [2e-5, -5e-6, -4.5e-5])
    assert messages["/Barometer"].fluid_pressure == pytest.approx(101325.0)
    fix = messages["/Location"]
    assert (fix.latitude, fix.longitude, fix.altitude) == (LATITUDE, LONGITUDE, HEIGHT)
    np.testing.assert_allclose(fix.position_covariance[[0, 4, 8]], [25.0, 25.0, 12.25])


def test_a_missing_platform_is_told(tmp_path, flight):
    folder = device_logs.sensor_logger(tmp_path / "run", flight, None)
    with pytest.warns(Remark, match="no Metadata.csv that names the system"):
        ims.read_readings(folder)


def test_a_phone_flat_on_the_table_has_gravity_up(tmp_path):
    """Apple logs -1 g on z of a phone at rest, screen up, where the specific force is +1 g."""
    folder = tmp_path / "flat"
    t = np.arange(20) * 10**7 + EPOCH
    for name, row in (("Gyroscope", "0,0,0"), ("Accelerometer", "0,0,0"), ("Gravity", f"-{G},0,0")):
        lines = [f"{stamp},{(stamp - EPOCH) * 1e-9},{row}" for stamp in t]
        device_logs.table(folder, f"{name}.csv", "time,seconds_elapsed,z,y,x", lines)
    device_logs.table(folder, "metadata.csv", "version,platform", ["2,iOS"])
    np.testing.assert_allclose(ims.read_readings(folder).accel, np.tile([0, 0, G], (20, 1)))


def test_a_zip_is_read_as_its_folder(tmp_path, flight):
    for prefix in ("", "2026-01-01_12-00-00/"):
        folder = device_logs.sensor_logger(tmp_path / f"run{len(prefix)}", flight)
        assert_readings(ims.read_readings(device_logs.zipped(folder, prefix)), flight)
        folder, t_ns = device_logs.phyphox(tmp_path / f"phyphox{len(prefix)}", flight)
        assert_readings(ims.read_readings(device_logs.zipped(folder, prefix)), flight, t_ns)


def test_several_recordings_are_refused(tmp_path, flight):
    """Two in one folder are never mixed."""
    for k, write in enumerate((device_logs.sensor_logger, device_logs.phyphox)):
        for name in ("monday", "tuesday"):
            write(tmp_path / str(k) / name, flight)
        for path in (tmp_path / str(k), device_logs.zipped(tmp_path / str(k))):
            with pytest.raises(InputError, match="several recordings: monday, tuesday"):
                ims.read_readings(path)


def test_uncalibrated_readings_alone_are_read(tmp_path, flight):
    folder = device_logs.sensor_logger(tmp_path / "run", flight)
    for name in ("Gyroscope", "Accelerometer", "TotalAcceleration", "Gravity"):
        (folder / f"{name}.csv").unlink()
    readings = ims.read_readings(folder)
    np.testing.assert_allclose(readings.gyro, flight.readings.gyro + 0.01, atol=1e-9)


def test_stamps_of_each_sensor_are_its_own(tmp_path, flight):
    """The accelerometer is interpolated as two topics are, and the loss is told."""
    folder = device_logs.sensor_logger(tmp_path / "run", flight, skew_ns=4_000_000)
    with pytest.warns(Remark, match="accelerometer is interpolated to the times of the gyroscope"):
        readings = ims.read_readings(folder)
    expected = flight.readings
    # Before the first reading of the accelerometer there is none.
    np.testing.assert_array_equal(readings.t_ns, expected.t_ns[1:] + EPOCH)
    np.testing.assert_allclose(
        readings.accel, 0.4 * expected.accel[:-1] + 0.6 * expected.accel[1:], atol=1e-5
    )
    apart = ims.read_readings(folder, "TotalAcceleration")
    np.testing.assert_array_equal(apart.t_ns, expected.t_ns[:-1] + EPOCH + 4_000_000)
    np.testing.assert_allclose(apart.accel, expected.accel[:-1], atol=1e-9)


def test_an_acceleration_without_gravity_is_no_specific_force(tmp_path, flight):
    folder = device_logs.sensor_logger(tmp_path / "run", flight, "ios")
    (folder / "Gravity.csv").unlink()
    (folder / "AccelerometerUncalibrated.csv").unlink()
    with pytest.warns(Remark, match="left out: it is without gravity"):
        assert ims.read_readings(folder, "Gyroscope").accel is None
    phyphox_folder, _ = device_logs.phyphox(tmp_path / "phyphox", flight, linear=True)
    (phyphox_folder / "Gravity.csv").unlink()
    with pytest.warns(Remark, match="left out: it is without gravity"):
        assert ims.read_readings(phyphox_folder).accel is None


def test_a_wrong_orientation_is_left_out(tmp_path, flight):
    folder = device_logs.sensor_logger(tmp_path / "run", flight)
    name = folder / "Orientation.csv"
    name.write_text(name.read_text().replace("qz,qy,qx,qw", "qx,qw,qz,qy"))  # a half turn about y
    with pytest.warns(Remark, match="Orientation is left out"):
        ims.read_readings(folder)


@pytest.mark.parametrize(
    ("separator", "decimal", "linear", "names"),
    [
        (",", ".", False, None),
        ("\t", ".", False, "Beschleunigung"),
        (";", ",", True, None),
        ("\t", ",", True, "Przyspieszenie liniowe"),
    ],
)
def test_phyphox_in_each_form_of_export(tmp_path, flight, separator, decimal, linear, names):
    folder, t_ns = device_logs.phyphox(tmp_path / "run", flight, separator, decimal, linear, names)
    assert_readings(ims.read_readings(folder), flight, t_ns)
    messages = messages_of(folder, tmp_path)
    field = messages["/magnetometer"].magnetic_field
    np.testing.assert_allclose([field.x, field.y, field.z], [2e-5, -5e-6, -4.5e-5])
    assert messages["/barometer"].fluid_pressure == pytest.approx(101325.0)
    fix = messages["/location"]
    assert (fix.latitude, fix.longitude, fix.altitude) == (LATITUDE, LONGITUDE, HEIGHT)
    (folder / "meta/time.csv").unlink()
    with pytest.warns(Remark, match="the stamps count from it"):
        assert ims.read_readings(folder).t_ns[0] == 0


def test_a_flight_of_a_phone_goes_through_the_jobs(tmp_path, flight):
    """Allan deviation of a phone at rest, and dead reckoning of one in motion."""
    still = ims.simulate(imu="bmi088", trajectory="static", duration=70, rate=50, seed=3)
    folder = device_logs.zipped(device_logs.sensor_logger(tmp_path / "still", still))
    noise = ims.allan(folder)
    for triad, density in ((noise.gyroscope, 1.73e-4), (noise.accelerometer, 1.11e-3)):
        estimate = triad.noise_density
        assert estimate.low[0] < density < estimate.high[0]  # of the preset, axis x
    folder = device_logs.sensor_logger(tmp_path / "moving", flight)
    assert not [f for f in ims.inspect(folder).findings if f.severity == "error"]
    track = ims.dead_reckon(folder, initial="parameters")
    assert len(track.position) >= len(flight.readings) - 1


def test_damaged_and_cut_recordings_are_told_in_lines(tmp_path, flight, capfd):
    rng = np.random.default_rng(4)
    short = ims.simulate(imu="bmi088", duration=0.3, rate=100, seed=1)
    folders = [device_logs.sensor_logger(tmp_path / "run", short),
               device_logs.phyphox(tmp_path / "phyphox", short)[0]]  # fmt: skip
    for folder in folders:
        content = device_logs.zipped(folder).read_bytes()
        copy = tmp_path / "copy.zip"
        for number in range(40):
            data = bytearray(content)
            for position in rng.integers(0, len(data), rng.integers(1, 30)):
                data[position] = rng.integers(0, 256)
            copy.write_bytes(data[: rng.integers(4, len(data))] if number % 2 else data)
            assert all("copy.zip" in line for line in problems_of(ims.read_readings, copy))
        names = sorted(file for file in folder.rglob("*.csv"))
        for number in range(60):
            file = names[number % len(names)]
            intact = file.read_bytes()
            data = bytearray(intact)
            for position in rng.integers(0, len(data), rng.integers(1, 30)):
                data[position] = rng.integers(0, 256)
            file.write_bytes(data[: rng.integers(0, len(data))] if number % 2 else data)
            assert all(folder.name in line for line in problems_of(ims.read_readings, folder))
            file.write_bytes(intact)
    assert capfd.readouterr() == ("", "")
