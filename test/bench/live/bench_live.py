# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Live publishing: rate, loss, lateness and CPU of the simulator and of simpler publishers.

Every row is two processes: the publisher, and a subscriber that takes the bytes of both topics,
reliable, without decoding. CPU is that of the whole publishing process, of one core, over
``--duration`` seconds after a warm-up; counts are those of both together. The lateness is that of
the publishing call behind its deadline, said by the publisher itself.

Next to it stand, over a third of the time, what a simple node does (an rclpy timer and message
objects) and the least that a Python process can do on this machine: a loop that sleeps and
publishes the same bytes again and again, with nothing computed and with the simulator's profile of
Fast DDS.
"""

import argparse
import itertools
import os
import re
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from process_time import cpu_seconds

from imu_sim_ros.terminal.text_tables import print_table

if TYPE_CHECKING:
    from rclpy.publisher import Publisher

HERE = Path(__file__).resolve()
RATES = (200, 400, 1000, 2000, 8000)
_TITLES = {
    "simulator": "simulator, {}",
    "timer": "rclpy timer, objects",
    "loop": "bare loop, same bytes",
}
_WARM_UP = 5.0


def subscribe(seconds: float) -> None:
    """Count what arrives; print per topic the messages, and those that the stamps miss."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    rclpy.init()
    node = rclpy.create_node("listener")
    stamps: dict[str, list[bytes]] = {"imu/data_raw": [], "ground_truth/odom": []}

    def keep(headers: list[bytes], data: bytes) -> None:
        headers.append(data[4:12])

    for topic, kind in (("imu/data_raw", Imu), ("ground_truth/odom", Odometry)):
        keeping = partial(keep, stamps[topic])
        node.create_subscription(kind, topic, keeping, QoSProfile(depth=8000), raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    end = time.monotonic() + seconds
    try:
        while time.monotonic() < end:
            executor.spin_once(timeout_sec=0.2)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass
    for topic, headers in stamps.items():
        times = [s * 10**9 + ns for s, ns in (struct.unpack("<iI", data) for data in headers)]
        steps = [b - a for a, b in itertools.pairwise(times)]
        usual = statistics.median_low(steps) if steps else 1
        lost = sum(round(step / usual) - 1 for step in steps)
        print(f"listener: {topic} {len(times)} lost {lost}", flush=True)
    rclpy.try_shutdown()


def wait_for_subscribers(*publishers: "Publisher") -> None:
    """Wait until each publisher has a subscriber that knows of it."""
    while not all(publisher.get_subscription_count() for publisher in publishers):
        time.sleep(0.01)
    time.sleep(0.3)


def timer(rate: float, duration: float) -> None:
    """Publish message objects from an rclpy timer: what a simple node does."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    rclpy.init()
    node = rclpy.create_node("timer")
    imu = node.create_publisher(Imu, "imu/data_raw", QoSProfile(depth=4000))
    odometry = node.create_publisher(Odometry, "ground_truth/odom", QoSProfile(depth=4000))
    count = 0

    def tick() -> None:
        nonlocal count
        stamp = node.get_clock().now().to_msg()
        reading, truth = Imu(), Odometry()
        reading.header.stamp = truth.header.stamp = stamp
        reading.header.frame_id, truth.header.frame_id = "imu_link", "world"
        reading.angular_velocity.z, reading.linear_acceleration.z = 0.1, 9.81
        truth.pose.pose.position.x, truth.twist.twist.linear.x = 1.0, 2.0
        imu.publish(reading)
        odometry.publish(truth)
        count += 1

    wait_for_subscribers(imu, odometry)
    node.create_timer(1.0 / rate, tick)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    end = time.monotonic() + duration
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    print(f"simulator: published {count} messages on imu/data_raw", flush=True)
    rclpy.try_shutdown()


def loop(rate: float, duration: float) -> None:
    """Sleep until the next absolute deadline, publish the same bytes, and again."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.qos import QoSProfile
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import Imu

    from imu_sim_ros.nodes.fast_dds import set_profile

    folder = tempfile.TemporaryDirectory()
    set_profile(Path(folder.name))
    rclpy.init()
    node = rclpy.create_node("loop")
    imu = node.create_publisher(Imu, "imu/data_raw", QoSProfile(depth=4000))
    odometry = node.create_publisher(Odometry, "ground_truth/odom", QoSProfile(depth=4000))
    reading, truth = bytearray(serialize_message(Imu())), bytearray(serialize_message(Odometry()))
    wait_for_subscribers(imu, odometry)
    count, start = round(rate * duration), time.monotonic_ns()
    for k in range(count):
        due = round(k * 1e9 / rate)
        delay = start + due - time.monotonic_ns()
        if delay > 0:
            time.sleep(delay * 1e-9)
        reading[4:12] = truth[4:12] = struct.pack("<iI", *divmod(due, 10**9))
        imu.publish(bytes(reading))
        odometry.publish(bytes(truth))
    print(f"simulator: published {count} messages on imu/data_raw", flush=True)
    time.sleep(0.5)
    rclpy.try_shutdown()


def command(publisher: str, rate: int, seconds: float, preset: str) -> list[str]:
    """Return the command line of a publisher."""
    if publisher != "simulator":
        return [sys.executable, str(HERE), f"--{publisher}", str(rate), "--duration", str(seconds)]
    return [
        *(sys.executable, "-m", "imu_sim_ros.nodes.simulator.node", "--imu", preset),
        *("--rate", str(rate), "--duration", str(seconds), "--wait-for-subscribers", "1"),
    ]


def measure(publisher: str, rate: int, duration: float, preset: str) -> list[str]:
    """Run one row."""
    seconds = _WARM_UP + duration
    listener = subprocess.Popen(
        [sys.executable, str(HERE), "--listen", str(seconds + 30.0)],
        stdout=subprocess.PIPE,
        text=True,
    )
    time.sleep(1.5)
    process = subprocess.Popen(
        command(publisher, rate, seconds, preset),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    time.sleep(_WARM_UP)
    cpu_start, start = cpu_seconds(process.pid), time.monotonic()
    time.sleep(duration - 0.5)  # the last message is still to come then
    cpu = (cpu_seconds(process.pid) - cpu_start) / (time.monotonic() - start)
    output = process.communicate()[0]
    time.sleep(1.0)
    listener.send_signal(signal.SIGINT)
    heard = listener.communicate()[0]
    published = int(re.findall(r"published (\d+) messages on imu/data_raw", output)[0])
    lateness = re.search(r"p50 (\d+) us, p99 (\d+) us, max (\d+) us", output)
    received = [int(n) for n in re.findall(r"listener: \S+ (\d+) lost", heard)]
    return [
        _TITLES[publisher].format(preset),
        str(rate),
        str(published),
        f"{published / seconds:.2f}",
        " ".join(str(published - n) for n in received),
        f"{100.0 * cpu:.1f}",
        *(lateness.groups() if lateness else ("", "", "")),
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=60.0, help="seconds of each row")
    parser.add_argument("--rates", type=int, nargs="*", default=RATES)
    parser.add_argument("--imu", default="mpu6000", help="preset")
    parser.add_argument("--listen", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--timer", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--loop", type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.listen:
        subscribe(arguments.listen)
        return
    if arguments.timer:
        timer(arguments.timer, arguments.duration)
        return
    if arguments.loop:
        loop(arguments.loop, arguments.duration)
        return
    os.environ.setdefault("ROS_DOMAIN_ID", "97")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ["PYTHONPATH"] = str(HERE.parents[3])
    rows = []
    for publisher, rates, duration in (
        ("simulator", arguments.rates, arguments.duration),
        ("timer", [1000], arguments.duration / 3),
        ("loop", [r for r in arguments.rates if r <= 2000], arguments.duration / 3),
    ):
        rows += [measure(publisher, rate, duration, arguments.imu) for rate in rates]
    print_table(
        [
            "publisher",
            "asked [Hz]",
            "published",
            "mean [Hz]",
            "not received",
            "CPU [%]",
            "late p50 [us]",
            "p99 [us]",
            "max [us]",
        ],
        rows,
        f"Imu + Odometry, reliable, {arguments.duration:g} s each after {_WARM_UP:g} s",
    )


if __name__ == "__main__":
    main()
