# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``make demo``: run the three nodes as separate processes, and count their messages.

The simulator flies a trajectory, the integrator dead-reckons its readings, the recorder writes all
of it into a bag. The numbers printed afterwards come from the bag and from the nodes.
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Final, NamedTuple

import numpy as np

from imu_sim_ros import program
from imu_sim_ros.bags.read import open_bag, read_imu, read_odometry, read_poses
from imu_sim_ros.commands.outputs import add_force, outputs
from imu_sim_ros.conventions import DEAD_RECKONED_TOPIC, IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.errors import MachineError
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.evaluation import Drift, Truth, drift_from
from imu_sim_ros.navigation.state import NavigationStates
from imu_sim_ros.parameters import files
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.rotation import rotate
from imu_sim_ros.simulation.engine import Simulation
from imu_sim_ros.simulation.parameters import SimulationParameters, load_simulation
from imu_sim_ros.trajectory.parameters import trajectory_layer

METHODS = ("euler", "midpoint")
_PICTURE = "trajectory.png"
_START_TIMEOUT = 30.0
_END_TIMEOUT = 10.0


class Paths(NamedTuple):
    """What one way of integrating made of one stream of readings."""

    states: NavigationStates
    drift: Drift


EXAMPLES: Final = """
make demo
python -m imu_sim_ros.commands.demo --imu mpu6000 --duration 10s -o flight --force
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="demo", description=__doc__, examples=EXAMPLES)
    choices: dict[str, tuple[object, Callable[[str], object], str, str]] = {
        "trajectory": ("lecture", str, "NAME|FILE", "the motion"),
        "imu": ("lecture", str, "NAME|FILE", "the sensor"),
        "rate": (200.0, float, "HZ", "samples per second"),
        "duration": (20.0, program.duration, "TIME", "length of the flight [s]"),
    }
    for name, (default, kind, metavar, words) in choices.items():
        help_text = f"{words}; default %(default)s"
        result.add_argument(
            f"--{name}", default=default, type=kind, metavar=metavar, help=help_text
        )
    result.add_argument(
        "-o",
        "--output",
        default=Path("demo_output"),
        type=Path,
        metavar="FOLDER",
        help="for the bag and the picture; default %(default)s",
    )
    add_force(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demonstration; returns its exit status."""
    return program.main(parser, run, argv)


def run(arguments: argparse.Namespace) -> None:
    """Simulate, integrate and record live; then compare, print and draw."""
    layers = {
        "imu.preset": arguments.imu,
        **trajectory_layer(arguments.trajectory),
        "rate": arguments.rate,
        "duration": arguments.duration,
    }
    parameters = load_simulation(layers)
    Simulation(parameters, read_poses)  # a file that cannot be flown is refused before the start
    written = outputs(arguments)
    folder = written.add(arguments.output)
    with written:
        folder.mkdir()
        _demonstrate(parameters, arguments, folder)
    print(f"bag:     {arguments.output / 'bag'}\npicture: {arguments.output / _PICTURE}")


def _demonstrate(
    parameters: SimulationParameters, arguments: argparse.Namespace, folder: Path
) -> None:
    """Fly and record into a folder; then print and draw."""
    bag = folder / "bag"
    print(
        f"simulator, integrator and recorder run for {parameters.duration:g} s "
        f"at {parameters.rate:g} Hz: IMU {arguments.imu}, trajectory {arguments.trajectory}",
        flush=True,
    )
    counts = _fly(parameters, folder, bag)
    _print_counts(bag, counts)
    title = (
        f"Dead reckoning against the truth: sensor {arguments.imu}, "
        f"trajectory {arguments.trajectory}, {parameters.rate:g} Hz, {parameters.duration:g} s"
    )
    _print_errors(parameters, folder, bag, title)


def _fly(parameters: SimulationParameters, folder: Path, bag: Path) -> dict[str, dict[str, int]]:
    """Run the nodes until the simulator is done; return the numbers in their closing lines."""
    file = folder / "simulation.yaml"
    files.dump(parameters, file, comment="The simulated flight.")
    with ExitStack() as stack:
        log = stack.enter_context((folder / "nodes.log").open("w+", encoding="utf-8"))
        topics = f"[{IMU_TOPIC}, {TRUTH_TOPIC}, {DEAD_RECKONED_TOPIC}]"
        recorder = _start(log, "recorder", "-p", f"output:={bag}", "-p", f"topics:={topics}")
        integrator = _start(log, "integrator", "-p", "initial_state:=truth", "-p", "error:=true")
        simulator = _start(
            log,
            "simulator",
            *("--params-file", str(file)),
            *("-p", "wait_for_subscribers:=2", "-p", "wait_for_truth_subscribers:=2"),
        )
        nodes = {"recorder": recorder, "integrator": integrator, "simulator": simulator}
        try:
            _wait(nodes, parameters.duration)
            time.sleep(0.5)  # the last readings are on their way to the integrator and back
            _end(integrator)
            _end(recorder)
        finally:
            for process in nodes.values():
                process.kill()
        for name, process in nodes.items():
            if process.returncode != 0:
                log.seek(0)
                last = log.read().strip().rpartition("\n")[2]
                raise MachineError(f"{name} ended with status {process.returncode}: {last}")
        log.seek(0)
        return _counts(log.read())


def _start(log: IO[str], name: str, *arguments: str) -> "subprocess.Popen[str]":
    """Start a node that no other machine, and no other user's node, can see."""
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }
    command = [sys.executable, "-m", f"imu_sim_ros.nodes.{name}.node", "--ros-args", *arguments]
    return subprocess.Popen(command, stdout=log, stderr=log, env=environment, text=True)


def _wait(nodes: dict[str, "subprocess.Popen[str]"], duration: float) -> None:
    """Wait for the simulator's end, with a bar; another node's end is a failure."""
    steps = 10
    begin = time.monotonic()
    with program.progress("flying", round(duration * steps)) as advance:
        while nodes["simulator"].poll() is None:
            time.sleep(1.0 / steps)
            advance(1)
            ended = [name for name, process in nodes.items() if process.poll() not in (None, 0)]
            if ended or time.monotonic() - begin > duration + _START_TIMEOUT:
                return


def _end(process: "subprocess.Popen[str]") -> None:
    process.send_signal(signal.SIGINT)
    try:
        process.wait(_END_TIMEOUT)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _counts(log: str) -> dict[str, dict[str, int]]:
    """Return what the nodes' closing lines say they ``published`` and ``received``.

    The closing table of the recorder has the number of messages ``taken`` from the network.
    """
    result: dict[str, dict[str, int]] = {"published": {}, "received": {}, "taken": {}}
    line = re.compile(r"^\w+: (published|received) (\d+) messages on (\S+)$", re.M)
    for verb, count, topic in line.findall(log):
        result[verb][topic.lstrip("/")] = int(count)
    for topic, count in re.findall(r"^ +(/\S+) +(\d+) ", log, re.M):
        result["taken"][topic.lstrip("/")] = int(count)
    return result


def _print_counts(bag: Path, counts: dict[str, dict[str, int]]) -> None:
    """Print the numbers of published, received and recorded messages of each topic."""
    with open_bag(bag) as opened:
        recorded = {info.name.lstrip("/"): info.count for info in opened.topics}
    rows = []
    for topic in (IMU_TOPIC, TRUTH_TOPIC, DEAD_RECKONED_TOPIC):
        published = counts["published"].get(topic, 0)
        received = counts["received"].get(topic, counts["taken"].get(topic, 0))
        t_ns = (read_imu if topic == IMU_TOPIC else read_odometry)(bag, f"/{topic}").t_ns
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
    program.print_table(header, rows, "Messages")


def _print_errors(parameters: SimulationParameters, folder: Path, bag: Path, title: str) -> None:
    """Print and draw the errors of Euler and midpoint, with and without noise."""
    odometry = read_odometry(bag, f"/{TRUTH_TOPIC}")
    truth = Truth(
        PoseSequence(odometry.t_ns, odometry.position, odometry.q_wb),
        rotate(odometry.q_wb, odometry.velocity_b),
    )
    noisy = read_imu(bag, f"/{IMU_TOPIC}")
    ideal = next(Simulation(parameters, read_poses).blocks(len(noisy.t_ns)))
    readings = {
        "with noise": (noisy.gyro, noisy.accel),
        "without noise": (ideal.ideal_gyro, ideal.ideal_accel),
    }
    initial, results = truth.at(int(noisy.t_ns[0])), {}
    for label, (gyro, accel) in readings.items():
        for method in METHODS:
            states = dead_reckon(
                noisy.t_ns, gyro, accel, initial, method, gravity=parameters.gravity
            )
            results[f"{method}, {label}"] = Paths(states, drift_from(states, truth))
    rows = [
        [
            name,
            f"{result.drift.final('position'):.4g}",
            f"{100 * result.drift.final('position') / max(result.drift.distance, 1e-9):.3g}",
            f"{np.degrees(result.drift.final('attitude')):.3g}",
        ]
        for name, result in results.items()
    ]
    program.print_table(
        ["integration", "position [m]", "of distance [%]", "attitude [deg]"],
        rows,
        f"Error after {parameters.duration:g} s and {result_distance(results):.1f} m",
    )
    _draw(folder / _PICTURE, results, truth, title)


def result_distance(results: dict[str, Paths]) -> float:
    """Return the length of the true path [m]."""
    return next(iter(results.values())).drift.distance


def _draw(picture: Path, results: dict[str, Paths], truth: Truth, title: str) -> None:
    from imu_sim_ros.plots import navigation, style

    errors = {
        kind: {
            name: (
                (result.drift.t_ns - result.drift.t_ns[0]) * 1e-9,
                np.linalg.norm(getattr(result.drift, kind), axis=1),
            )
            for name, result in results.items()
        }
        for kind in ("position", "attitude")
    }
    paths = {name: result.states.position for name, result in results.items()}
    figure = navigation.trajectories(
        paths, truth.poses.position, errors["position"], errors["attitude"], title
    )
    style.save(figure, picture)


if __name__ == "__main__":
    sys.exit(main())
