# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ten minutes at 1 kHz while subscribers come and go: memory, and stamps against the steady clock.

``--duration`` is the time of the run. The memory is that of the simulator's process; what it grows
after the first minute (or tenth of the run) is reported. The drift is the change of the distance
between a sample's stamp and the steady clock at its arrival, medians over the first and the last
tenth of all arrivals.
"""

import argparse
import os
import re
import signal
import statistics
import struct
import subprocess
import sys
import time
from pathlib import Path

from imu_sim_ros.terminal.text_tables import print_table

HERE = Path(__file__).resolve()
LISTENER = HERE.with_name("bench_live.py")
RATE = 1000
_SAMPLING = 1.0
_PAGE = os.sysconf("SC_PAGE_SIZE")


def resident(pid: int) -> int:
    """Return the memory that a process occupies [bytes]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * _PAGE


def drift_ns(distances: list[int]) -> float:
    """Return how much the distance between stamps and clock changes from begin to end."""
    tenth = max(len(distances) // 10, 1)
    return statistics.median(distances[-tenth:]) - statistics.median(distances[:tenth])


class Guest:
    """A second subscriber that comes and goes."""

    def __init__(self, duration: float) -> None:
        self._command = [sys.executable, str(LISTENER), "--listen", str(duration)]
        self._period = duration / 20.0
        self._next = time.monotonic()
        self._process: subprocess.Popen[bytes] | None = None

    def look(self, time_s: float) -> None:
        """Start or end the process if its next time has come."""
        if time_s < self._next:
            return
        self._next = time_s + self._period
        if self._process is None:
            quiet = subprocess.DEVNULL
            self._process = subprocess.Popen(self._command, stdout=quiet, stderr=quiet)
        else:
            self.end()

    def end(self) -> None:
        """End the process if it runs."""
        if self._process is not None:
            self._process.send_signal(signal.SIGINT)
            self._process.wait()
            self._process = None


def soaked(duration: float) -> tuple[str, list[int], list[int]]:
    """Return the simulator's output, the delays [ns] of all messages, and its memory [bytes]."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    rclpy.init()
    node = rclpy.create_node("soak")
    arrivals: list[int] = []

    def keep(data: bytes) -> None:
        second, nanosecond = struct.unpack_from("<iI", data, 4)
        arrivals.append(time.monotonic_ns() - (second * 10**9 + nanosecond))

    node.create_subscription(Imu, "imu/data_raw", keep, QoSProfile(depth=8000), raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    command = [sys.executable, "-m", "imu_sim_ros.nodes.simulator.node", "--rate", str(RATE)]
    command += ["--duration", str(duration), "--wait-for-subscribers", "1"]
    simulator = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    guest, memory, next_look = Guest(duration), [], time.monotonic()
    while simulator.poll() is None:
        executor.spin_once(timeout_sec=0.1)
        clock = time.monotonic()
        if clock >= next_look and arrivals:
            next_look = clock + _SAMPLING
            memory.append(resident(simulator.pid))
        guest.look(clock)
    for _ in range(20):
        executor.spin_once(timeout_sec=0.05)
    guest.end()
    output = simulator.communicate()[0]
    rclpy.try_shutdown()
    return output, arrivals, memory


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=120.0, help="seconds")
    duration = parser.parse_args().duration
    os.environ.setdefault("ROS_DOMAIN_ID", "96")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ["PYTHONPATH"] = str(HERE.parents[3])
    output, arrivals, memory = soaked(duration)
    settled = min(60, len(memory) // 10)
    published = int(re.findall(r"published (\d+) messages on imu/data_raw", output)[0])
    print_table(
        ["simulated", "published", "not received", "memory", "growth", "drift of the stamps"],
        [
            [
                f"{duration:g} s at {RATE} Hz",
                str(published),
                str(published - len(arrivals)),
                f"{memory[settled] / 1e6:.1f} MB",
                f"{(memory[-2] - memory[settled]) / 1e3:.0f} kB",
                f"{drift_ns(arrivals) * 1e-3:.0f} us",
            ]
        ],
        f"growth after the first {settled * _SAMPLING:g} s",
    )


if __name__ == "__main__":
    main()
