# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One door: every job takes every form in which readings and states are recorded."""

import importlib

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import imu_sim_ros as ims
from imu_sim_ros.commands import allan as allan_program
from imu_sim_ros.commands import dead_reckon as dead_reckon_program
from imu_sim_ros.core.errors import ConfigurationError, InputError, Remark

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = STORE.types
T0 = 1_700_000_000_000_000_000
GRAVITY = 9.81
pytestmark = pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")


def header(t_ns, frame):
    stamp = TYPE["builtin_interfaces/msg/Time"](int(t_ns // 10**9), int(t_ns % 10**9))
    return TYPE["std_msgs/msg/Header"](stamp, frame)


def vector(values, kind="Vector3"):
    return TYPE[f"geometry_msgs/msg/{kind}"](*map(float, values))


def imu(t_ns, gyro, accel, frame="imu"):
    """Return an Imu; a triad that is None is absent."""
    covariances = [np.array([0.0 if v is not None else -1.0, *[0.0] * 8]) for v in (gyro, accel)]
    zero = (0.0, 0.0, 0.0)
    return TYPE["sensor_msgs/msg/Imu"](
        header(t_ns, frame), vector((0, 0, 0, 1), "Quaternion"), np.array([-1.0, *[0.0] * 8]),
        vector(zero if gyro is None else gyro), covariances[0],
        vector(zero if accel is None else accel), covariances[1],
    )  # fmt: skip


def bag(path, messages):
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {}
        for topic, t_ns, message in sorted(messages, key=lambda entry: entry[1]):
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, message.__msgtype__, typestore=STORE)
            payload = STORE.serialize_cdr(message, message.__msgtype__)
            writer.write(topics[topic], int(t_ns), payload)
    return path


def still(n=1000, rate=200.0):
    rng = np.random.default_rng(5)
    t_ns = T0 + np.round(np.arange(n) * 1e9 / rate).astype(np.int64)
    return t_ns, 1e-3 * rng.normal(size=(n, 3)), 1e-2 * rng.normal(size=(n, 3)) + [0, 0, GRAVITY]


@pytest.fixture(scope="module")
def one_triad(tmp_path_factory):
    """Return a bag with gyroscope and accelerometer on topics of their own."""
    t_ns, gyro, accel = still()
    messages = [("/gyro", t, imu(t, g, None)) for t, g in zip(t_ns, gyro, strict=True)]
    late = t_ns + 1_300_000
    messages += [("/accel", t, imu(t, None, a)) for t, a in zip(late, accel, strict=True)]
    return bag(tmp_path_factory.mktemp("triads") / "one_triad", messages)


@pytest.fixture(scope="module")
def two_frames(tmp_path_factory):
    t_ns, gyro, accel = still()
    frames = ["left", "right"] * (len(t_ns) // 2)
    rows = zip(t_ns, gyro, accel, frames, strict=True)
    return bag(tmp_path_factory.mktemp("frames") / "two", [("/imu", r[0], imu(*r)) for r in rows])


def test_a_covariance_of_minus_one_is_an_absent_triad(one_triad):
    assert ims.read_imu(one_triad, "/gyro").accel is None
    assert ims.read_readings(one_triad, "/accel").gyro is None
    readings = ims.read_imu(one_triad, "/gyro")
    for job in (ims.allan, ims.calibrate_six_position):
        with pytest.raises(InputError, match="no readings of the accelerometer"):
            job(readings)
    with pytest.raises(InputError, match="no readings of the accelerometer"):
        ims.dead_reckon(one_triad, imu_topic="/gyro", initial="level")


def test_two_topics_are_merged_at_the_gyroscope_s_times_and_the_loss_is_told(one_triad):
    topics = {"gyro_topic": "/gyro", "accel_topic": "/accel"}
    with pytest.warns(Remark, match="accelerometer is interpolated.* at 50 Hz"):
        readings = ims.read_readings(one_triad, **topics)
    t_ns, gyro, accel = still()
    assert readings.t_ns.tolist() == t_ns[1:].tolist()
    np.testing.assert_array_equal(readings.gyro, gyro[1:])
    weight = 1.0 - 1.3 / 5.0
    np.testing.assert_allclose(
        readings.accel, (1 - weight) * accel[:-1] + weight * accel[1:], rtol=1e-9
    )
    track = ims.dead_reckon(one_triad, initial="level", **topics)
    # White noise of 1e-2 over 5 s in 1000 steps leaves less than 0.1 m; zeros would leave 120 m.
    assert np.linalg.norm(track.position[-1] - track.position[0]) < 1.0
    with pytest.raises(ConfigurationError, match="accel_topic"):
        ims.read_readings(one_triad, gyro_topic="/gyro")


def test_merged_readings_leave_out_gaps_of_the_accelerometer_and_say_so(tmp_path):
    t_ns, gyro, accel = still(2000)
    rows = np.r_[0:800, 1000:2000]  # a second without an accelerometer
    messages = [("/gyro", t, imu(t, g, None)) for t, g in zip(t_ns, gyro, strict=True)]
    late = t_ns[rows] + 1_300_000
    messages += [("/accel", t, imu(t, None, a)) for t, a in zip(late, accel[rows], strict=True)]
    path = bag(tmp_path / "gap", messages)
    with pytest.warns(Remark, match="201 readings of the gyroscope in gaps of the accelerometer"):
        readings = ims.read_readings(path, gyro_topic="/gyro", accel_topic="/accel")
    assert readings.t_ns.tolist() == [*t_ns[1:800], *t_ns[1001:]]
    assert any("1 readings of the gyroscope outside the time" in note for note in readings.notes)


@pytest.mark.parametrize("name", ["si.mcap", "si.bag", "si"])
def test_a_bag_is_converted_to_si_units_by_the_units_of_its_readings(tmp_path, name):
    t_ns, gyro, accel = still(200)
    converted = zip(t_ns, np.degrees(gyro), accel / 9.80665, strict=True)
    path = bag(tmp_path / "other", [("/imu", t, imu(t, g, a)) for t, g, a in converted])
    result = ims.convert(path, tmp_path / name, gyro_unit="deg/s", accel_unit="g")
    assert [note.partition(" and ")[0] for note in result.to_dict()["notes"]] == [
        "the gyroscope is read in deg/s", "the accelerometer is read in g"
    ]  # fmt: skip
    assert "input: the accelerometer is read in g" in "\n".join(result.lines())
    readings = ims.read_imu(tmp_path / name)
    np.testing.assert_allclose(readings.gyro, gyro, rtol=1e-12)
    np.testing.assert_allclose(readings.accel, accel, rtol=1e-12)


def test_convert_keeps_one_frame_or_merges_two_topics(two_frames, one_triad, tmp_path):
    for name in ("left.mcap", "left.csv", "left_euroc"):
        form = "euroc" if name.endswith("euroc") else None
        result = ims.convert(two_frames, tmp_path / name, frame="left", format=form)
        assert result.messages == {"/imu": 500}
        assert len(ims.read_imu(tmp_path / name)) == 500
        assert result.notes == ("readings of the frame left only",)
    with pytest.raises(InputError, match="no readings of the frame middle"):
        ims.convert(two_frames, tmp_path / "middle.mcap", frame="middle")
    assert not (tmp_path / "middle.mcap").exists()
    topics = {"gyro_topic": "/gyro", "accel_topic": "/accel"}
    merged = ims.read_readings(one_triad, **topics)
    for name in ("merged.mcap", "merged.csv"):
        result = ims.convert(one_triad, tmp_path / name, **topics)
        assert result.messages == {"/imu/data_raw": 999}
        readings = ims.read_imu(tmp_path / name)
        np.testing.assert_array_equal(readings.accel, merged.accel)
    with pytest.raises(InputError, match="of readings, not of poses"):
        ims.convert(two_frames, tmp_path / "poses.tum", frame="left")


def test_add_errors_takes_readings_as_they_are_chosen(two_frames, one_triad, tmp_path):
    t_ns, gyro, accel = still(200)
    converted = zip(t_ns, np.degrees(gyro), accel / 9.80665, strict=True)
    converted_bag = bag(tmp_path / "other", [("/sim", t, imu(t, g, a)) for t, g, a in converted])
    cases = (
        (converted_bag, {"gyro_unit": "deg/s", "accel_unit": "g"}, "/sim", (gyro, accel)),
        (two_frames, {"frame": "left"}, "/imu", [triad[::2] for triad in still()[1:]]),
        (one_triad, {"gyro_topic": "/gyro", "accel_topic": "/accel"}, "/ground_truth/imu", None),
    )
    for k, (path, choice, topic, ideal) in enumerate(cases):
        output = tmp_path / f"{k}.mcap"
        result = ims.add_errors_to_file(path, output, imu="perfect", **choice)
        assert result.to_dict()["notes"] == list(result.notes) != []
        assert next(result.lines()).startswith("input: ")
        readings = ims.read_imu(output, "/imu/data_raw")
        if ideal is None:
            merged = ims.read_readings(path, **choice)
            ideal = merged.triads()
        for triad, expected in zip(readings.triads(), ideal, strict=True):
            np.testing.assert_allclose(triad, expected, rtol=1e-12)
        np.testing.assert_allclose(ims.read_imu(output, topic).accel, ideal[1], rtol=1e-12)
    table = tmp_path / "noisy.csv"
    ims.add_errors_to_file(converted_bag, table, imu="perfect", **cases[0][1])
    np.testing.assert_allclose(ims.read_imu(table).accel, accel, rtol=1e-12)
    ims.add_errors_to_file(table, tmp_path / "mg.csv", imu="perfect", accel_unit="mg")
    np.testing.assert_allclose(
        ims.read_imu(tmp_path / "mg.csv").accel, accel * 9.80665e-3, rtol=1e-12
    )
    odometry = bag(tmp_path / "odometry", [("/odom", t, m) for t, m in poses_of("Odometry")])
    with pytest.raises(InputError, match="has no topic /odom of sensor_msgs/msg/Imu"):
        ims.add_errors_to_file(
            odometry, tmp_path / "o.mcap", input_topic="/odom", gyro_unit="deg/s"
        )


def test_two_frames_on_a_topic_are_refused_unless_one_is_chosen(two_frames):
    for job in (ims.read_imu, ims.allan, ims.dead_reckon, ims.calibrate_six_position):
        with pytest.raises(InputError, match=r"several frames: left .*frame=\.\.\. chooses one"):
            job(two_frames)
    left_readings = ims.read_readings(two_frames, frame="left")
    assert (len(left_readings), left_readings.frame_id) == (500, "left")
    with pytest.raises(InputError, match="no readings of the frame middle"):
        ims.read_readings(two_frames, frame="middle")


@pytest.mark.parametrize(("unit", "value"), [("g", 9.80665), ("mg", 9.80665e-3)])
def test_units_are_converted_and_told(tmp_path, unit, value):
    t_ns, gyro, accel = still()
    path = tmp_path / "imu.csv"
    rows = np.column_stack([np.degrees(gyro), accel / value])
    lines = [",".join(f"{x:.12g}" for x in row) for row in rows]
    path.write_text("".join(f"{t},{line}\n" for t, line in zip(t_ns, lines, strict=True)))
    units = {"gyro_unit": "deg/s", "accel_unit": unit}
    with pytest.warns(Remark, match=f"accelerometer is read in {unit}"):
        readings = ims.read_readings(path, **units)
    np.testing.assert_allclose(readings.gyro, gyro, rtol=1e-9)
    np.testing.assert_allclose(readings.accel, accel, rtol=1e-9)
    assert ims.dead_reckon(path, initial="level", **units).position.max() < 1.0
    with pytest.raises(ConfigurationError, match="accel_unit"):
        ims.read_readings(path, accel_unit="ft/s^2")


def test_a_unit_that_contradicts_the_header_is_refused(tmp_path):
    path = tmp_path / "imu.csv"
    rows = "".join(f"{T0 + 5_000_000 * k},0,0,0,0,0,1\n" for k in range(20))
    path.write_text("timestamp,gx,gy,gz,ax [g],ay [g],az [g]\n" + rows)
    assert ims.read_readings(path, accel_unit="g").accel[0, 2] == pytest.approx(9.80665)
    with pytest.raises(InputError, match="accel_unit = mg: the header says g"):
        ims.read_readings(path, accel_unit="mg")


READERS = ("add_errors", "allan", "calibrate six_position", "calibrate temperature",
           "calibrate turntable", "convert_bag", "dead_reckon", "inspect", "report", "twin",
           "view")  # fmt: skip
OPTIONS = ("--frame", "--gyro-topic", "--accel-topic", "--gyro-unit", "--accel-unit")


@pytest.mark.parametrize("name", READERS)
def test_every_program_that_reads_readings_has_the_options(name, capsys):
    program, *run = name.split()
    main = importlib.import_module(f"imu_sim_ros.commands.{program}").main
    with pytest.raises(SystemExit) as ending:
        main([*run, "--help"])
    assert ending.value.code == 0
    help_words = capsys.readouterr().out.split()
    assert [option for option in OPTIONS if option not in help_words] == []


def test_report_inspect_and_preintegrate_read_as_is_chosen(two_frames, one_triad, tmp_path):
    topics = {"gyro_topic": "/gyro", "accel_topic": "/accel"}
    for path, choice, count in ((two_frames, {"frame": "left"}, 500), (one_triad, topics, 999)):
        page = ims.report(path, tmp_path / "page.html", force=True, **choice)
        assert page.to_dict()["notes"] == list(page.notes) != []
        assert page.lines()[0].startswith("input: ")
        text = (tmp_path / "page.html").read_text()
        assert page.notes[0] in text
        assert f"{count:,} readings" in text
        inspection = ims.inspect(path, **choice)
        assert [sensor.readings for sensor in inspection.sensors] == [count]
        assert inspection.to_dict()["sensors"][0]["notes"] == page.notes
        assert str(next(inspection.lines())).startswith("input: ")
        pieces = ims.preintegrate(path, every=0.5, **choice)
        preintegrated = ims.preintegrate(ims.read_readings(path, **choice), every=0.5)
        np.testing.assert_array_equal(pieces.alpha, preintegrated.alpha)
    for job in (lambda **choice: ims.report(two_frames, tmp_path / "none.html", **choice),
                lambda **choice: ims.inspect(two_frames, **choice)):  # fmt: skip
        with pytest.raises(InputError, match="contains no readings of the frame middle"):
            job(frame="middle")
    with pytest.raises(InputError, match=r"several frames: left .*frame=\.\.\. chooses one"):
        ims.report(two_frames, tmp_path / "none.html")
    assert ims.inspect(two_frames).findings[0].kind == "frames_mixed"
    with pytest.raises(ConfigurationError, match="frame"):
        ims.inspect(ims.read_readings(two_frames, frame="left"), frame="left")


def test_results_say_what_was_chosen_and_converted(two_frames, tmp_path, capsys):
    track = ims.dead_reckon(two_frames, frame="left", initial="level")
    assert track.to_dict()["notes"] == ["readings of the frame left only"]
    argv = [str(two_frames), "--frame", "left", "--initial-state", "level"]
    assert dead_reckon_program.main(argv) == 0
    assert "input: readings of the frame left only" in capsys.readouterr().out
    t_ns, gyro, accel = still(14000)
    table = tmp_path / "imu.csv"
    rows = np.column_stack([gyro, accel / 9.80665]).tolist()
    lines = (",".join(map(str, (t, *row))) for t, row in zip(t_ns.tolist(), rows, strict=True))
    table.write_text("\n".join(["timestamp,gx,gy,gz,ax [g],ay [g],az [g]", *lines]))
    noise = ims.allan(table)
    assert noise.to_dict()["notes"] == list(noise.notes)
    stated = "the accelerometer in g, as the header says: converted to SI units"
    assert noise.notes == (stated,)
    assert str(next(noise.lines())) == f"input: {stated}"


def test_programs_have_the_options(two_frames, capsys):
    assert allan_program.main([str(two_frames), "--no-files"]) == 2
    assert "--frame" in capsys.readouterr().err
    argv = [str(two_frames), "--no-files", "--frame", "left", "--accel-unit", "m/s^2"]
    assert allan_program.main(argv) == 2
    assert "at least 60 s" in capsys.readouterr().err


def curve(n=200):
    s = 0.02 * np.arange(n)
    position = np.stack([np.sin(s), np.cos(s), 0.1 * s], axis=1)
    half = 0.1 * np.sin(s)
    zero = np.zeros(n)
    return (
        T0 + np.round(s * 1e9).astype(np.int64),
        position,
        np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1),
    )


def poses_of(kind):
    """Return messages of a type with the poses of the curve."""
    t_ns, position, q_wb = curve()
    message_type = {name: f"geometry_msgs/msg/{name}" for name in
          ("Pose", "PoseStamped", "PoseWithCovariance", "PoseWithCovarianceStamped",
           "Transform", "TransformStamped", "Twist", "TwistWithCovariance")}  # fmt: skip
    result = []
    for t, p, q in zip(t_ns, position, q_wb, strict=True):
        turned = vector(q[[1, 2, 3, 0]], "Quaternion")
        pose = TYPE[message_type["Pose"]](vector(p, "Point"), turned)
        stated = TYPE[message_type["PoseWithCovariance"]](pose, np.eye(6).ravel())
        transform = TYPE[message_type["TransformStamped"]](
            header(t, "map"), "base", TYPE[message_type["Transform"]](vector(p), turned)
        )
        stamped = TYPE[message_type["PoseStamped"]](header(t, "map"), pose)
        zero = TYPE[message_type["Twist"]](vector((0, 0, 0)), vector((0, 0, 0)))
        twist = TYPE[message_type["TwistWithCovariance"]](zero, np.zeros(36))
        result.append((t, {
            "Odometry": lambda t=t, s=stated, w=twist: TYPE["nav_msgs/msg/Odometry"](
                header(t, "map"), "base", s, w),
            "PoseStamped": lambda m=stamped: m,
            "PoseWithCovarianceStamped": lambda t=t, s=stated: TYPE[
                message_type["PoseWithCovarianceStamped"]](header(t, "map"), s),
            "TransformStamped": lambda m=transform: m,
            "TFMessage": lambda m=transform: TYPE["tf2_msgs/msg/TFMessage"]([m]),
            "Path": lambda m=stamped: m,
        }[kind]()))  # fmt: skip
    if kind == "Path":
        path = TYPE["nav_msgs/msg/Path"](header(t_ns[-1], "map"), [m for _, m in result])
        return [(t_ns[-1], path)]
    return result


KINDS = ("Odometry", "PoseStamped", "PoseWithCovarianceStamped", "TransformStamped", "TFMessage",
         "Path")  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_every_job_reads_every_type_of_poses(tmp_path, kind):
    path = bag(tmp_path / "poses", [("/tf", t, m) for t, m in poses_of(kind)])
    topic = "/tf:map.base" if kind == "TFMessage" else "/tf"
    t_ns, position, q_wb = curve()
    states = ims.read_states(path, topic)
    assert states.t_ns.tolist() == t_ns.tolist()
    np.testing.assert_allclose(states.position, position)
    np.testing.assert_allclose(states.q_wb, q_wb, atol=1e-12)
    evaluation = ims.evaluate(path, states, estimate_topic=topic)
    assert np.abs(evaluation.position).max() < 1e-12
    if kind != "TFMessage":  # a bag of a tree of frames does not say which two
        np.testing.assert_allclose(ims.read_states(path).position, position)
        flight = ims.simulate(trajectory=path, duration=2, rate=100)
        assert flight.truth.position.shape == (200, 3)


def test_one_pose_is_no_trajectory(tmp_path):
    """Its message has the words of the one about rows of a text file."""
    path = bag(tmp_path / "one", [("/odom", t, m) for t, m in poses_of("Odometry")[:1]])
    with pytest.raises(InputError, match="1 poses; a trajectory needs two or more"):
        ims.evaluate(path, ims.simulate(duration=1).truth)


def test_the_topic_s_own_type_decides(tmp_path):
    messages = [("/odom", t, m) for t, m in poses_of("Odometry")]
    messages += [("/pose", t, m) for t, m in poses_of("PoseStamped")]
    path = bag(tmp_path / "both", messages)
    evaluation = ims.evaluate(path, path, estimate_topic="/odom", truth_topic="/pose")
    assert np.abs(evaluation.position).max() < 1e-12
    with pytest.raises(InputError, match=r"no topic /psoe of poses; it has .*/odom.*/pose"):
        ims.read_states(path, "/psoe")
