# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulator, integrator and recorder as three processes, and what came of their messages."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Final

import numpy as np

from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.core.conventions import DEAD_RECKONED_TOPIC, IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.core.errors import MachineError
from imu_sim_ros.formats.choice import Choice
from imu_sim_ros.formats.door import read_readings, read_states
from imu_sim_ros.jobs.dead_reckon import Track, track_of
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.evaluation import state_at
from imu_sim_ros.navigation.mount import mount_of
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.gravity import gravity_vector
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import SimulationParameters
from imu_sim_ros.terminal.progress import progress
from imu_sim_ros.terminal.text_tables import TextTable

BAG: Final = "bag"
TOPICS: Final = (IMU_TOPIC, TRUTH_TOPIC, DEAD_RECKONED_TOPIC)
_METHODS: Final = ("euler", "midpoint")
_START_TIMEOUT: Final = 30.0
"""Longest start of a node [s]."""
_END_TIMEOUT: Final = 10.0
"""Longest time between SIGINT and the end of a node [s]."""


def run_nodes(parameters: SimulationParameters, folder: Path) -> dict[str, dict[str, int]]:
    """Run the nodes until the simulator is done; return the numbers in their closing lines.

    :param folder: receives the bag, the parameters and what the nodes say.
    :raises MachineError: if a node fails.
    """
    file = folder / "simulation.yaml"
    files.dump(parameters, file, comment="The simulated flight.")
    with ExitStack() as stack:
        log = stack.enter_context((folder / "nodes.log").open("w+", encoding="utf-8"))
        topics = f"[{', '.join(TOPICS)}]"
        arguments = {
            "recorder": ("-p", f"output:={folder / BAG}", "-p", f"topics:={topics}"),
            "integrator": ("-p", "initial_state:=truth", "-p", "error:=true"),
            "simulator": (
                *("--params-file", str(file)),
                *("-p", "wait_for_subscribers:=2", "-p", "wait_for_truth_subscribers:=2"),
            ),
        }
        nodes: dict[str, subprocess.Popen[str]] = {}
        try:
            for name, options in arguments.items():
                nodes[name] = _start(log, name, *options)
            _wait(nodes, parameters.duration)
            time.sleep(0.5)  # the last readings are on their way to the integrator and back
            _end(nodes["integrator"])
            _end(nodes["recorder"])
        finally:
            for process in nodes.values():
                process.kill()
                process.wait()
        for name, process in nodes.items():
            if process.returncode != 0:
                log.seek(0)
                last_line = log.read().strip().rpartition("\n")[2]
                raise MachineError(f"{name} ended with status {process.returncode}: {last_line}")
        log.seek(0)
        return _counts(log.read())


def _start(log: IO[str], name: str, *arguments: str) -> "subprocess.Popen[str]":
    """Start a node that is invisible to other machines and other users."""
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }
    command = [sys.executable, "-m", "imu_sim_ros.commands.start", name, "--ros-args", *arguments]
    return subprocess.Popen(command, stdout=log, stderr=log, env=environment, text=True)


def _wait(nodes: dict[str, "subprocess.Popen[str]"], duration: float) -> None:
    """Wait for the simulator's end, with a bar; another node's end is a failure."""
    steps = 10
    begin = time.monotonic()
    with progress("flying", lambda: round(duration * steps)) as advance:
        while nodes["simulator"].poll() is None:
            time.sleep(1.0 / steps)
            advance(1)
            ended = [name for name, process in nodes.items() if process.poll() not in (None, 0)]
            if ended or time.monotonic() - begin > duration + _START_TIMEOUT:
                return


def _end(process: "subprocess.Popen[str]") -> None:
    """End a program by SIGINT, or by force if it does not follow."""
    process.send_signal(signal.SIGINT)
    try:
        process.wait(_END_TIMEOUT)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _counts(log: str) -> dict[str, dict[str, int]]:
    """Return the numbers ``published`` and ``received`` in the nodes' closing lines.

    The closing table of the recorder has the number of messages ``taken`` from the network.
    """
    result: dict[str, dict[str, int]] = {"published": {}, "received": {}, "taken": {}}
    line = re.compile(r"^\w+: (published|received) (\d+) messages on (\S+)$", re.M)
    for verb, count, topic in line.findall(log):
        result[verb][topic.lstrip("/")] = int(count)
    for topic, count in re.findall(r"^ +(/\S+) +(\d+) ", log, re.M):
        result["taken"][topic.lstrip("/")] = int(count)
    return result


def message_table(bag: Path, counts: dict[str, dict[str, int]]) -> TextTable:
    """Return the numbers of published, received and recorded messages of each topic.

    :param counts: from :func:`run_nodes`.
    """
    with open_bag(bag) as opened:
        recorded = {info.name.lstrip("/"): info.count for info in opened.topics}
    rows = []
    for topic in TOPICS:
        published = counts["published"].get(topic, 0)
        received = counts["received"].get(topic, counts["taken"].get(topic, 0))
        is_imu = topic == IMU_TOPIC
        t_ns = (read_readings(bag, Choice(topic)) if is_imu else read_states(bag, topic)).t_ns
        rate = (len(t_ns) - 1) * 1e9 / (t_ns[-1] - t_ns[0])
        rows.append(
            [
                topic,
                str(published),
                str(received),
                str(recorded.get(topic, 0)),
                str(published - recorded.get(topic, 0)),
                f"{rate:.3f}",
                "exact" if len(np.unique(np.diff(t_ns))) == 1 else "uneven",
            ]
        )
    header = ["topic", "published", "received", "recorded", "lost", "mean rate [Hz]", "spacing"]
    return TextTable(header, rows, "Messages")


def tracks(parameters: SimulationParameters, bag: Path) -> dict[str, Track]:
    """Return the tracks of Euler and midpoint on the recorded readings, with and without noise."""
    truth = read_states(bag, TRUTH_TOPIC)
    noisy = read_readings(bag, Choice(IMU_TOPIC))
    ideal = Body(parameters, read_states).next(len(noisy.t_ns))[IMU]
    readings = {
        "with noise": noisy.triads(),
        "without noise": (ideal.ideal_gyro, ideal.ideal_accel),
    }
    initial = state_at(truth, int(noisy.t_ns[0]))
    tracks_by_name = {}
    for label, values in readings.items():
        for method in _METHODS:
            states = dead_reckon(
                *(noisy.t_ns, *values, initial, method),
                gravity=gravity_vector(parameters).tolist(),
                mount=mount_of(parameters.imu),
            )
            tracks_by_name[f"{method}, {label}"] = track_of(states, method, "so3", truth)
    return tracks_by_name


def error_table(tracks_by_name: Mapping[str, Track], duration: float) -> TextTable:
    """Return the final errors of the tracks."""
    results = {name: track.to_dict() for name, track in tracks_by_name.items()}
    rows = [
        [
            name,
            f"{result['final_position_error_m']:.4g}",
            f"{100 * result['final_position_error_m'] / max(result['distance_m'], 1e-9):.3g}",
            f"{np.degrees(result['final_attitude_error_rad']):.3g}",
        ]
        for name, result in results.items()
    ]
    distance = next(iter(results.values()))["distance_m"]
    header = ["integration", "position [m]", "of distance [%]", "attitude [deg]"]
    return TextTable(header, rows, f"Error after {duration:g} s and {distance:.1f} m")
