# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The commands of the manual's table of checks select tests that exist."""

import re
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TABLE = (
    (ROOT / "docs/explanation/checked_against.md")
    .read_text(encoding="utf-8")
    .partition("\n| claim")[2]
)
COMMANDS = [
    c for c in re.findall(r"`([^`]*)`", TABLE) if c.startswith(("pytest ", ".venv/bin/python "))
]


def test_there_are_as_many_commands_as_claims():
    assert len(COMMANDS) >= 30


@pytest.mark.parametrize("command", sorted({c for c in COMMANDS if c.startswith("pytest ")}))
def test_every_command_selects_a_test(command):
    arguments = shlex.split(command)[1:]
    options = [k for k, word in enumerate(arguments) if word.startswith("-")]
    places = arguments[: options[0]] if options else arguments
    files = [f for p in places for f in (sorted((ROOT / p).rglob("test_*.py")) or [ROOT / p])]
    texts = [file.read_text(encoding="utf-8") for file in files]
    names = re.findall(r"def (test_\w+)", "\n".join(texts))
    assert names
    if "-k" in arguments:
        selected = arguments[arguments.index("-k") + 1].split(" or ")
        assert all(any(word in name for name in names) for word in selected), names


@pytest.mark.parametrize("command", sorted({c for c in COMMANDS if not c.startswith("pytest ")}))
def test_every_benchmark_exists(command):
    if command.startswith(".venv/bin/python test/bench/run.py "):
        for name in command.split()[2:]:
            assert (ROOT / f"test/bench/bench_{name}.py").is_file()
    else:
        assert (ROOT / re.search(r"test/bench/\w+\.py|requirements-test", command)[0]).exists()
