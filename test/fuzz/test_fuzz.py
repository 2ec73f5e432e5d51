# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""No input, however hostile, gives a traceback, a hang or a changed file."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))
import hostile

EXAMPLES = 80
"""Always the same ones; ten or twenty seconds."""
REPOSITORY = Path(__file__).parents[2]


pytestmark = pytest.mark.slow


def started():
    """Start a process of its own: it forks, which one that has used ROS must not do."""
    return subprocess.Popen(
        [sys.executable, str(REPOSITORY / "test/fuzz/hostile.py"), "--serve"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
    )


def descendants(pid):
    """Return the ids of a process' children, and theirs."""
    children = [
        int(child)
        for task in Path(f"/proc/{pid}/task").iterdir()
        for child in (task / "children").read_text().split()
    ]
    return [*children, *(descendant for child in children for descendant in descendants(child))]


@pytest.fixture(scope="module")
def fuzzer():
    """Return a running fuzzer."""
    process = started()
    yield process
    process.stdin.close()
    assert process.wait(60) == 0


@pytest.mark.skipif(not hostile.LIVE[1:], reason="without ROS there are no nodes")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_nothing_outlives_the_fuzzer(number):
    """The integrator, recorder, feed and simulator of the fuzzer are real processes."""
    process = started()
    for kind in ("live", "control"):
        process.stdin.write(f"{hostile.KINDS.index(kind)}\n")
        process.stdin.flush()
        assert json.loads(process.stdout.readline())[0] == kind
    children = descendants(process.pid)
    assert len(children) >= 4
    process.send_signal(number)
    process.communicate()
    end = time.monotonic() + 60.0
    while any(Path(f"/proc/{pid}").exists() for pid in children):
        assert time.monotonic() < end, children
        time.sleep(0.05)


@settings(
    max_examples=EXAMPLES,
    derandomize=True,
    deadline=None,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)
@given(number=st.integers(0, 10**6))
def test_hostile_inputs_end_without_faults_or_unexpected_errors(fuzzer, number):
    fuzzer.stdin.write(f"{number}\n")
    fuzzer.stdin.flush()
    kind, arguments, status, faults, error = json.loads(fuzzer.stdout.readline())
    case = (number, kind, arguments, status, faults, error)
    assert not faults, case
    assert "unexpected:" not in error, case
