# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Help for people: examples at its end that can be parsed, and one entry point for all programs."""

import importlib
import shlex
import sys

import pytest

from imu_sim_ros.commands import start

WITH_PARSER = [name for name in start.PROGRAMS if name not in ("campaign", "control")]


def parser(name):
    return importlib.import_module(f"imu_sim_ros.commands.{name}").parser()


def examples(text):
    tail = text.partition("examples:\n")[2].replace("\\\n", " ")
    return [line.strip() for line in tail.splitlines() if line.strip()]


@pytest.mark.parametrize("name", WITH_PARSER)
def test_every_help_ends_with_examples_that_are_accepted(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = examples(parser(name).format_help())
    assert len(lines) >= 2
    for line in lines:
        program, *arguments = shlex.split(line, comments=True)
        assert program == name
        parser(name).parse_args(arguments)


@pytest.mark.parametrize("name", WITH_PARSER)
def test_help_is_wrapped_to_the_terminal(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    above = parser(name).format_help().partition("examples:")[0]
    # A choice such as {none,yaw,se3,sim3} cannot be broken.
    assert [line for line in above.splitlines() if len(line) > 80 and " " in line.strip()] == []


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["imu_sim", *arguments])
    return start.imu_sim()


def test_imu_sim_lists_all_programs_and_runs_them(monkeypatch, capsys):
    assert run(monkeypatch) == 0
    out = capsys.readouterr().out
    assert all(f"  {name} " in out for name in start.PROGRAMS | start.NODES)
    assert run(monkeypatch, "--version") == 0
    with pytest.raises(SystemExit) as ended:
        run(monkeypatch, "allan", "--help")
    assert ended.value.code == 0
    assert "usage: allan" in capsys.readouterr().out


def test_imu_sim_says_in_a_line_what_it_does_not_know(monkeypatch, capsys):
    assert run(monkeypatch, "alan") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("imu_sim: 'alan' is no program; there are generate, ")
