# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lines name an argument as the user of Python, of a program or of a node writes it."""

from argparse import Namespace
from typing import Annotated

import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands import dead_reckon
from imu_sim_ros.core.arguments import number
from imu_sim_ros.core.spelling import (
    argument,
    argument_prefix,
    job_argument,
    spell_arguments,
    use_spelling,
)
from imu_sim_ros.terminal.signatures import call_job


@pytest.mark.parametrize(
    ("door", "gap", "switch", "unit", "topic", "renamed"),
    [
        (
            "python",
            "max_gap=0.5",
            "robust=True",
            "accel_unit='g'",
            "truth_topic=...",
            "rename={'/imu': 'NEW'}",
        ),
        (
            "program",
            "--max-gap 0.5s",
            "--robust",
            "--accel-unit g",
            "--truth-topic",
            "--rename /imu=NEW",
        ),
        (
            "node",
            "max_gap:=0.5",
            "robust:=true",
            "accel_unit:=g",
            "truth_topic",
            "rename:=/imu=NEW",
        ),
    ],
)
def test_arguments_in_messages_are_spelled_for_their_user(door, gap, switch, unit, topic, renamed):
    with use_spelling(door):
        assert argument("max_gap", 0.5, "s") == gap
        assert argument("robust", True) == switch
        assert argument("rename", {"/imu": "NEW"}) == renamed
        assert spell_arguments("{accel_unit g} or {truth_topic}") == f"{unit} or {topic}"
    assert argument_prefix("max_gap", "0.5") == "max_gap = 0.5"  # Python's again


@pytest.mark.parametrize(
    ("door", "advice"),
    [
        ("python", "convert(..., recover=True)"),
        ("program", "convert_bag --recover"),
        ("node", "convert_bag --recover"),
    ],
)
def test_advice_names_the_function_in_python_and_the_program_elsewhere(door, advice):
    with use_spelling(door):
        assert job_argument("convert", "recover") == advice


def test_a_damaged_bag_is_recovered_by_a_call_in_python_and_by_a_program_at_the_terminal(
    tmp_path, capsys
):
    path = tmp_path / "cut.mcap"
    ims.generate(path, duration=1.0, rate=100.0, seed=1)
    path.write_bytes(path.read_bytes()[:-300])
    with pytest.raises(ims.InputError, match=r"convert\(\.\.\., recover=True\) recovers") as caught:
        ims.dead_reckon(path)
    assert "--" not in str(caught.value)
    assert dead_reckon.main([str(path)]) == 2
    assert "; convert_bag --recover recovers the complete messages" in capsys.readouterr().err


def _job(max_gap: Annotated[float, "TIME"] = 0.5) -> float:
    """Check a gap.

    :param max_gap: longest gap [s]
    """
    return number("max_gap", max_gap, "above 0", 0.0, exclusive=True)


def test_a_program_is_told_about_what_was_typed_alone():
    with pytest.raises(ims.ConfigurationError) as typed:
        call_job(_job, Namespace(max_gap=-1.0))
    assert typed.value.problems == ("--max-gap -1.0: must be above 0",)
    with pytest.raises(ims.ConfigurationError) as of_a_file:
        call_job(_job, Namespace(max_gap=None), defaults={"max_gap": -1.0})
    assert of_a_file.value.problems == ("max_gap = -1.0: must be above 0",)
    with pytest.raises(ims.ConfigurationError) as python:
        _job(-1.0)
    assert python.value.problems == ("max_gap = -1.0: must be above 0",)


def test_python_users_are_told_about_keywords():
    truth = ims.simulate(duration=20, rate=1.0, seed=1).truth
    late = ims.States(truth.t_ns + 300_000_000, truth.position, truth.q_wb)
    with pytest.raises(ims.InputError, match=r"max_gap=1\.5 allows it"):
        ims.evaluate(late, truth, max_gap=0.3)
