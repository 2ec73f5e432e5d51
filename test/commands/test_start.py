# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A program's start: what it loads, and in which state it leaves the interpreter."""

import os
import subprocess
import sys
import textwrap

import pytest

from imu_sim_ros.terminal import startup

NOT_NEEDED = {
    "importlib.metadata",
    "json",
    "sqlite3",
    "tempfile",
    "traceback",
    "scipy",
    "matplotlib",
    "rosbags",
    "rich",
    "imu_sim_ros.bags.read",
    "imu_sim_ros.sensors.camera.parameters",
    "imu_sim_ros.sensors.camera.frames",
    "imu_sim_ros.datasets.consumers.kalibr",
    "imu_sim_ros.trajectory.bspline",
}
"""Modules that a program loads that writes the readings of one IMU into a bag."""


def test_a_short_run_loads_what_it_needs(tmp_path):
    code = textwrap.dedent(
        """
        import os, sys
        from imu_sim_ros.commands import start
        start.generate()
        print(os.environ["OPENBLAS_NUM_THREADS"], *sys.modules)
        """
    )
    environment = {name: v for name, v in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    argv = ["--duration", "1s", "-o", str(tmp_path / "x.mcap"), "--quiet"]
    done = subprocess.run(
        [sys.executable, "-c", code, *argv],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    threads, *modules = done.stdout.split()
    assert threads == "1"
    assert not NOT_NEEDED & set(modules)


def test_jobs_on_tracks_and_readings_load_no_simulation():
    code = """
import sys
from imu_sim_ros.jobs import evaluate, report
print("evaluate", *sys.modules)
from imu_sim_ros.jobs import dead_reckon
print("dead_reckon", *sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    evaluating, reckoning = (set(line.split()) for line in done.stdout.splitlines())
    loaded = {"imu_sim_ros.simulation.parameters", "imu_sim_ros.navigation.parameters"}
    assert not loaded & evaluating
    assert "imu_sim_ros.navigation.parameters" in reckoning
    assert "imu_sim_ros.sensors.camera.view" not in reckoning


def test_the_number_of_threads_that_a_user_chose_stays(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    with pytest.raises(ModuleNotFoundError):
        startup.load("imu_sim_ros.commands.no_such_program")
    assert os.environ["OPENBLAS_NUM_THREADS"] == "3"  # what the user chose stays
