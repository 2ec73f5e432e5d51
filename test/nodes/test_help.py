# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Help of the nodes: wrapped to the terminal, with examples on top that are accepted."""

import itertools
import re
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
    for parser in (help.parser(name), help.main_parameter_parser(name)):
        text = parser.format_help()
        if columns < 80:  # commands are not broken
            text = re.sub(r"examples:\n.*?\n\n", "", text, flags=re.DOTALL)
        assert [line for line in text.splitlines() if len(line) > columns] == []


SCREENS = 2 * 25
"""Lines of two screens of a usual terminal, 80 by 25."""


@pytest.mark.parametrize("name", help.PROGRAMS)
def test_help_fits_two_screens_and_help_all_has_every_parameter(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    parameter_names = set(parameters(help.PROGRAMS[name].section()))
    assert help.answer_requests(name, ["--help"]) == 0
    short = capsys.readouterr().out
    if help.PROGRAMS[name].main:
        assert len(short.splitlines()) <= SCREENS
        assert short.index("examples:") < short.index("options:")
        assert "--help-all" in short
        files = set(help.SECTION_FILES.values())
        assert set(help.PROGRAMS[name].main) <= parameter_names | {*help.SECTION_FILES} | files
    assert help.answer_requests(name, ["--help-all"]) == 0
    whole = capsys.readouterr().out
    assert {f"--{key}" for key in parameter_names} <= set(
        re.findall(r"^  (--\S+)", whole, re.MULTILINE)
    )


@pytest.mark.parametrize("name", help.PROGRAMS)
def test_examples_of_the_help_are_accepted(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("run.yaml").write_text("/**:\n  ros__parameters:\n    rate: 100.0\n")
    tail = help.main_parameter_parser(name).format_help().partition("examples:\n")[2]
    lines = [line.strip() for line in tail.partition("\n\n")[0].splitlines()]
    assert len(lines) >= 2
    parameter_names = set(parameters(help.PROGRAMS[name].section()))
    for line in lines:
        program, *example_arguments = shlex.split(line)
        assert program == name
        plain = (
            recorder.plain_arguments(example_arguments) if name == "recorder" else example_arguments
        )
        node_arguments = ros_arguments(plain, help.PROGRAMS[name].section(), tmp_path)
        overrides = dict(
            word.split(":=", 1) for flag, word in itertools.pairwise(node_arguments) if flag == "-p"
        )
        assert set(overrides) <= parameter_names
        if "imu.preset" in overrides:
            assert overrides["imu.preset"].strip('"') in files.names("imus")
