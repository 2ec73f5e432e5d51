# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration: three real nodes, and nothing lost between them."""

import re
import signal
import subprocess
import sys

import pytest

from imu_sim_ros.core.errors import MachineError
from imu_sim_ros.jobs import demo as job
from imu_sim_ros.simulation.parameters import load_simulation

pytestmark = pytest.mark.ros


def demo(*arguments):
    command = [sys.executable, "-m", "imu_sim_ros.commands.demo", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=500, check=False)


def test_all_messages_arrive_and_the_errors_are_the_known_ones(tmp_path):
    result = demo("--duration", "3s", "-o", str(tmp_path / "out"))
    assert result.returncode == 0, result.stdout + result.stderr
    for topic in ("imu/data_raw", "ground_truth/odom", "dead_reckoned/odom"):
        row = re.search(rf"{topic} +(\d+) +(\d+) +(\d+) +(-?\d+) +([\d.]+) +(\w+)", result.stdout)
        assert row is not None, result.stdout
        assert row.groups() == ("600", "600", "600", "0", "200.000", "exact")
    without_noise = dict(re.findall(r"(euler|midpoint), without noise +([\d.e-]+)", result.stdout))
    # Orders 1 and 2 at 5 ms: the errors lie a factor of a hundred and more apart.
    assert float(without_noise["midpoint"]) < 0.01 * float(without_noise["euler"])
    picture = (tmp_path / "out" / "trajectory.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert (tmp_path / "out" / "bag" / "metadata.yaml").is_file()


def test_a_trajectory_that_does_not_exist_is_one_line(tmp_path):
    result = demo("--trajectory", "nowhere.csv", "-o", str(tmp_path / "out"))
    assert result.returncode == 2
    assert re.fullmatch(
        r"demo: unknown trajectory 'nowhere.csv'; neither a file nor .*\n", result.stderr
    )
    assert not (tmp_path / "out").exists()


def test_nodes_that_have_begun_end_if_another_one_cannot_begin(tmp_path, monkeypatch):
    begun = []

    def start(log, name, *arguments):
        if begun:
            raise KeyboardInterrupt
        begun.append(subprocess.Popen(["sleep", "600"]))
        return begun[0]

    monkeypatch.setattr(job, "_start", start)
    with pytest.raises(KeyboardInterrupt):
        job.run_nodes(load_simulation({"duration": 1.0}), tmp_path)
    assert begun[0].returncode == -signal.SIGKILL


def test_a_simulator_that_does_not_end_is_told_with_its_status(tmp_path, monkeypatch):
    def start(log, name, *arguments):
        return subprocess.Popen(["sleep", "600" if name == "simulator" else "0"])

    monkeypatch.setattr(job, "_start", start)
    monkeypatch.setattr(job, "_wait", lambda nodes, duration: nodes["integrator"].wait())
    with pytest.raises(MachineError, match="^simulator ended with status -9"):
        job.run_nodes(load_simulation({"duration": 1.0}), tmp_path)
