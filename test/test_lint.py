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
TOOLS = {
    "ruff-check": ["ruff", "check", "."],
    "ruff-format": ["ruff", "format", "--check", "."],
    "mypy": ["mypy", "--no-error-summary"],
}


@pytest.mark.parametrize("arguments", TOOLS.values(), ids=TOOLS)
def test_nothing_is_found(arguments):
    command = [str(Path(sys.executable).with_name(arguments[0])), *arguments[1:]]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
