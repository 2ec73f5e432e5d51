# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Broken readings and poses at every entry: each form of bag, text, and each command."""

import json

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY, ImuEncoder, OdometryEncoder
from imu_sim_ros.bags.read import read_imu, read_odometry
from imu_sim_ros.bags.writer import BagOptions
from imu_sim_ros.commands import convert_bag, dead_reckon, evaluate, report
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.formats.door import read_states

COUNT, BAD = 2000, 7
T_NS = 10**9 + 5_000_000 * np.arange(COUNT)
STAMP = "message 7: stamp 1.035000000 s: "
FORMS = {
    "ros1.bag": {},
    "one.mcap": {},
    "folder_mcap": {"storage": "mcap"},
    "folder_sqlite3": {"storage": "sqlite3"},
}
READINGS = {
    "gyro nan": ("gyro", np.nan, "a value that is not finite: angular velocity [nan, nan, nan]"),
    "gyro huge": ("gyro", 1e160, "angular velocity [1e+160, 1e+160, 1e+160]: at most 100000"),
    "accel inf": ("accel", -np.inf, "a value that is not finite: linear acceleration [-inf"),
    "accel huge": ("accel", 1e308, "linear acceleration [1e+308, 1e+308, 1e+308]: at most 1e+07"),
}
POSES = {
    "position nan": ("position", np.nan, "a value that is not finite: position [nan, nan, nan]"),
    "position huge": ("position", 1e300, "position [1e+300, 1e+300, 1e+300]: at most 1e+10 m"),
    "quaternion 0": ("q_wb", 0.0, "a quaternion of length 0 instead of 1"),
    "quaternion nan": ("q_wb", np.nan, "a value that is not finite: orientation [nan"),
    "quaternion 4": ("q_wb", 2.0, "a quaternion of length 4 instead of 1"),
}


def write(path, spoilt=None, value=0.0, odometry_topic="/ground_truth/odom", **options):
    """Write a body at rest, one message of it spoilt."""
    arrays = {
        "gyro": np.zeros((COUNT, 3)),
        "accel": np.tile([0.0, 0.0, 9.81], (COUNT, 1)),
        "position": np.zeros((COUNT, 3)),
        "q_wb": np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1)),
    }
    if spoilt:
        arrays[spoilt][BAD] = value
    with open_writer(path, BagOptions(**options)) as writer:
        imu, odometry = (
            writer.add_topic("/imu/data_raw", IMU),
            writer.add_topic(odometry_topic, ODOMETRY),
        )
        still = np.zeros((COUNT, 3))
        readings = ImuEncoder("imu_link", writer.encoding)
        states = OdometryEncoder("world", "base_link", writer.encoding)
        writer.write(imu, T_NS, readings.encode(T_NS, arrays["gyro"], arrays["accel"]))
        poses = states.encode(T_NS, arrays["position"], arrays["q_wb"], still, still)
        writer.write(odometry, T_NS, poses)
    return path


@pytest.fixture(params=FORMS)
def place(request, tmp_path):
    return tmp_path / request.param, FORMS[request.param]


@pytest.mark.parametrize("case", READINGS)
def test_a_bad_reading_is_an_error_with_topic_message_and_stamp(place, case):
    spoilt, value, reason = READINGS[case]
    path = write(place[0], spoilt, value, **place[1])
    for door in (read_imu, ims.read_imu, ims.dead_reckon, ims.allan):
        with pytest.raises(InputError) as caught:
            door(path)
        (line,) = caught.value.problems
        assert line.startswith(f"{path}: /imu/data_raw: {STAMP}{reason}")
    counted = []
    assert len(read_imu(path, skipped=counted.append).t_ns) == COUNT - 1
    assert counted == [1]


@pytest.mark.parametrize("case", POSES)
def test_a_bad_pose_is_an_error_with_topic_message_and_stamp(place, case):
    spoilt, value, reason = POSES[case]
    path = write(place[0], spoilt, value, **place[1])
    for door in (read_odometry, read_states, ims.read_odometry):
        with pytest.raises(InputError) as caught:
            door(path)
        (line,) = caught.value.problems
        assert line.startswith(f"{path}: /ground_truth/odom: {STAMP}{reason}")
    states = read_states(path, skip_bad_rows=True)
    assert (len(states.t_ns), states.skipped) == (COUNT - 1, 1)


def run(capsys, command, *arguments):
    """Return status, standard output and the lines on standard error."""
    status = command.main([str(word) for word in arguments])
    output = capsys.readouterr()
    return status, output.out, output.err.splitlines()


@pytest.mark.parametrize("spoilt", ["accel", "q_wb"])
@pytest.mark.parametrize("json_wanted", [[], ["--json"]])
def test_every_command_refuses_in_a_line_or_leaves_out(place, capsys, spoilt, json_wanted):
    case = {"accel": READINGS["accel huge"], "q_wb": POSES["quaternion 0"]}[spoilt]
    path = write(place[0], spoilt, case[1], **place[1])
    calls = [(dead_reckon, [path])]
    if spoilt == "q_wb":
        estimate = path.with_name(f"estimate_{path.name}")
        write(estimate, spoilt, case[1], "/filter/odom", **place[1])
        calls.append((evaluate, [estimate, path]))
    else:
        calls.append((report, [path, "-o", path.with_name("page.html")]))
    for command, arguments in calls:
        status, out, lines = run(capsys, command, *arguments, *json_wanted)
        # A line for each file that is read.
        assert (status, out, len(lines)) == (2, "", 2 if command is evaluate else 1)
        assert all(f"{STAMP}{case[2]}" in line for line in lines)

        status, out, lines = run(capsys, command, *arguments, *json_wanted, "--skip-bad-rows")
        assert status == 0
        placed = [line for line in lines if "nothing says where imu_link is in base_link" in line]
        assert len(placed) == (command is dead_reckon)
        # A reading that is left out is a sample that is lost to the dead reckoning.
        lost = [line for line in lines if line.endswith("[samples_lost]")]
        assert len(lost) == (command is dead_reckon and spoilt == "accel")
        skipped = [line for line in lines if line not in placed + lost]
        assert skipped
        assert all("1 bad rows skipped" in line for line in skipped)
        if json_wanted:
            json.loads(out, parse_constant=pytest.fail)


@pytest.mark.parametrize(
    "target", [["o.csv"], ["o", "--format", "euroc"], ["o.tum"], ["o.mcap"], ["o.bag"]], ids=str
)
@pytest.mark.parametrize("case", ["gyro nan", "accel inf", "position nan"])
def test_a_conversion_passes_on_with_a_warning(place, capsys, tmp_path, target, case):
    spoilt, value, reason = {**READINGS, **POSES}[case]
    path = write(place[0], spoilt, value, **place[1])
    arguments = [path, "-o", tmp_path / target[0], *target[1:]]
    copied = {"o.csv": {"gyro", "accel"}, "o.tum": {"position"}}.get(target[0], {spoilt})

    status, _, lines = run(capsys, convert_bag, *arguments)

    assert status == 0
    if spoilt not in copied:
        assert lines == []
        return
    (line,) = lines
    assert f"1 of {COUNT} messages are not finite or not possible, the first is {STAMP}" in line
    assert reason in line

    status, out, lines = run(capsys, convert_bag, *arguments, "--skip-bad-rows", "--force")
    assert (status, len(lines)) == (0, 1)
    assert "1 bad rows skipped" in lines[0]
    assert f"{COUNT - 1:,} /" in out


def test_a_sound_recording_is_said_nothing_of(place, capsys, tmp_path):
    path = write(place[0], **place[1])

    status, _, lines = run(capsys, convert_bag, path, "-o", tmp_path / "o.csv")

    assert (status, lines) == (0, [])


def test_json_has_null_for_what_is_not_finite():
    from imu_sim_ros.terminal.json_text import json_text

    value = {"a": [1.5, np.nan], "b": np.array([[np.inf, 2.0]]), "c": (float("-inf"), True, None)}
    assert json.loads(json_text(value)) == {
        "a": [1.5, None],
        "b": [[None, 2.0]],
        "c": [None, True, None],
    }
