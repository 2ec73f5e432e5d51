# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""KITTI, NCLT, Xsens, VectorNav, UZH-FPV and Newer College: axes, units, stamps, damage."""

import tracemalloc

import device_logs
import numpy as np
import pytest
from device_logs import EPOCH, HEIGHT, LATITUDE, LONGITUDE
from refusals import problems_of

import imu_sim_ros as ims
from imu_sim_ros.bags.logs import kitti, nclt, phyphox, sensor_logger, vectornav, xsens
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError, Remark
from imu_sim_ros.inputs.poses import write_tum

pytestmark = pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")


@pytest.fixture(scope="module")
def flight():
    return ims.simulate(
        imu="bmi088", trajectory="figure_eight", duration=3, rate=100, seed=1, start_time=50.0
    )


def assert_readings(readings, flight, epoch=EPOCH, atol=1e-9):
    expected = flight.readings
    np.testing.assert_array_equal(readings.t_ns, expected.t_ns + epoch)
    np.testing.assert_allclose(readings.gyro, expected.gyro, atol=atol)
    np.testing.assert_allclose(readings.accel, expected.accel, atol=atol)


def assert_states(states, flight, position=1e-6, velocity=1e-9):
    truth = flight.truth
    offset = truth.position[0] - states.position[0]
    np.testing.assert_allclose(states.position + offset, truth.position, atol=position)
    if states.velocity is not None:
        np.testing.assert_allclose(states.velocity, truth.velocity, atol=velocity)
    turn = rotation.multiply(rotation.conjugate(states.q_wb), truth.q_wb)
    assert np.linalg.norm(rotation.log(turn), axis=1).max() < 1e-9


def last_messages(path, tmp_path):
    from rosbags.highlevel import AnyReader

    written = ims.convert(path, tmp_path / "copy.bag", force=True)
    with AnyReader([written.output]) as reader:
        return {c.topic: reader.deserialize(d, c.msgtype) for c, _, d in reader.messages()}


def orientation_error(message, flight):
    q = message.orientation
    turn = rotation.multiply(rotation.conjugate(flight.truth.q_wb[-1]), [q.w, q.x, q.y, q.z])
    return np.linalg.norm(rotation.log(turn))


def test_kitti_is_read_from_the_drive_its_oxts_and_a_zip(tmp_path, flight):
    drive = device_logs.kitti(tmp_path / "2011_09_26_drive_0001_sync", flight)
    for path in (drive, drive / "oxts", device_logs.zipped(drive, f"2011_09_26/{drive.name}/")):
        assert_readings(ims.read_readings(path), flight)
        assert_states(ims.read_states(path), flight)
    messages = last_messages(drive, tmp_path)
    assert orientation_error(messages["/oxts/imu"], flight) < 1e-9
    fix = messages["/oxts/fix"]
    place = device_logs.geodetic(flight.truth.position)[-1]
    np.testing.assert_allclose([fix.latitude, fix.longitude, fix.altitude], place, atol=1e-9)
    np.testing.assert_allclose(fix.position_covariance[[0, 4, 8]], 0.05**2)
    track, of_flight = ims.dead_reckon(drive), ims.dead_reckon(flight)
    moved = track.position - track.position[0]
    np.testing.assert_allclose(moved, of_flight.position - of_flight.position[0], atol=1e-4)


def test_several_drives_are_refused(tmp_path, flight):
    for name in ("0001", "0002"):
        device_logs.kitti(tmp_path / "day" / name, flight)
        device_logs.nclt(tmp_path / "sessions" / name, flight)
    for path in (device_logs.zipped(tmp_path / "day"), tmp_path / "sessions"):
        with pytest.raises(InputError, match="several recordings: 0001"):
            ims.read_readings(path)


def test_kitti_without_a_file_keeps_the_others(tmp_path, flight):
    drive = device_logs.kitti(tmp_path / "drive", flight)
    (drive / "oxts/data/0000000007.txt").unlink()
    (drive / "oxts/data/0000000009.txt").write_text("1 2 3\n")
    with pytest.warns(Remark, match="2 of 300 times left out"):
        readings = ims.read_readings(drive)
    rows = np.delete(np.arange(300), [7, 9])
    np.testing.assert_array_equal(readings.t_ns, flight.readings.t_ns[rows] + EPOCH)


def test_nclt_has_down_axes(tmp_path, flight):
    folder = device_logs.nclt(tmp_path / "2012-01-08", flight)
    table = folder / "sensor_data/ms25.csv"
    for path in (folder, table):
        assert_readings(ims.read_readings(path), flight)
    truth = folder / "ground_truth/groundtruth_2012-01-08.csv"
    for path in (folder, truth):
        with pytest.warns(Remark, match="1 rows left out"):
            states = ims.read_states(path)
        assert_states(states, flight, velocity=0.1)
        # Central differences over 20 ms: the error is v'' dt^2 / 6, below 2e-4.
        error = states.velocity - flight.truth.velocity
        assert np.abs(error[1:-1]).max() < 1e-3
    messages = last_messages(folder, tmp_path)
    field = messages["/ms25/magnetic_field"].magnetic_field
    np.testing.assert_allclose([field.x, field.y, field.z], [2e-5, -5e-6, -4.5e-5])
    fix = messages["/gps"]
    assert (fix.latitude, fix.longitude) == pytest.approx((LATITUDE, LONGITUDE), abs=1e-12)
    assert fix.altitude == HEIGHT


@pytest.mark.parametrize("separator", ["\t", ";", ",", " "])
def test_xsens_with_each_separator(tmp_path, flight, separator):
    export = device_logs.xsens(tmp_path / "MT_0080.txt", flight, separator)
    # The counter begins again in the middle of the export.
    epoch = 2**32 * 100_000 - int(flight.readings.t_ns[150])
    assert_readings(ims.read_readings(export), flight, epoch)
    messages = last_messages(export, tmp_path)
    assert orientation_error(messages["/imu"], flight) < 1e-9
    assert messages["/temperature"].temperature == 31.5


def test_xsens_by_increments_counter_and_matrix(tmp_path, flight):
    steps = device_logs.xsens(tmp_path / "sdi.csv", flight, increments=True)
    np.testing.assert_allclose(ims.read_readings(steps).accel, flight.readings.accel, atol=1e-9)
    np.testing.assert_allclose(ims.read_readings(steps).gyro, flight.readings.gyro, atol=1e-9)
    counted = device_logs.xsens(tmp_path / "mtw.txt", flight, matrix=True, times=False)
    assert_readings(ims.read_readings(counted), flight, -int(flight.readings.t_ns[0]))
    assert orientation_error(last_messages(counted, tmp_path)["/imu"], flight) < 1e-9
    head = "// Start Time: Unknown"
    bare = device_logs.xsens(tmp_path / "bare.txt", flight, times=False, head=head)
    with pytest.warns(Remark, match="100 Hz are assumed"):
        ims.read_readings(bare)


def test_increments_are_divided_by_the_interval_of_the_clock(tmp_path):
    """Stamps of 300 Hz in units of 0.1 ms are 3.3 or 3.4 ms apart, 3.3333 ms on average."""
    flight = ims.simulate(imu="bmi088", trajectory="circle", rate=300, duration=4, seed=1)
    export = device_logs.xsens(tmp_path / "sdi.csv", flight, increments=True)
    readings = ims.read_readings(export)
    # Half a unit at either end of 4 s.
    np.testing.assert_allclose(readings.accel, flight.readings.accel, rtol=1e-4 / 4.0)
    np.testing.assert_allclose(readings.gyro, flight.readings.gyro, rtol=1e-4 / 4.0)


def test_xsens_dot_has_degrees_and_microseconds(tmp_path, flight):
    head = "sep=,\nDeviceTag:,Xsens DOT"
    export = device_logs.xsens(tmp_path / "dot.csv", flight, ",", head=head, ticks=10**6)
    readings = ims.read_readings(export)
    np.testing.assert_array_equal(np.diff(readings.t_ns), np.diff(flight.readings.t_ns))
    np.testing.assert_allclose(readings.gyro, np.radians(flight.readings.gyro), atol=1e-9)


MESSAGES = ["VNYMR", "VNQMR", "VNMAR", "VNIMU", "VNDTV", "VNISL"]


@pytest.mark.parametrize("name", MESSAGES)
def test_vectornav_has_down_axes(tmp_path, flight, name):
    log = device_logs.vectornav(tmp_path / "log.txt", flight, name)
    assert_readings(ims.read_readings(log), flight, atol=1e-8)
    messages = last_messages(log, tmp_path)
    if name in ("VNYMR", "VNQMR", "VNISL"):
        assert orientation_error(messages[f"/{name}"], flight) < 1e-9
    if f"/{name}/magnetic_field" in messages:
        field = messages[f"/{name}/magnetic_field"].magnetic_field
        np.testing.assert_allclose([field.x, field.y, field.z], [2e-5, -5e-6, -4.5e-5])
    if name == "VNIMU":
        assert messages["/VNIMU/pressure"].fluid_pressure == pytest.approx(101_300.0)
        assert messages["/VNIMU/temperature"].temperature == pytest.approx(20.7)
    if name == "VNISL":
        assert_states(ims.read_states(log), flight)


@pytest.mark.parametrize("name", ["VNINS", "VNGPS"])
def test_vectornav_with_gps_times(tmp_path, flight, name):
    log = device_logs.vectornav(tmp_path / "log.csv", flight, name, time=None)
    # Week 2288 began at 2023-11-12 00:00:00 GPS time, 18 s before that of UTC.
    start = int(np.datetime64("2023-11-12T00:00:00", "ns").astype(np.int64)) - 18 * 10**9
    if name == "VNINS":
        states = ims.read_states(log)
        assert_states(states, flight)
        # Eight decimals of a second of the week are 2^-35 s.
        expected = flight.truth.t_ns + start + 180_000 * 10**9
        np.testing.assert_allclose(states.t_ns - expected, 0, atol=100)
        return
    with open_bag(log) as bag:
        assert [info.name for info in bag.topics] == ["/VNGPS", "/VNGPS/velocity"]


def test_vectornav_messages_have_times_from_counter_rate_or_prefix(tmp_path, flight):
    counted = device_logs.vectornav(tmp_path / "counter.log", flight, time="counter", bits=16)
    assert_readings(ims.read_readings(counted), flight, 0, atol=1e-8)
    rated = device_logs.vectornav(tmp_path / "rate.txt", flight, time="rate")
    assert_readings(ims.read_readings(rated), flight, -int(flight.readings.t_ns[0]), atol=1e-8)
    bare = device_logs.vectornav(tmp_path / "bare.txt", flight, time=None)
    with pytest.warns(Remark, match="no times: 40 Hz are assumed"):
        readings = ims.read_readings(bare)
    assert set(np.diff(readings.t_ns)) == {25_000_000}
    for prefix in ("2023-11-14 22:13:20.5 ", "[2023-11-14T22:13:20.500000Z] ", "1700000000500\t"):
        line = bare.read_text().splitlines()[0]
        (tmp_path / "one.txt").write_text(f"{prefix}{line}\n")
        assert ims.read_readings(tmp_path / "one.txt").t_ns.tolist() == [EPOCH + 5 * 10**8]


def test_vectornav_with_wrong_checksums(tmp_path, flight):
    """A message whose checksum is wrong is left out, and the others keep their times."""
    log = device_logs.vectornav(tmp_path / "log.txt", flight, time="rate")
    lines = log.read_text().splitlines()
    lines[5] = lines[5].replace("+", "-", 1)
    log.write_text("\n".join(lines))
    with pytest.warns(Remark, match="1 messages left out"):
        readings = ims.read_readings(log)
    expected = np.delete(flight.readings.t_ns, 4) - flight.readings.t_ns[0]
    np.testing.assert_array_equal(readings.t_ns, expected)


def test_examples_of_the_manuals_are_valid(tmp_path):
    """Lines that users and manuals publish, among them one upside down."""
    lines = [
        "$VNYMR,-078.104,+005.642,+023.096,+00.0125,+00.1252,-00.1042,+00.878,-03.762,-08.854,"
        "-00.010387,-00.028062,-00.061305*68",
        "$VNYMR,+100.949,-007.330,+000.715,-00.0049,-00.2449,+00.5397,-01.258,-00.100,-09.701,"
        "-00.000018,+00.001122,-00.000551*69",
    ]
    path = tmp_path / "log.txt"
    path.write_text("\n".join(lines))
    readings = ims.read_readings(path)
    np.testing.assert_allclose(readings.accel, [[0.878, 3.762, 8.854], [-1.258, 0.1, 9.701]])
    np.testing.assert_allclose(readings.gyro[0], [-0.010387, 0.028062, 0.061305])


def tables_of(folder, flight, form):
    """Write the tables of a dataset with headers: uzh, newer_college or tum_vi."""
    readings, truth = flight.readings, flight.truth
    t, q = readings.t_ns + EPOCH, truth.q_wb
    folder.mkdir()

    def write(name, head, separator, *columns):
        rows = zip(*columns, strict=True)
        lines = [head, *(separator.join(map(str, row)) for row in rows)]
        (folder / name).write_text("\n".join(lines) + "\n")

    imu = (*readings.gyro.T.tolist(), *readings.accel.T.tolist())
    pose = (*truth.position.T.tolist(), *q[:, [1, 2, 3, 0]].T.tolist())
    second, part = (column.tolist() for column in np.divmod(t, 10**9))
    count = range(len(t))
    if form == "uzh":
        seconds = [f"{s}.{n:09d}000" for s, n in zip(second, part, strict=True)]
        write("imu.txt", "# timestamp ang_vel_x ang_vel_y ang_vel_z lin_acc_x lin_acc_y lin_acc_z",
              " ", count, seconds, *imu)  # fmt: skip
        write("groundtruth.txt", "# timestamp tx ty tz qx qy qz qw", " ", seconds, *pose)
    elif form == "newer_college":
        write("imu_data.csv", "#counter,sec,nsec,wx,wy,wz,ax,ay,az", ",", count, second, part, *imu)
        write("registered_poses.csv", "#sec,nsec,x,y,z,qx,qy,qz,qw", ",", second, part, *pose)
    else:
        write("imu.txt", "# timestamp[ns] w.x w.y w.z a.x a.y a.z", " ", t.tolist(), *imu)
        write("gt_imu.csv", "# timestamp[ns],tx,ty,tz,qw,qx,qy,qz", ",", t.tolist(), *pose[:3],
              *q.T.tolist())  # fmt: skip
    return folder


@pytest.mark.parametrize("form", ["uzh", "newer_college", "tum_vi"])
def test_tables_of_datasets_obey_their_headers(tmp_path, flight, form):
    folder = tables_of(tmp_path / form, flight, form)
    names = {"uzh": ("imu.txt", "groundtruth.txt"), "tum_vi": ("imu.txt", "gt_imu.csv"),
             "newer_college": ("imu_data.csv", "registered_poses.csv")}[form]  # fmt: skip
    for imu, poses in ((folder, folder), (folder / names[0], folder / names[1])):
        assert_readings(ims.read_readings(imu), flight)
        assert_states(ims.read_states(poses), flight)
    assert not [f for f in ims.inspect(folder).findings if f.severity == "error"]


def test_each_recording_goes_through_the_programs(tmp_path, flight):
    """Inspection, dead reckoning, and a comparison of the estimate with the truth in the file."""
    paths = [device_logs.kitti(tmp_path / "drive", flight),
             device_logs.nclt(tmp_path / "nclt", flight),
             device_logs.xsens(tmp_path / "mt.txt", flight),
             device_logs.vectornav(tmp_path / "vn.txt", flight, "VNISL")]  # fmt: skip
    for path in paths:
        assert not [f for f in ims.inspect(path).findings if f.severity == "error"], path
        assert len(ims.dead_reckon(path, initial="parameters").position) >= 299
        copy = ims.convert(path, tmp_path / f"{path.stem}.mcap").output
        np.testing.assert_array_equal(ims.read_readings(copy).gyro, ims.read_readings(path).gyro)
        if path != paths[2]:
            write_tum(tmp_path / "estimate.tum", ims.read_states(path))
            # Twelve digits of positions of metres.
            result = ims.evaluate(tmp_path / "estimate.tum", path, align="none")
            assert result.rms_position < 1e-9


def test_memory_is_within_what_is_stated(tmp_path, flight):
    """The peak of what Python and NumPy allocate, besides a constant part."""
    logs = [(kitti, device_logs.kitti(tmp_path / "drive", flight)),
            (nclt, device_logs.nclt(tmp_path / "nclt", flight)),
            (xsens, device_logs.xsens(tmp_path / "mt.txt", flight)),
            (vectornav, device_logs.vectornav(tmp_path / "vn.txt", flight)),
            (sensor_logger, device_logs.sensor_logger(tmp_path / "phone", flight)),
            (phyphox, device_logs.phyphox(tmp_path / "phyphox", flight)[0])]  # fmt: skip
    for module, path in logs:
        files = path.rglob("*") if path.is_dir() else [path]
        size = sum(file.stat().st_size for file in files if file.is_file())
        tracemalloc.start()
        module.contents(path)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < module.MEMORY * size + 200_000, (path, peak / size)


def test_damaged_and_cut_logs_are_told_in_lines(tmp_path, capfd):
    rng = np.random.default_rng(5)
    short = ims.simulate(imu="bmi088", duration=0.3, rate=100, seed=1)
    files = [
        device_logs.xsens(tmp_path / "mt.txt", short),
        device_logs.vectornav(tmp_path / "vn.txt", short),
        device_logs.nclt(tmp_path / "nclt", short) / "sensor_data/ms25.csv",
        tables_of(tmp_path / "uzh", short, "uzh") / "imu.txt",
        device_logs.kitti(tmp_path / "drive", short) / "oxts/timestamps.txt",
        tmp_path / "drive/oxts/data/0000000003.txt",
    ]
    for file in files:
        path = file if "drive" not in str(file) else tmp_path / "drive"
        content = file.read_bytes()
        for number in range(50):
            data = bytearray(content)
            for position in rng.integers(0, rng.choice([300, len(data)]), rng.integers(1, 30)):
                data[position % len(data)] = rng.integers(0, 256)
            file.write_bytes(data[: rng.integers(0, len(data))] if number % 2 else data)
            for reader in (ims.read_readings, ims.read_states):
                for line in problems_of(reader, path):
                    assert path.name in line
        file.write_bytes(content)
    assert capfd.readouterr() == ("", "")
