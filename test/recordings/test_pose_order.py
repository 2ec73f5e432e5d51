# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses whose stamps go back: strays, late poses, repeats and resets, in every container."""

import pickle
import warnings

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import ODOMETRY, OdometryEncoder
from imu_sim_ros.bags.messages.stamps import transform_stamps
from imu_sim_ros.bags.writer import BagOptions
from imu_sim_ros.core.errors import InputError, InputWarning
from imu_sim_ros.core.records import States, replace_fields
from imu_sim_ros.inputs.poses import write_tum
from imu_sim_ros.jobs.convert import CopiedStamps

START_NS = 1_700_000_000_000_000_000
COUNT = 240
MIDDLE = COUNT // 2


def poses(rate):
    """Return a smooth motion; its frequency is a fortieth of the rate."""
    k = np.arange(COUNT)
    phase = 2.0 * np.pi * k / 40.0
    position = np.stack([3.0 * np.cos(phase), 2.0 * np.sin(phase), np.sin(phase)], axis=1)
    q_wb = np.stack([np.cos(0.1 * phase), 0 * phase, 0 * phase, np.sin(0.1 * phase)], axis=1)
    t_ns = START_NS + np.rint(k * 1e9 / rate).astype(np.int64)
    return States(t_ns, position, q_wb)


def restamped(states, rows, step_ns):
    t_ns = states.t_ns.copy()
    t_ns[rows] += step_ns
    return replace_fields(states, t_ns=t_ns)


CORRECTED = {
    "stamps_stray": (lambda s: restamped(s, MIDDLE, -(10**18)), np.delete(range(COUNT), MIDDLE)),
    "stamps_late": (lambda s: s.rows(np.r_[0:50, 51, 50, 52:COUNT]), np.arange(COUNT)),
    "messages_repeated": (lambda s: s.rows(np.sort(np.r_[0:COUNT, 50, 51])), np.arange(COUNT)),
}
REFUSED = {
    "clock_reset": lambda s: restamped(s, slice(MIDDLE, None), s.t_ns[0] - s.t_ns[MIDDLE]),
    "clock_change": lambda s: restamped(s, slice(MIDDLE, None), 3 * 10**17),
    "poses_contradictory": lambda s: restamped(s, MIDDLE, s.t_ns[MIDDLE - 1] - s.t_ns[MIDDLE]),
}


def write(folder, kind, states):
    """Return the path of poses in the order in which they stand."""
    folder.mkdir(exist_ok=True)
    if kind == "tum":
        write_tum(folder / "poses.txt", states)
        return folder / "poses.txt"
    if kind in ("csv", "euroc"):
        path = folder / "poses.csv"
        if kind == "euroc":
            path = folder / "mav0" / "state_groundtruth_estimate0" / "data.csv"
            path.parent.mkdir(parents=True)
        rows = np.column_stack([states.position, states.q_wb, 0.0 * states.position])
        lines = ["#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z,v_x,v_y,v_z"]
        lines += [
            f"{t},{','.join(map(repr, row))}"
            for t, row in zip(states.t_ns.tolist(), rows.tolist(), strict=True)
        ]
        path.write_text("\n".join(lines) + "\n")
        return path if kind == "csv" else folder
    path = folder / {"mcap": "poses.mcap", "sqlite3": "poses", "ros1": "poses.bag"}[kind]
    with open_writer(path, BagOptions(kind)) as writer:
        encoder = OdometryEncoder("world", "base_link", writer.encoding)
        topic = writer.add_topic("/odom", ODOMETRY)
        zero = np.zeros((len(states), 3))
        payloads = encoder.encode(states.t_ns, states.position, states.q_wb, zero, zero)
        record_ns = START_NS + 10**7 * np.arange(len(states))
        writer.write(topic, record_ns, payloads)
    return path


def kinds_told(call, *arguments, **options):
    """Return what a call returns, and the kinds of findings that it tells."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        value = call(*arguments, **options)
    lines = [str(entry.message) for entry in caught if issubclass(entry.category, InputWarning)]
    return value, [line.rpartition("[")[2].rstrip("]") for line in lines]


@pytest.mark.parametrize("container", ["tum", "csv", "euroc", "mcap", "sqlite3", "ros1"])
def test_the_order_of_poses_is_corrected_or_refused_in_every_container(tmp_path, container):
    states = poses(20.0)
    for kind, (fault, rows) in CORRECTED.items():
        folder = tmp_path / kind
        folder.mkdir()
        path = write(folder, container, fault(states))
        actual, kinds = kinds_told(ims.read_states, path)
        assert kinds == [kind]
        np.testing.assert_array_equal(actual.t_ns, states.t_ns[rows])
        np.testing.assert_allclose(actual.position, states.position[rows], atol=1e-9)
    for kind, fault in REFUSED.items():
        folder = tmp_path / kind
        folder.mkdir()
        with pytest.raises(InputError, match=rf"\[{kind}\]"):
            ims.read_states(write(folder, container, fault(states)))


@pytest.mark.parametrize("rate", [1.0, 10.0, 100.0])
def test_every_job_takes_late_and_stray_poses(tmp_path, rate):
    states = poses(rate)
    for kind in ("stamps_stray", "stamps_late"):
        fault, rows = CORRECTED[kind]
        folder = tmp_path / kind
        folder.mkdir()
        path = write(folder, "tum", fault(states))
        evaluation, kinds = kinds_told(ims.evaluate, path, states, max_gap=3.0)
        assert kind in kinds
        assert len(evaluation.t_ns) == len(rows)
        assert evaluation.rms_position < 1e-9
        flight, kinds = kinds_told(ims.simulate, trajectory=path, duration=1, rate=100)
        assert kind in kinds
        assert len(flight.truth) == 100
        findings = ims.inspect(path).findings
        assert kind in [finding.kind for finding in findings]


def test_poses_in_python_are_taken_as_those_of_files(flight_of_poses):
    states, flight = flight_of_poses
    for kind, (fault, rows) in CORRECTED.items():
        evaluation, kinds = kinds_told(ims.evaluate, fault(states), flight)
        assert kind in kinds
        np.testing.assert_array_equal(evaluation.t_ns, states.t_ns[rows])
        evaluation, kinds = kinds_told(ims.evaluate, states, fault(states))
        assert kind in kinds
        assert evaluation.rms_position < 0.01
    for kind, fault in REFUSED.items():
        with pytest.raises(InputError, match=rf"\[{kind}\]"):
            ims.evaluate(fault(states), flight)
        with pytest.raises(InputError, match=rf"\[{kind}\]"):
            ims.simulate(trajectory=fault(states))


@pytest.fixture
def flight_of_poses():
    """Return poses, and a truth that differs from them by a millimetre."""
    states = poses(20.0)
    return states, replace_fields(states, position=states.position + 1e-3)


@pytest.mark.parametrize("container", ["tum", "euroc", "mcap", "ros1"])
def test_convert_tells_the_order_of_poses_and_keeps_it(tmp_path, container):
    states = poses(20.0)
    late, stray = (CORRECTED[kind][0] for kind in ("stamps_late", "stamps_stray"))
    faults = {"": lambda s: s, "stamps_late": late, "stamps_stray": stray}
    faults |= {kind: REFUSED[kind] for kind in ("clock_reset", "clock_change")}
    forms = ("copy.mcap", "copy") if container == "euroc" else ("copy.mcap", "copy.bag", "copy.tum")
    for kind, fault in faults.items():
        path = write(tmp_path / (kind or "right"), container, fault(states))
        if container == "euroc":
            table = path / "mav0" / "imu0" / "data.csv"
            table.parent.mkdir()
            table.write_text("".join(f"{t},0,0,0,0,0,9.8\n" for t in states.t_ns.tolist()))
        for form in forms:
            options = {} if "." in form else {"format": "euroc"}
            converted = ims.convert(path, tmp_path / form, force=True, **options)
            kinds = [line.rpartition("[")[2].rstrip("]") for line in converted.warnings]
            assert kinds == [kind] * bool(kind), (form, converted.warnings)
            assert COUNT in converted.messages.values()
            if form == "copy.tum":
                rows = np.loadtxt(tmp_path / form)
                np.testing.assert_allclose(rows[:, 1:4], fault(states).position, atol=1e-8)


def test_convert_tells_the_order_of_transforms(tmp_path):
    states = CORRECTED["stamps_late"][0](poses(20.0))
    store = get_typestore(Stores.ROS2_JAZZY)
    make = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    path, name = tmp_path / "transforms", "geometry_msgs/msg/TransformStamped"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/vicon/body", name, typestore=store)
        rows = zip(
            states.t_ns.tolist(), states.position.tolist(), states.q_wb.tolist(), strict=True
        )
        for k, (t_ns, position, (w, x, y, z)) in enumerate(rows):
            header = make["Header"](make["Time"](*divmod(t_ns, 10**9)), "world")
            transform = make["Transform"](
                make["Vector3"](*position), make["Quaternion"](x, y, z, w)
            )
            message = make["TransformStamped"](header, "body", transform)
            writer.write(topic, START_NS + k * 10**7, store.serialize_cdr(message, name))
    converted = ims.convert(path, tmp_path / "copy.mcap")
    assert [line.rpartition("[")[2] for line in converted.warnings] == ["stamps_late]"]


@pytest.mark.parametrize("topic", ["/tf", "/trajectory"])
def test_a_copy_tells_the_order_within_messages(tmp_path, topic):
    """Two transforms in each message, of which one is late; the last path; also from ROS 1."""
    late, clean = CORRECTED["stamps_late"][0](poses(20.0)), poses(20.0)
    store = get_typestore(Stores.ROS2_JAZZY)
    make = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}

    def header(t_ns, frame):
        return make["Header"](make["Time"](*divmod(int(t_ns), 10**9)), frame)

    quaternion = make["Quaternion"](0.0, 0.0, 0.0, 1.0)
    if topic == "/tf":
        transform = make["Transform"](make["Vector3"](1.0, 2.0, 3.0), quaternion)
        kind, messages = (
            "tf2_msgs/msg/TFMessage",
            [
                make["TFMessage"](
                    [
                        make["TransformStamped"](header(t_ns, "map"), child, transform)
                        for t_ns, child in zip(stamps, ("body", "camera_1"), strict=True)
                    ]
                )
                for stamps in zip(late.t_ns, clean.t_ns, strict=True)
            ],
        )
    else:
        pose = make["Pose"](make["Point"](1.0, 2.0, 3.0), quaternion)
        kind, messages = (
            "nav_msgs/msg/Path",
            [
                make["Path"](
                    header(0, "world"),
                    [make["PoseStamped"](header(t_ns, "a"), pose) for t_ns in late.t_ns[:count]],
                )
                for count in (10, len(late))
            ],
        )
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(topic, kind, typestore=store)
        for k, message in enumerate(messages):
            payload = store.serialize_cdr(message, kind)
            writer.write(connection, START_NS + k * 10**7, payload)
    source = tmp_path / "bag"
    for name in ("copy.bag", "again.mcap"):
        converted = ims.convert(source, tmp_path / name)
        (line,) = converted.warnings
        assert line.endswith("[stamps_late]")
        pair = ":map.body" if topic == "/tf" else ""
        assert line.startswith(f"{source}: {topic}{pair}, from row 51 ")
        source = tmp_path / name


def test_inspect_tells_a_reset_of_poses(tmp_path):
    for container in ("tum", "mcap"):
        folder = tmp_path / container
        folder.mkdir()
        path = write(folder, container, REFUSED["clock_reset"](poses(20.0)))
        assert "clock_reset" in [finding.kind for finding in ims.inspect(path).findings]


def test_stamps_of_long_recordings_are_judged_in_pieces():
    """A late stamp in each of two pieces has its row and time; stamps are kept for a piece only."""
    count, step_ns, late_rows = 3_000_000, 1_000_000, (200_000, 2_700_000)
    stamps = CopiedStamps()
    t_ns = np.arange(count) * step_ns
    for row in late_rows:
        t_ns[[row - 1, row]] = t_ns[[row, row - 1]]
    for block in np.split(t_ns, 30):
        stamps.add("imu", block)
    findings = stamps.findings()
    assert [finding.kind for finding in findings] == ["stamps_late", "stamps_late"]
    assert [finding.row for finding in findings] == list(late_rows)
    times = [finding.t for finding in findings]
    np.testing.assert_allclose(times, [(row - 1) * 1e-3 for row in late_rows], rtol=1e-12)
    assert len(pickle.dumps(stamps)) < 8 * 1.1 * 2**18


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_the_stamps_of_transforms_are_those_that_rosbags_reads(encoding):
    """Messages of one to three transforms between random frames in random order, some damaged."""
    rng, kind = np.random.default_rng(4), "tf2_msgs/msg/TFMessage"
    store = get_typestore(Stores.ROS2_JAZZY if encoding == "cdr" else Stores.ROS1_NOETIC)
    if kind not in store.types:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", kind))
    make = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    zero = make["Vector3"](0.0, 0.0, 0.0), make["Quaternion"](0.0, 0.0, 0.0, 1.0)
    time = store.types["builtin_interfaces/msg/Time"]
    number = {} if encoding == "cdr" else {"seq": 7}
    expected = dict[tuple[str, str], list[tuple[int, int]]]()
    payloads = []
    for row in range(400):
        transforms = []
        for _ in range(rng.integers(1, 4)):
            parent, child = rng.choice(["map", "odom", "base_link", "x"], 2)
            second, nanosecond = rng.integers(0, [2**31, 10**9]).tolist()
            expected.setdefault((parent, child), []).append((row, second * 10**9 + nanosecond))
            header = make["Header"](stamp=time(second, nanosecond), frame_id=f"/{parent}", **number)
            transforms.append(make["TransformStamped"](header, child, make["Transform"](*zero)))
        message = make["TFMessage"](transforms)
        serialize = store.serialize_cdr if encoding == "cdr" else store.serialize_ros1
        payloads.append(bytes(serialize(message, kind)))
    short = [payload[:50] for payload in payloads[:9]]
    big_endian = [b"\0\0" + payload[2:] for payload in payloads[:9] if encoding == "cdr"]
    payloads += [*short, *big_endian, b"", b"\xff", b"\xff" * len(payloads[0])]
    stamps = {
        (parent, child): [*zip(rows.tolist(), t_ns.tolist(), strict=True)]
        for parent, child, rows, t_ns in transform_stamps(payloads, encoding)
    }
    assert stamps == expected
