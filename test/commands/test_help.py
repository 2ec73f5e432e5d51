# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Help for people: examples at its end that can be parsed, and one entry point for all programs."""

import argparse
import importlib
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from imu_sim_ros.commands import control, start
from imu_sim_ros.core.errors import Problems
from imu_sim_ros.jobs.generate import run_parameters
from imu_sim_ros.jobs.writing import Journal
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors import switchable_sensors, switches
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.playback import load_simulator

WITH_PARSER = [*start.PROGRAMS, "demo"]
ROOT = Path(__file__).parents[2]


def parser(name):
    return importlib.import_module(f"imu_sim_ros.commands.{name}").parser()


def examples(text):
    tail = text.partition("examples:\n")[2].replace("\\\n", " ")
    return [line.strip() for line in tail.splitlines() if line.strip()]


def subcommands(name):
    """Return the parsers of a program's subcommands by name."""
    for action in parser(name)._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def accept(line):
    """Parse an example as the program that it names would."""
    argv = shlex.split(line, comments=True)
    if argv[0] == "make":
        makefile = (ROOT / "Makefile").read_text()
        assert re.search(rf"^{argv[1]}:", makefile, re.M)
        return
    if argv[:2] == ["python", "-m"]:
        argv = [argv[2].rpartition(".")[2], *argv[3:]]
    if argv[0] == "imu_sim":
        argv = argv[1:]
    arguments = parser(argv[0]).parse_args(argv[1:])
    for argument, folder in (("imu", "imus"), ("trajectory", "trajectories"), ("truth", "imus")):
        value = str(getattr(arguments, argument, None) or "perfect")
        assert "." in value or value in {*files.names(folder), "perfect"}
    if argv[0] == "campaign" and "." not in arguments.plan:
        assert arguments.plan in files.names("campaigns")


@pytest.mark.parametrize("name", WITH_PARSER)
def test_every_help_ends_with_examples_that_are_accepted(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = examples(parser(name).format_help())
    assert len(lines) >= 2
    for line in lines:
        assert name in line.split("#")[0] or line.startswith("make")
        accept(line)


@pytest.mark.parametrize("name", [name for name in WITH_PARSER if subcommands(name)])
def test_the_help_of_every_subcommand_ends_with_its_examples(name):
    for action, inner in subcommands(name).items():
        lines = examples(inner.format_help())
        assert lines, f"{name} {action}"
        assert all(line.startswith(f"imu_sim {name} {action}") for line in lines)


@pytest.mark.parametrize("name", WITH_PARSER)
def test_help_is_wrapped_to_the_terminal(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    for program_parser in (parser(name), *subcommands(name).values()):
        description, _, tail = program_parser.format_help().partition("examples:")
        assert max(map(len, tail.splitlines()), default=0) <= 100
        # A choice such as {none,yaw,se3,sim3} cannot be broken.
        lines = (
            line.strip().replace(" {", "{") for line in description.splitlines() if len(line) > 80
        )
        long = [line for line in lines if " " in line]
        assert long == []


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["imu_sim", *arguments])
    return start.imu_sim()


def test_imu_sim_lists_all_programs_and_runs_them(monkeypatch, capsys):
    assert run(monkeypatch) == 0
    out = capsys.readouterr().out
    assert all(f"  {name} " in out for name in start.PROGRAMS | start.NODES)
    lines = examples(out)
    assert len(lines) >= 2
    for line in lines:
        accept(line)
    assert run(monkeypatch, "--version") == 0
    with pytest.raises(SystemExit) as ended:
        run(monkeypatch, "allan", "--help")
    assert ended.value.code == 0
    assert "usage: imu_sim allan" in capsys.readouterr().out


def test_imu_sim_says_in_a_line_what_it_does_not_know(monkeypatch, capsys):
    assert run(monkeypatch, "alan") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("imu_sim: unknown program 'alan'; did you mean allan?")


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("generate --traj", {"--trajectory"}),
        ("generate --imu mpu", {"mpu6000", "mpu9250"}),
        ("imu_sim dead", {"dead_reckon"}),
        ("imu_sim evaluate --align s", {"se3", "sim3"}),
        ("generate --set imu.lever", {"imu.lever_arm="}),
        ("dead_reckon x --set level_t", {"level_time="}),
    ],
)
def test_completion_by_tab(line, offered, tmp_path):
    """Ask as argcomplete's shell function does, and read what it would offer."""
    pytest.importorskip("argcomplete")
    answer = tmp_path / "answer"
    program = line.split()[0]
    environment = {
        **os.environ,
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_SUPPRESS_SPACE": "0",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "COMP_TYPE": "9",
    }
    code = f"from imu_sim_ros.commands import start; start.{program}()"
    subprocess.run([sys.executable, "-c", code], env=environment, cwd=tmp_path, check=True)
    assert {word.strip() for word in answer.read_text().split("\n")} == offered


def written_commands():
    """Yield the command lines of the README's and the manual's blocks, with their places."""
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        blocks = path.read_text(encoding="utf-8").replace("\\\n", " ").split("\n```")[1::2]
        for line in "\n".join(blocks).splitlines():
            command = line.strip().removeprefix("$ ").removeprefix(".venv/bin/")
            command = command.removeprefix("imu_sim ")
            program, _, rest = command.partition(" ")
            is_written = program in start.PROGRAMS and rest and line[0] != " "
            if is_written and not re.search(r"\.\.\.|<\w+>|[|>]", command):
                yield f"{path.name}: {command}"


def test_every_command_of_the_manual_is_accepted():
    lines = list(written_commands())
    assert len(lines) > 30
    for line in lines:
        program, *argv = shlex.split(line.partition(": ")[2], comments=True)
        try:
            parser(program).parse_args(argv)
        except SystemExit:
            pytest.fail(line)


def body_of(arguments):
    """Return the body that a command line of generate describes."""
    names = [*switchable_sensors(), *(sensor.name for sensor in switches().values())]
    sensors = {name: chosen for name in names if (chosen := getattr(arguments, name))}
    overrides = {**sensors, "parameters": dict(arguments.parameters or ())}
    usual = ("imu", "trajectory", "duration", "rate", "seed", "robust", "cameras", "scene")
    settings = {name: chosen for name in usual if (chosen := getattr(arguments, name))}
    chosen, _ = run_parameters(Journal(), Problems(), arguments.params_file, overrides, **settings)
    return load_simulator(chosen)


def test_every_dataset_of_the_manual_has_an_end_and_a_truth_of_its_own():
    """Whoever types all commands of a page is never refused."""
    written = set()
    for line in written_commands():
        page, command = line.split(": ", 1)
        program, *argv = shlex.split(command, comments=True)
        if page == "programs.md" or program != "generate" or argv[-2:] == ["-o", "refused"]:
            continue
        arguments = parser(program).parse_args(argv)
        truth = (page, arguments.output.with_name(arguments.output.name.split(".")[0]))
        assert truth not in written, line
        written.add(truth)
        is_preset = arguments.trajectory in (None, *files.names("trajectories"))
        if (
            arguments.duration is None and is_preset and not arguments.params_file
        ):  # those are the page's own
            assert Body(body_of(arguments)).total is not None, line
    assert len(written) > 30


def test_control_injects_faults_of_every_sensor():
    parsed = control.parser().parse_args(["inject", "dropout", "--triad", "magnetometer"])
    assert parsed.triad == "magnetometer"
