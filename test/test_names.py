# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Options and names as people mistype them, and what every program says of itself."""

import importlib
import re
import subprocess
import sys

import pytest

from imu_sim_ros.commands import dead_reckon, generate, start
from imu_sim_ros.core.names import suggestion, unknown_name_line

PARSERS = [*start.PROGRAMS, "demo"]


def error_of(command, capsys, monkeypatch, tmp_path):
    """Return what a program says, the first word, when it is started with the others."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", command)
    try:
        status = importlib.import_module(f"imu_sim_ros.commands.{command[0]}").main(command[1:])
    except SystemExit as ended:
        status = ended.code
    assert status == 2
    assert list(tmp_path.iterdir()) == []
    return capsys.readouterr().err


def every_parser():
    for name in PARSERS:
        command_parser = importlib.import_module(f"imu_sim_ros.commands.{name}").parser()
        yield name, command_parser, []
        for action in command_parser._actions:
            if action.nargs == "A...":
                yield from ((name, inner, [word]) for word, inner in action.choices.items())


@pytest.mark.parametrize(
    ("parser", "subcommand"),
    [
        pytest.param(command_parser, subcommands, id=command_parser.prog)
        for _, command_parser, subcommands in every_parser()
    ],
)
def test_no_option_of_any_program_can_be_abbreviated(parser, subcommand, capsys):
    options = [name for name in parser._option_string_actions if name.startswith("--")]
    assert "--version" in options
    for option in options:
        if option[:-1] in options:  # --topic of --topics
            continue
        with pytest.raises(SystemExit, match="2"):
            parser.parse_args([option[:-1]])
        assert f"unknown option '{option[:-1]}'; did you mean --" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "line"),
    [
        ("generate --forc", "unknown option '--forc'; did you mean --force?"),
        ("control --timeot 3 pause", "unknown option '--timeot'; did you mean --timeout?"),
        ("control paus", "unknown action 'paus'; "),
        ("control inject dropot", "did you mean dropout?"),
        ("calibrate turntabl x", "did you mean turntable?"),
        ("allan x --model standart", "did you mean standard?"),
        ("generate -o x --imu mpu600", "unknown IMU 'mpu600'; did you mean mpu6000?"),
        ("allan x --truth mpu600", "--truth: unknown IMU 'mpu600'; did you mean mpu6000?"),
        ("generate -o x --trajectory cirle", "unknown trajectory 'cirle'; did you mean circle?"),
        ("generate -o x --set trajectory.type=figure_eigt", "did you mean figure_eight?"),
        (
            "generate -o x --camera euroc_cm0",
            "unknown camera 'euroc_cm0'; did you mean euroc_cam0?",
        ),
        ("generate -o x --camera euroc_cam0 --scene hose", "did you mean house?"),
        ("generate -o x --topics imu/dat_raw", "did you mean imu/data_raw?"),
        ("generate -o x --format eurok", "did you mean euroc?"),
        ("generate -o x --storage sqlite", "did you mean sqlite3?"),
        ("generate -o x --set rat=1", "did you mean rate?"),
        ("campaign which_im -o x", "unknown campaign 'which_im'; did you mean which_imu?"),
    ],
)
def test_a_name_that_is_nearly_right_is_answered_with_the_right_one(
    command, line, capsys, monkeypatch, tmp_path
):
    error = error_of(command.split(), capsys, monkeypatch, tmp_path)
    assert line in error
    assert len(error.splitlines()) == 1


def test_a_name_far_from_all_others_is_answered_with_all():
    assert suggestion("xyz", ["euler", "rk4"]) == "must be one of euler, rk4"
    line = suggestion("xyz", [f"ground_truth/topic_{k:03}" for k in range(100)])
    assert line.startswith("must be one of ground_truth/topic_000, ground_truth/topic_001, ")
    assert line.endswith(", ground_truth/topic_015 and 84 more")
    assert unknown_name_line("IMU", "xyz", ["mpu6000"], "no file") == "unknown IMU 'xyz'; no file"
    assert (
        unknown_name_line("IMU", "MPU600", ["mpu6000"], "")
        == "unknown IMU 'MPU600'; did you mean mpu6000?"
    )


@pytest.mark.parametrize("option", ["--split-duration", "--split-size", "--jobs", "--format"])
def test_a_value_of_two_dashes_is_refused_like_any_other(option, capsys, monkeypatch, tmp_path):
    error = error_of(["generate", "-o", "x", f"{option}=--"], capsys, monkeypatch, tmp_path)
    assert option in error
    assert "unexpected" not in error


@pytest.mark.parametrize("assignment", ["use_sim_time=[1,2]", "imu.mounting=loop"])
@pytest.mark.parametrize("program", [generate, dead_reckon])
def test_values_that_a_program_does_not_use_are_checked(
    program, assignment, capsys, monkeypatch, tmp_path
):
    name = program.__name__.rpartition(".")[2]
    place = ["-o", "x.mcap"] if program is generate else ["x.mcap"]
    command = [name, *place, "--set", assignment]
    error = error_of(command, capsys, monkeypatch, tmp_path)
    assert f"{name}: {assignment.partition('=')[0]} = " in error


WITHOUT_ROS = """
import sys
sys.modules.update(dict.fromkeys({blocked!r}))
from imu_sim_ros.commands import start
for words in {calls!r}:
    sys.argv[:] = ["imu_sim", *words]
    try:
        status = start.imu_sim()
    except SystemExit as ended:
        status = ended.code
    for stream in sys.stdout, sys.stderr:
        print(f"status {{status}}", file=stream, flush=True)
"""
ROS = ["rclpy", "sensor_msgs", "nav_msgs", "geometry_msgs", "diagnostic_msgs", "std_msgs"]


def without_ros(calls):
    """Start a program in one process for each call: its status, standard output and errors."""
    code = WITHOUT_ROS.format(blocked=ROS, calls=calls)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    printed, complained = (
        re.split(r"^status (\d)\n", text, flags=re.MULTILINE) for text in (done.stdout, done.stderr)
    )
    return list(zip(map(int, printed[1::2]), printed[::2], complained[::2], strict=False))


def test_nodes_say_what_they_are_without_ros():
    rests = (["--version"], ["--help"], [])
    outputs = without_ros([[name, *rest] for name in start.NODES for rest in rests])
    assert len(outputs) == 3 * len(start.NODES)
    for k, name in enumerate(start.NODES):
        version, (status, usage, _), (refused, _, complaint) = outputs[3 * k : 3 * k + 3]
        assert version == (0, "imu_sim_ros 2.0.0\n", "")
        assert (status, usage.partition(" ...]")[0]) == (0, f"usage: {name} [--PARAMETER VALUE")
        assert refused == 2
        (line,) = complaint.splitlines()
        assert line.startswith(f"{name}: needs ROS 2, but ")


@pytest.mark.parametrize("name", start.PROGRAMS)
def test_every_program_has_a_version(name, capsys):
    with pytest.raises(SystemExit, match="0"):
        importlib.import_module(f"imu_sim_ros.commands.{name}").main(["--version"])
    assert capsys.readouterr().out == "imu_sim_ros 2.0.0\n"
