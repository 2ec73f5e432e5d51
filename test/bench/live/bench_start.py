# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time from the start of a process to the first message: the simulator's, and a plain node's.

Each of ``--starts`` times one process is started while the other one runs, at another moment of the
other's period of announcements each time. The listener is rclpy's with nothing changed; the plain
publisher, too.
"""

import argparse
import os
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from imu_sim_ros.terminal.text_tables import print_table

HERE = Path(__file__).resolve()
PUBLISHERS = {
    "simulator": [sys.executable, "-m", "imu_sim_ros.nodes.simulator.node", "--imu", "mpu6000"],
    "rclpy publisher": [sys.executable, str(HERE), "--publish"],
}
_TOPIC = "imu/data_raw"


class Listener:
    """Takes the time of the first message."""

    def __init__(self) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from sensor_msgs.msg import Imu

        rclpy.init()
        self._node = rclpy.create_node("listener")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._arrived: list[float] = []
        self._node.create_subscription(
            Imu, _TOPIC, lambda _: self._arrived.append(time.monotonic()), 10, raw=True
        )

    def rest(self, seconds: float) -> None:
        """Receive for some seconds, and forget the messages."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.05)
        self._arrived.clear()

    def first_arrival(self) -> float:
        """Return when the first message came [s of the steady clock]."""
        while not self._arrived:
            self._executor.spin_once(timeout_sec=0.05)
        return self._arrived[0]


def publish() -> None:
    """Publish 200 messages a second, as a plain node does."""
    import rclpy
    from sensor_msgs.msg import Imu

    rclpy.init()
    node = rclpy.create_node("publisher")
    publisher = node.create_publisher(Imu, _TOPIC, 10)
    while rclpy.ok():
        publisher.publish(Imu())
        time.sleep(0.005)


def pauses(starts: int) -> Iterator[float]:
    """Yield pauses that fall on all moments of a period of 3 s."""
    return (1.0 + 3.0 * (0.618 * k % 1.0) for k in range(starts))


def launched(publisher: str) -> subprocess.Popen[bytes]:
    """Start a publisher."""
    quiet = subprocess.DEVNULL
    return subprocess.Popen(PUBLISHERS[publisher], stdout=quiet, stderr=quiet)


def starts_of(publisher: str, starts: int) -> list[float]:
    """Start a publisher again and again while a listener runs; return seconds to the message."""
    import rclpy

    listener = Listener()
    times = []
    for pause in pauses(starts):
        listener.rest(pause)
        start = time.monotonic()
        process = launched(publisher)
        times.append(listener.first_arrival() - start)
        process.send_signal(signal.SIGINT)
        process.wait()
    rclpy.try_shutdown()
    return times


def starts_of_a_listener(publisher: str, starts: int) -> list[float]:
    """Start a listener again and again while a publisher runs; return seconds to the message."""
    process = launched(publisher)
    times = []
    for pause in pauses(starts):
        time.sleep(pause)
        start = time.monotonic()
        listener = subprocess.run(
            [sys.executable, str(HERE), "--listen"], capture_output=True, text=True, check=True
        )
        times.append(float(listener.stdout) - start)
    process.send_signal(signal.SIGINT)
    process.wait()
    return times


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--publish", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--listen", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.publish:
        publish()
        return
    if arguments.listen:
        print(Listener().first_arrival())
        return
    os.environ.setdefault("ROS_DOMAIN_ID", "98")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ["PYTHONPATH"] = str(HERE.parents[3])
    rows = []
    for publisher in PUBLISHERS:
        for started, running, measure in (
            (publisher, "listener", starts_of),
            ("listener", publisher, starts_of_a_listener),
        ):
            times = measure(publisher, arguments.starts)
            numbers = (statistics.median(times), max(times))
            slow = sum(t >= 1.0 for t in times)
            rows.append([started, running, *(f"{number:.2f}" for number in numbers), str(slow)])
    print_table(
        ["is started", "runs already", "median [s]", "longest [s]", "1 s or more"],
        rows,
        f"From the start of a process to the first message, {arguments.starts} starts each",
    )


if __name__ == "__main__":
    main()
