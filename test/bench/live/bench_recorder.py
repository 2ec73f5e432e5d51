# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recording and integrating live: losses and CPU at 2 x 1 kHz and 2 x 2 kHz.

The simulator publishes Imu and Odometry, reliable, and starts when its subscriber is there, so that
every message counts. CPU is that of the whole recording (or integrating) process while messages
flow, of one core, its start not counted; lost is what was published and is not in the bag, or has
no odometry. ``--duration`` is the time of each row.

Next to them stands the least that a Python process can do: a loop that sleeps for 2 ms, takes the
readings that have arrived and publishes the same Odometry for each of them, nothing computed.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from imu_sim_ros.terminal.text_tables import print_table

HERE = Path(__file__).resolve()
RATES = (1000, 2000)
ROWS: tuple[tuple[str, str, str, list[str]], ...] = (
    ("recorder", "mcap", "bag", []),
    ("recorder", "mcap, zstd", "bag", ["--compression", "zstd"]),
    ("recorder", "sqlite3", "bag", ["--storage", "sqlite3"]),
    ("recorder", "ros1", "bag.bag", []),
    ("integrator", "midpoint, covariance", "", []),
    ("integrator", "midpoint", "", ["--covariance", "false"]),
    ("integrator", "rk4, covariance", "", ["--method", "rk4"]),
    ("loop", "same bytes", "", []),
)
_TICKS = os.sysconf("SC_CLK_TCK")
_START = 2.5
_TOPICS = ("/imu/data_raw", "/ground_truth/odom")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--duration", type=float, default=10.0)
    parser.add_argument("--loop", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.loop:
        loop()
        return
    duration = arguments.duration
    rows = []
    for node, label, output, options in ROWS:
        cells = [measure(node, output, options, rate, duration) for rate in RATES]
        rows.append([f"{node}: {label}", *(cell for pair in cells for cell in pair)])
    columns = [(f"lost of {rate} Hz", "CPU %") for rate in RATES]
    header = ["node", *(name for pair in columns for name in pair)]
    print_table(header, rows, f"Imu and Odometry for {duration:g} s each")


def measure(
    node: str, output: str, options: list[str], rate: int, duration: float
) -> tuple[str, str]:
    """Run one node with the simulator; return the messages lost and the processor time [%]."""
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / output
        recording = node == "recorder"
        arguments = ["-o", str(bag), *_TOPICS] if recording else []
        subject = start(node, [*arguments, *options], folder)
        time.sleep(_START)
        cpu_start = cpu(subject.pid)
        published = simulate(rate, duration, folder, both=recording)
        time.sleep(0.5)
        used = cpu(subject.pid) - cpu_start
        subject.send_signal(signal.SIGINT)
        program_output = subject.communicate()[0]
        got = (
            stored(program_output, _TOPICS)
            if recording
            else published_count(program_output, "dead_reckoned/odom")
        )
    return str(published - got), f"{100.0 * used / duration:.1f}"


def loop() -> None:
    """Sleep, take messages and publish, until a signal comes."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.qos import QoSProfile
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import Imu

    from imu_sim_ros.nodes.fast_dds import set_profile

    folder = tempfile.TemporaryDirectory()
    set_profile(Path(folder.name))
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    node = rclpy.create_node("loop")
    depth = QoSProfile(depth=2000)
    take = node.create_subscription(Imu, "imu/data_raw", print, depth, raw=True).handle.take_message
    publish = node.create_publisher(Odometry, "dead_reckoned/odom", depth).handle.publish_raw
    content, count, ended = serialize_message(Odometry()), 0, threading.Event()
    signal.signal(signal.SIGINT, lambda *_: ended.set())
    while not ended.is_set():
        time.sleep(0.002)
        while take(Imu, True) is not None:
            publish(content)
            count += 1
    print(f"loop: published {count} messages on dead_reckoned/odom", flush=True)
    rclpy.try_shutdown()


def start(node: str, arguments: list[str], folder: str) -> subprocess.Popen[str]:
    """Start a node on a domain of its own."""
    module = ["-m", f"imu_sim_ros.nodes.{node}.node"]
    program = [str(HERE), "--loop"] if node == "loop" else module
    return subprocess.Popen(
        [sys.executable, *program, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=folder,
        env={**os.environ, "ROS_DOMAIN_ID": "97", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
    )


def simulate(rate: int, duration: float, folder: str, both: bool) -> int:
    """Run the simulator and return how many messages it published for the node."""
    truth = ["--wait_for_truth_subscribers", "1"] if both else []
    arguments = ["--rate", str(rate), "--duration", str(duration), "--imu", "adis16448"]
    simulator = start("simulator", [*arguments, "--wait_for_subscribers", "1", *truth], folder)
    program_output = simulator.communicate()[0]
    topics = _TOPICS if both else _TOPICS[:1]
    return sum(published_count(program_output, topic[1:]) for topic in topics)


def published_count(program_output: str, topic: str) -> int:
    """Return what a node said it published on a topic."""
    lines = [line.split() for line in program_output.splitlines()]
    sent = [line for line in lines if line[1:2] == ["published"] and line[5:] == [topic]]
    return int(sent[0][2]) if sent else 0


def stored(program_output: str, topics: tuple[str, ...]) -> int:
    """Return what the recorder said it recorded of topics."""
    rows = [line.split() for line in program_output.splitlines()]
    return sum(int(row[1]) for row in rows if row and row[0] in topics)


def cpu(pid: int) -> float:
    """Return the processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


if __name__ == "__main__":
    main()
