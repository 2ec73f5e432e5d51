# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whatever goes wrong in a thread of a node ends the node, with a line and with status 1."""

import os
import signal
import textwrap
import time
from pathlib import Path

import pytest

from imu_sim_ros.nodes import run

pytestmark = pytest.mark.ros

REPOSITORY = Path(__file__).parents[3]


@pytest.fixture
def faulty(tmp_path):
    """Install a trajectory that works for a second and then raises; returns the environment."""
    (tmp_path / "faulty.py").write_text(
        textwrap.dedent("""
            from dataclasses import dataclass

            import numpy as np

            from imu_sim_ros.trajectory.parameters import TrajectoryParameters
            from imu_sim_ros.trajectory import Motion


            @dataclass(frozen=True)
            class Faulty(TrajectoryParameters):
                duration = 100.0

                def sample(self, t):
                    if len(t) and t[-1] > 1.0:
                        raise ValueError("no road\\nbehind this point")
                    zero = np.zeros((len(t), 3))
                    q_wb = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
                    return Motion(zero, zero, zero, q_wb, zero, zero)
        """)
    )
    info = tmp_path / "faulty-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: faulty\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[imu_sim_ros.trajectories]\nfaulty = faulty:Faulty\n")
    return {"PYTHONPATH": f"{REPOSITORY}{os.pathsep}{tmp_path}"}


def test_an_error_in_a_trajectory_ends_the_simulator(node, faulty):
    simulator = node("simulator", "--trajectory", "faulty", **faulty)
    assert simulator.status() == 1
    assert (
        "simulator: unexpected: ValueError: no road behind this point; "
        "run with --debug for the traceback\n" in simulator.output
    )
    assert "Traceback" not in simulator.output
    assert "messages on imu/data_raw" in simulator.output


def test_the_traceback_is_shown_on_request(node, faulty):
    log_arguments = ["--ros-args", "--log-level", "debug"]
    assert run.parse_debug_option(log_arguments) == (log_arguments, True)
    assert run.parse_debug_option(["--debug", "--rate=9"]) == (["--rate=9"], True)
    assert run.parse_debug_option(["--rate=9"]) == (["--rate=9"], False)
    simulator = node("simulator", "--trajectory", "faulty", "--debug", **faulty)
    assert simulator.status() == 1
    assert 'faulty.py", line' in simulator.output
    assert "Traceback (most recent call last)" in simulator.output


@pytest.mark.parametrize("form", ["folder", "file"])
def test_a_bag_that_cannot_be_opened_ends_the_recorder(node, tmp_path, form):
    name = "n" * 300 + (".mcap" if form == "file" else "")
    recorder = node("recorder", "-o", name)
    assert recorder.status() in (1, 2)
    assert recorder.output.startswith("recorder: ")
    assert "File name too long" in recorder.output
    assert recorder.output.count("\n") == 1


def test_a_missing_library_ends_the_recorder(node, tmp_path):
    (tmp_path / "lz4").mkdir()
    (tmp_path / "lz4" / "__init__.py").write_text("raise ImportError('no lz4 here')\n")
    recorder = node(
        "recorder", "-o", "bag", "--compression", "lz4", PYTHONPATH=f"{tmp_path}:{REPOSITORY}"
    )
    assert recorder.status() == 1
    assert "recorder: unexpected: ImportError: no lz4 here; run with --debug" in recorder.output
    assert "Traceback" not in recorder.output


def test_an_error_in_the_integration_ends_the_integrator(start, feed, tmp_path):
    # A bug that no input is known to reach, put where readings are integrated.
    program = textwrap.dedent("""
        import sys
        from imu_sim_ros.navigation import stepper

        def broken(self, *reading):
            raise ZeroDivisionError("a bug")

        stepper.Stepper.add = broken
        from imu_sim_ros.nodes.integrator import node
        sys.exit(node.main())
    """)
    integrator = start("-c", program, "--imu", "perfect")
    feed(count=50, topics=["imu"])
    assert integrator.status() == 1
    assert "integrator: unexpected: ZeroDivisionError: a bug; run with --debug" in integrator.output
    assert "Traceback" not in integrator.output


def test_an_error_in_a_callback_ends_the_node(start, tmp_path):
    program = textwrap.dedent("""
        import sys
        from imu_sim_ros.nodes.simulator import node

        def broken(self):
            raise KeyError("a bug")

        node.Simulator._diagnose = broken
        sys.exit(node.main())
    """)
    simulator = start("-c", program)
    assert simulator.status() == 1
    assert "simulator: unexpected: KeyError: 'a bug'; run with --debug" in simulator.output
    assert "messages on imu/data_raw" in simulator.output


@pytest.mark.parametrize(
    ("name", "value"), [("simulator", "[1, 2]"), ("integrator", "5"), ("recorder", "maybe")]
)
def test_a_file_whose_use_sim_time_is_no_truth_value_is_refused(node, tmp_path, name, value):
    path = tmp_path / "given.yaml"
    path.write_text(f"/**:\n  ros__parameters:\n    use_sim_time: {value}\n")
    refused = node(name, "--ros-args", "--params-file", str(path))
    assert refused.status() == 2
    (line,) = refused.output.splitlines()
    assert line.startswith(f"{name}: {path}: use_sim_time = ")
    assert line.endswith(": must be true or false")


START = "import sys; from imu_sim_ros.nodes import start; sys.exit(start.{}())"


@pytest.mark.parametrize(
    ("name", "delay", "number"),
    [
        ("simulator", 0.02, signal.SIGINT),
        ("simulator", 0.3, signal.SIGTERM),
        ("simulator", 0.6, signal.SIGHUP),
        ("integrator", 0.3, signal.SIGHUP),
        ("recorder", 0.3, signal.SIGINT),
        ("recorder", 0.6, signal.SIGTERM),
    ],
)
def test_signals_end_a_node_at_any_moment_of_its_start(start, name, delay, number):
    """Each moment in one node; while it imports and when it has begun, in others, too.

    One handler is for all signals and nodes.
    """
    process = start("-c", START.format(name))
    # Before that the interpreter starts, and a signal has the effect that the system gives it;
    # SIGHUP is the last of the signals to be watched.
    process.wait_until_it_catches(signal.SIGHUP)
    time.sleep(delay)
    assert process.end(number) == 0, process.output
    assert "Traceback" not in process.output
