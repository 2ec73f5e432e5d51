# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A driver for tests: publishes readings (and the truth) as told by one JSON argument.

``rate`` [Hz], ``count``, ``first_ns`` stamp of the first, ``skip`` and ``repeat`` indices, ``wait``
for so many subscribers of each topic, ``best_effort``, ``latched``, ``topics`` (imu, truth, plain),
``accel``, ``hold`` [s] before the end, ``unstamped``: all stamps are zero, ``spoil``: triples of a
message's index, what is spoilt in it (stamp, gyro, accel, position, q_wb) and the value,
``truths``: number of true states, after which there are readings alone.
"""

import json
import struct
import sys
import time

import numpy as np
import rclpy
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64

from imu_sim_ros.bags.messages.encode import ImuEncoder, OdometryEncoder

DEFAULTS = {
    "rate": 200.0,
    "count": 400,
    "first_ns": 1_000_000_000,
    "skip": [],
    "repeat": [],
    "wait": 1,
    "best_effort": False,
    "latched": False,
    "topics": ["imu", "truth"],
    "accel": [0.0, 0.0, 9.81],
    "hold": 0.3,
    "unstamped": False,
    "spoil": [],
    "truths": None,
}


def main() -> None:
    options = {**DEFAULTS, **json.loads(sys.argv[1])}
    rclpy.init()
    node = rclpy.create_node("feed")
    qos = QoSProfile(depth=5000)
    if options["best_effort"]:
        qos.reliability = ReliabilityPolicy.BEST_EFFORT
    if options["latched"]:
        qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
    outputs = [
        (node.create_publisher(message, topic, qos), rows)
        for message, topic, rows in (contents(name, options) for name in options["topics"])
    ]
    deadline = time.monotonic() + 300
    while min(p.get_subscription_count() for p, _ in outputs) < options["wait"]:
        if time.monotonic() > deadline:
            sys.exit("no subscriber came")
        time.sleep(0.01)
    time.sleep(0.3)  # a subscriber that is known here may still have to learn of this publisher
    print("begin", flush=True)
    begin = time.monotonic()
    for k in range(options["count"]):
        time.sleep(max(0.0, begin + k / options["rate"] - time.monotonic()))
        if k in options["skip"]:
            continue
        for publisher, rows in outputs:
            for row in rows[k : k + 1]:
                for _ in range(1 + options["repeat"].count(k)):
                    publisher.publish(row)
    print("end", flush=True)
    for publisher, _ in outputs:
        publisher.wait_for_all_acked(Duration(seconds=1))
    time.sleep(options["hold"])
    rclpy.shutdown()


def contents(name: str, options: dict) -> tuple:
    count = options["count"]
    k = np.arange(count)
    t_ns = options["first_ns"] + np.rint(k * 1e9 / options["rate"]).astype(np.int64)
    zero, t = np.zeros((count, 3)), (t_ns - t_ns[0]) * 1e-9
    if options["unstamped"]:
        t_ns[:] = 0
    if name == "imu":
        arrays = {"gyro": zero, "accel": np.tile(options["accel"], (count, 1))}
        rows = ImuEncoder("imu_link").encode(t_ns, *spoilt(arrays, options).values())
        return Imu, "imu/data_raw", stamped(rows, options)
    if name == "truth":
        accel = np.array(options["accel"]) - [0.0, 0.0, 9.81]
        q_wb = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
        path = 0.5 * accel * t[:, None] ** 2 + [5.0, 0.0, 0.0]
        poses = spoilt({"position": path, "q_wb": q_wb}, options).values()
        encoder = OdometryEncoder("world", "base_link")
        rows = encoder.encode(t_ns, *poses, accel * t[:, None], zero)
        return Odometry, "ground_truth/odom", [row.tobytes() for row in rows[: options["truths"]]]
    return Float64, "plain", [serialize_message(Float64(data=float(value))) for value in k]


def spoilt(arrays: dict, options: dict) -> dict:
    for k, name, value in options["spoil"]:
        if name in arrays:
            arrays[name][k] = value
    return arrays


def stamped(rows: np.ndarray, options: dict) -> list[bytes]:
    """Return messages as bytes, the stamps of some replaced by [seconds, nanoseconds]."""
    result = [row.tobytes() for row in rows]
    for k, name, value in options["spoil"]:
        if name == "stamp":
            result[k] = result[k][:4] + struct.pack("<iI", *value) + result[k][12:]
    return result


if __name__ == "__main__":
    main()
