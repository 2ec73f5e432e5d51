# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hostile messages on the topics of a real integrator and recorder.

``python live.py`` publishes the messages of each case number that comes in, and answers with the
number of odometries that came out until then, and of those that are not finite.
"""

import math
import random
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Final

sys.path.insert(0, str(Path(__file__).parent))
import calls
import processes

_MESSAGES: Final = 40
_SETTLED_S: Final = 0.05


def feed() -> None:
    """Publish what the numbers on standard input stand for; answer each in a line."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    rclpy.init()
    node = rclpy.create_node("feed")
    qos = QoSProfile(depth=5000)
    came = [0, 0]

    def check(message: Any) -> None:
        p, q, v = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
        values = [p.x, p.y, p.z, q.w, q.x, q.y, q.z, v.linear.x, v.linear.y, v.linear.z,
                  v.angular.x, v.angular.y, v.angular.z, *message.pose.covariance,
                  *message.twist.covariance]  # fmt: skip
        came[0] += 1
        came[1] += not all(map(math.isfinite, values))

    node.create_subscription(Odometry, "dead_reckoned/odom", check, qos)
    outputs = [
        node.create_publisher(Imu, "imu/data_raw", qos),
        node.create_publisher(Odometry, "ground_truth/odom", qos),
    ]
    end = time.monotonic() + 60.0
    while min(output.get_subscription_count() for output in outputs) < 2:
        assert time.monotonic() < end, "neither integrator nor recorder came"
        rclpy.spin_once(node, timeout_sec=0.05)
    k = 0
    for line in sys.stdin:
        dice = random.Random(int(line))
        for _ in range(_MESSAGES):
            is_truth = dice.random() < 0.4
            outputs[is_truth].publish(calls._payload(dice, is_truth, k))
            k += 1
        end = time.monotonic() + _SETTLED_S
        while time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.01)
        print(*came, flush=True)
    rclpy.shutdown()


class Live:
    """A running integrator and recorder, and what publishes to them; they have to survive it."""

    def __init__(self, place: Path) -> None:
        self.domain, self.place = processes.Domain(), place
        environment = {"env": {**processes.os.environ, **self.domain.environment()}}
        self._errors = (place / "nodes.txt").open("w+")
        quiet = {
            "stdin": subprocess.DEVNULL,
            "stdout": self._errors,
            "stderr": self._errors,
            "preexec_fn": processes.bound,
        }
        self._nodes = [
            subprocess.Popen([*processes._start_of(name), *arguments], **quiet, **environment)
            for name, arguments in (
                ("integrator", ["--initial_state", "truth"]),
                ("recorder", ["-o", str(place / "live.mcap"), "--topics", "[imu/data_raw, "
                              "ground_truth/odom, dead_reckoned/odom]"]),
            )
        ]  # fmt: skip
        self._feed = subprocess.Popen(
            [sys.executable, __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            preexec_fn=processes.bound,
            **environment,
        )

    def case(self, number: int) -> tuple[list[str], str]:
        """Publish a case; return what is wrong with how it went, and what the nodes said."""
        self._feed.stdin.write(f"{number}\n")
        self._feed.stdin.flush()
        answer = self._feed.stdout.readline().split()
        text = (self.place / "nodes.txt").read_text()
        faults = {
            "lost": any(node.poll() is not None for node in self._nodes) or len(answer) != 2,
            "not finite": len(answer) == 2 and answer[1] != "0",
            "traceback": "Traceback" in text,
        }
        return [name for name, present in faults.items() if present], text

    def end(self) -> list[int]:
        """End all of them; returns the nodes' statuses, and 0 for a whole bag."""
        self._feed.stdin.close()
        self._feed.wait(60)
        statuses = []
        for node in self._nodes:
            node.terminate()
            statuses.append(node.wait(60))
        from imu_sim_ros.bags.read import open_bag

        with open_bag(self.place / "live.mcap") as bag:
            counts = [topic.count for topic in bag.topics]
        return [*statuses, 0 if all(counts) else 1]


if __name__ == "__main__":
    feed()
