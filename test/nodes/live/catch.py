# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A listener for tests: prints what arrives on topics as JSON lines."""

import json
import signal
import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry, Path
from rclpy.executors import SingleThreadedExecutor

TYPES = {"odom": Odometry, "/diagnostics": DiagnosticArray, "path": Path}


def numbers(message: object, names: str) -> list[float]:
    return [getattr(message, name) for name in names]


def plain(message: object) -> dict:
    if isinstance(message, DiagnosticArray):
        status = message.status[0]
        values = {entry.key: entry.value for entry in status.values}
        return {"message": status.message, "values": values}
    if isinstance(message, Path):
        return {"poses": len(message.poses)}
    if isinstance(message, Vector3Stamped):
        return {"vector": numbers(message.vector, "xyz")}
    return {
        "frames": [message.header.frame_id, message.child_frame_id],
        "position": numbers(message.pose.pose.position, "xyz"),
        "q_wb": numbers(message.pose.pose.orientation, "wxyz"),
        "velocity": numbers(message.twist.twist.linear, "xyz"),
    }


def listen(topics: list[str]) -> None:
    node = rclpy.create_node("catch")
    count = 0
    for topic in topics:
        message_type = TYPES.get(topic.removeprefix("dead_reckoned/"), Vector3Stamped)

        def show(message: object, topic: str = topic) -> None:
            nonlocal count
            count += 1
            stamp = message.header.stamp
            entry = {"topic": topic, "t_ns": stamp.sec * 10**9 + stamp.nanosec, **plain(message)}
            print(json.dumps(entry))

        node.create_subscription(message_type, topic, show, 5000)
    matched: set[str] = set()

    def watch() -> None:
        for topic in topics:
            if topic not in matched and node.get_publishers_info_by_topic(topic):
                matched.add(topic)
                print(f"publisher of {topic}")
        sys.stdout.flush()

    node.create_timer(0.05, watch)
    told: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: told.append(number))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    before = -1
    while not told or before != count:  # what has arrived by the end is taken, too
        before, end = count, time.monotonic() + 0.3
        while time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)


if __name__ == "__main__":
    rclpy.init()
    listen(sys.argv[1:])
