# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""No input, however hostile, gives a traceback, a hang or a changed file."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

EXAMPLES = 80
"""Always the same ones; ten or twenty seconds."""
REPOSITORY = Path(__file__).parents[2]


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def fuzzer():
    """Start a process of its own: it forks, which one that has used ROS must not do."""
    process = subprocess.Popen(
        [sys.executable, str(REPOSITORY / "test/fuzz/hostile.py"), "--serve"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
    )
    yield process
    process.stdin.close()
    assert process.wait(60) == 0


@settings(
    max_examples=EXAMPLES,
    derandomize=True,
    deadline=None,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)
@given(number=st.integers(0, 10**6))
def test_hostile_inputs(fuzzer, number):
    fuzzer.stdin.write(f"{number}\n")
    fuzzer.stdin.flush()
    kind, arguments, status, faults, error = json.loads(fuzzer.stdout.readline())
    case = (number, kind, arguments, status, faults, error)
    assert not faults, case
    assert "unexpected:" not in error, case
