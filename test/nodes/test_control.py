# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``control`` against a real simulator, as a process of its own."""

import json
import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from programs import PATIENCE, program
from ros_messages import stamps_ns

from imu_sim_ros.commands.control import main

pytestmark = pytest.mark.ros

REPOSITORY = Path(__file__).parents[2]
IMU = "imu/data_raw"


@pytest.fixture
def control(domains: tuple[int, int]) -> Any:
    """Return a function that starts ``control ARGUMENTS``."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(REPOSITORY),
        "PYTHONUNBUFFERED": "1",
        "ROS_DOMAIN_ID": str(domains[0]),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }

    def start(*arguments: str) -> "subprocess.Popen[str]":
        return subprocess.Popen(
            [*program("control"), *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
        )

    return start


@pytest.fixture
def ask(domains: tuple[int, int], monkeypatch: pytest.MonkeyPatch, capfd: Any) -> Any:
    """Return a function that runs ``control ARGUMENTS`` in this process.

    It gives status, output and errors.
    """
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domains[0]))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    for name in ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"):
        # The program sets one for the rest of its process; only what was set here is restored.
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)

    def run(*arguments: str) -> tuple[int, str, str]:
        capfd.readouterr()
        status = main([*arguments, "--timeout", "20s"])
        return status, *capfd.readouterr()

    return run


def test_pause_step_resume_and_reset(start: Any, listener: Any, ask: Any) -> None:
    from sensor_msgs.msg import Imu

    listener.listen(IMU, Imu)
    start("simulator", rate=100, start_time=5.0, autostart=False)
    assert ask("step", "7") == (0, "7 samples\n", "")
    listener.wait_for(IMU, 7)
    assert ask("step") == (0, "1 samples\n", "")  # a count holds for its step alone
    listener.wait_for(IMU, 8)
    assert ask("resume") == (0, "running\n", "")
    listener.wait_for(IMU, 50)
    assert ask("step") == (
        2,
        "",
        "control: /simulator: not paused: call ~/pause with true first\n",
    )
    assert ask("pause") == (0, "paused\n", "")
    listener.settle()
    paused_count = len(listener.raw[IMU])
    assert ask("step", "1") == (0, "1 samples\n", "")  # nothing came in the second this takes
    listener.wait_for(IMU, paused_count + 1)
    listener.settle()
    paused_count += 1
    assert len(listener.raw[IMU]) == paused_count
    assert ask("reset") == (0, "back at the first sample\n", "")
    assert ask("step", "2")[0] == 0
    listener.wait_for(IMU, paused_count + 2)
    received_stamps = stamps_ns(listener.messages(IMU))
    assert received_stamps[:paused_count] == [
        5 * 10**9 + 10_000_000 * k for k in range(paused_count)
    ]
    assert received_stamps[paused_count:] == [5 * 10**9, 5 * 10**9 + 10_000_000]


def test_set_live_parameters_and_say_each_refusal(start: Any, listener: Any, ask: Any) -> None:
    from rcl_interfaces.srv import GetParameters

    start("simulator", rate=100, imu__preset="perfect")
    names = ["imu.gyroscope_bias", "imu.accelerometer_bias", "imu.dropout_probability"]
    changes = [names[0], "[0.25, 0, -1]", names[1], "-2", names[2], "0.5"]
    assert ask("set", *changes) == (
        0,
        "imu.gyroscope_bias = [0.25, 0, -1]\nimu.accelerometer_bias = -2\n"
        "imu.dropout_probability = 0.5\n",
        "",
    )
    stored_values = listener.call("simulator/get_parameters", GetParameters, names=names).values
    assert list(stored_values[0].double_array_value) == [0.25, 0.0, -1.0]
    assert list(stored_values[1].double_array_value) == [-2.0, -2.0, -2.0]
    assert stored_values[2].double_value == 0.5
    wrong = ["imu.dropout_probability", "1.5", "rate", "50", "imu.gyro_bias", "1"]
    status, output, error = ask("set", "imu.gyroscope_bias", "0", *wrong)
    assert (status, output) == (2, "imu.gyroscope_bias = 0\n")
    lines = error.splitlines()
    assert len(lines) == 3
    assert "control: imu.dropout_probability = 1.5: must be" in lines[0]
    assert "control: rate is read-only: it is fixed when the node starts" in lines[1]
    assert "control: imu.gyro_bias: unknown parameter" in lines[2]
    stored_values = listener.call("simulator/get_parameters", GetParameters, names=names).values
    assert list(stored_values[0].double_array_value) == [0.0, 0.0, 0.0]
    assert stored_values[2].double_value == 0.5


def test_injected_faults_and_diagnostics_are_watched(
    start: Any, listener: Any, ask: Any, control: Any
) -> None:
    from sensor_msgs.msg import Imu

    listener.listen(IMU, Imu)
    node = start("simulator", "--ros-args", "-r", "__ns:=/left", rate=200, imu__preset="perfect")
    name = ("--node", "/left/simulator")
    value = ("--value", "[0.5, 0, 0]", "--duration", "1000s")
    assert ask("inject", "bias_jump", *value, *name) == (0, "injected bias_jump\n", "")
    status, _, error = ask("inject", "latency", "--value", "11", *name)
    assert status == 2
    assert "must be a latency of at most 10 s" in error
    watching = control("watch", "--json", *name)
    watched_entries: list[dict[str, Any]] = []
    for _ in range(20):  # a status comes once per second, the fault at once
        watched_entries.append(json.loads(watching.stdout.readline()))
        if {"words", "t_ns"} <= {key for entry in watched_entries for key in entry}:
            break
    watching.send_signal(signal.SIGTERM)
    _, error = watching.communicate(timeout=PATIENCE)
    assert (watching.returncode, error) == (143, "control: interrupted; the simulator continues\n")
    fault = next(entry for entry in watched_entries if "t_ns" in entry)
    assert fault["values"]["kind"] == "bias_jump"
    assert fault["values"]["value"] == "0.5 0 0"
    report = next(entry for entry in watched_entries if "words" in entry)
    assert float(report["values"][f"{IMU} rate [Hz]"]) > 0.0
    assert "lateness p99 [us]" in report["values"]
    status, output, _ = ask("watch", "--duration", "2s", *name)
    assert status == 0
    assert "fault: bias_jump gyroscope 0.5 0 0 for 1000 s from stamp" in output
    assert f"running  {IMU} " in output
    assert "late p50/p99/max" in output
    assert output.count(" samples late, ") == 2
    assert node.end() == 0


def test_a_simulator_that_is_not_there_is_said(start: Any, listener: Any, control: Any) -> None:
    from rcl_interfaces.srv import ListParameters

    start("simulator", rate=100)
    listener.call("simulator/list_parameters", ListParameters)
    process = control("pause", "--node", "/nix", "--timeout", "3s")
    _, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert (
        error == "control: /nix is not available after 3 s; available: /simulator (--node NAME)\n"
    )


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["step", "0"], "control: step 0: must be 1 to 1000000 samples\n"),
        (["inject", "bias_jump", "--value", "[1, 2]"], "'[1, 2]' must be a number or a list"),
        (["inject", "bias_jump", "--value", "nan"], "'nan' must be a number or a list"),
        (["inject", "bias_jump", "--value", "[1, a, 2]"], "must be a number or a list"),
        (["set", "imu.gyroscope_bias"], "control: imu.gyroscope_bias: has no value"),
        (["set", "rate", "[1, 2"], "control: rate: "),
        (["inject", "earthquake"], "unknown kind 'earthquake'"),
        (["watch", "--duration", "soon"], "'soon' is not a duration"),
        (["pause", "--node", "b c"], "--node 'b c': must be a node's name with its namespace"),
        ([], "the following arguments are required: ACTION"),
    ],
)
def test_bad_arguments_need_no_simulator(capsys: Any, arguments: list[str], line: str) -> None:
    """The arguments are parsed in this process, without a simulator."""
    try:
        status = main(arguments)
    except SystemExit as end:  # as the parser ends a program
        status = end.code
    assert status == 2
    output, error = capsys.readouterr()
    assert output == ""
    assert line in error
    assert error.count("\n") == 1
