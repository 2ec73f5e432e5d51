# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lint, format and types are part of the tests."""

import subprocess
import sys
from pathlib import Path

import pytest

# The linters are installed with today's versions; the run on the oldest versions has none.
# mypy takes a minute of processor time: on a loaded machine more than a test's ten minutes.
pytestmark = [pytest.mark.ros, pytest.mark.timeout(3600)]

ROOT = Path(__file__).parents[1]
# A fifth of mypy's processor time goes into a search for garbage that its process does not need.
MYPY = "import gc; gc.enable = gc.disable; from mypy.__main__ import console_entry; console_entry()"
TOOLS = {
    "ruff-check": ["-m", "ruff", "check", "."],
    "ruff-format": ["-m", "ruff", "format", "--check", "."],
    "mypy": ["-c", MYPY, "--no-error-summary"],
}


@pytest.mark.parametrize("arguments", TOOLS.values(), ids=TOOLS)
def test_linters_and_type_checker_find_nothing(arguments):
    command = [sys.executable, *arguments]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
