# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cost of sensors other than the IMU live: processor time of the simulator with and without them.

All variants run at the same time, each with a subscriber to all of its topics in a domain of its
own, so that whatever else the machine does slows all of them alike: the differences within a run
mean something on a busy machine, the numbers themselves little. The first variant publishes Imu and
Odometry; the others magnetic field (100 Hz), pressure (50 Hz) and an orientation as well.
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

from process_time import cpu_seconds

from imu_sim_ros.terminal.text_tables import print_table

HERE = Path(__file__).resolve()
_WARM_UP = 5.0
"""[s] After the first messages: what a process imports when it starts is not meant."""
_TAIL = 10.0
"""[s] Of a round that are not measured: the simulators end in them."""
_DOMAIN = 90
ALL = [
    *("--publish.magnetic_field", "true", "--publish.pressure", "true"),
    *("--publish.orientation", "true", "--imu.barometer_preset", "bmp280"),
]
MODEL = [
    *("--imu.orientation_turn_on_sigma", "0.01", "--imu.orientation_drift_sigma", "0.01"),
    *("--imu.orientation_noise", "0.01", "--imu.orientation_acceleration_sensitivity", "0.002"),
]
VARIANTS = {
    "Imu and Odometry": [],
    "all, orientation modelled": [*ALL, *MODEL],
    "all, orientation of the filter": [*ALL, "--imu.orientation_source", "filter"],
}


def subscribe() -> None:
    """Take the bytes of all topics; print how many came."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import FluidPressure, Imu, MagneticField

    rclpy.init()
    node = rclpy.create_node("listener")
    counts: dict[str, int] = {}

    def count(topic: str, _: bytes) -> None:
        if not counts:
            print("receiving", flush=True)
        counts[topic] = counts.get(topic, 0) + 1

    for topic, kind in (
        ("imu/data_raw", Imu),
        ("ground_truth/odom", Odometry),
        ("imu/data", Imu),
        ("imu/mag", MagneticField),
        ("imu/pressure", FluidPressure),
    ):
        depth = QoSProfile(depth=1000)
        node.create_subscription(kind, topic, partial(count, topic), depth, raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while rclpy.ok():
            executor.spin_once(timeout_sec=0.2)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    print("received", sum(counts.values()), flush=True)
    rclpy.try_shutdown()


def start(variant: str, rate: int, seconds: float, domain: int) -> list[subprocess.Popen[str]]:
    """Start a listener and a simulator."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    simulator = [
        *(sys.executable, "-m", "imu_sim_ros.nodes.simulator.node", "--imu", "mpu9250"),
        *("--trajectory", "figure_eight", "--rate", str(rate), "--duration", str(seconds)),
        *("--wait-for-subscribers", "1", *VARIANTS[variant]),
    ]
    return [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True, stderr=-3)
        for command in ([sys.executable, str(HERE), "--listen"], simulator)
    ]


def measure(rate: int, duration: float) -> list[list[str]]:
    """Run all variants at the same time."""
    seconds = _WARM_UP + duration
    pairs = [start(v, rate, seconds, _DOMAIN + k) for k, v in enumerate(VARIANTS)]
    for listener, _ in pairs:
        assert listener.stdout is not None
        listener.stdout.readline()
    time.sleep(_WARM_UP)
    cpu_start = [cpu_seconds(simulator.pid) for _, simulator in pairs]
    begin = time.monotonic()
    time.sleep(duration - _TAIL)
    cpu_end = [cpu_seconds(simulator.pid) for _, simulator in pairs]
    passed = time.monotonic() - begin
    percent = [100.0 * (b - a) / passed for a, b in zip(cpu_start, cpu_end, strict=True)]
    rows = []
    for variant, cpu, (listener, simulator) in zip(VARIANTS, percent, pairs, strict=True):
        output = simulator.communicate()[0]
        time.sleep(0.5)
        listener.send_signal(signal.SIGINT)
        received = int(re.findall(r"received (\d+)", listener.communicate()[0])[0])
        sent = sum(int(n) for n in re.findall(r"published (\d+) messages", output))
        extra = cpu - percent[0]
        rows.append([variant, f"{cpu:.2f}", f"{extra:.2f}", f"{cpu / percent[0]:.2f}"])
        rows[-1] += [str(sent), str(sent - received)]
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=60.0, help="seconds of each round")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--rate", type=int, default=200)
    parser.add_argument("--listen", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if not arguments.duration > _TAIL:
        parser.error(f"--duration {arguments.duration:g}: must be above {_TAIL:g} s")
    if arguments.listen:
        subscribe()
        return
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["PYTHONPATH"] = str(HERE.parents[3])
    for _ in range(arguments.rounds):
        print_table(
            ["published", "CPU [%]", "more", "times", "messages", "not received"],
            measure(arguments.rate, arguments.duration),
            f"{arguments.rate} Hz, reliable, {arguments.duration:g} s after {_WARM_UP:g} s",
        )


if __name__ == "__main__":
    main()
