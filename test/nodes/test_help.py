# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Help of the nodes: wrapped to the terminal, with examples at its end that are accepted."""

import itertools
import shlex
from pathlib import Path

import pytest

from imu_sim_ros.commands import start
from imu_sim_ros.nodes import help
from imu_sim_ros.nodes.arguments import ros_arguments
from imu_sim_ros.nodes.recorder import node as recorder
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import parameters


def test_every_node_has_examples() -> None:
    assert set(help.PROGRAMS) == set(start.NODES)


@pytest.mark.parametrize("name", help.PROGRAMS)
@pytest.mark.parametrize("columns", [60, 80, 120])
def test_no_line_is_longer_than_the_terminal(
    name: str, columns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    words = help.parser(name).format_help()
    whole = words if columns >= 80 else words.partition("examples:")[0]
    assert [line for line in whole.splitlines() if len(line) > columns] == []


@pytest.mark.parametrize("name", help.PROGRAMS)
def test_examples_end_the_help_and_are_accepted(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("run.yaml").write_text("/**:\n  ros__parameters:\n    rate: 100.0\n")
    tail = help.parser(name).format_help().partition("examples:\n")[2]
    lines = [line.strip() for line in tail.splitlines()]
    assert len(lines) >= 2
    known = set(parameters(help.PROGRAMS[name].section()))
    for line in lines:
        program, *words = shlex.split(line)
        assert program == name
        plain = recorder.plain_arguments(words) if name == "recorder" else words
        made = ros_arguments(plain, help.PROGRAMS[name].section(), tmp_path)
        given = dict(
            word.split(":=", 1) for before, word in itertools.pairwise(made) if before == "-p"
        )
        assert set(given) <= known
        if "imu.preset" in given:
            assert given["imu.preset"].strip('"') in files.names("imus")
