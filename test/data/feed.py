# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A driver for tests: publishes readings (and the truth) as its options tell.

In the test's own process; as a program, with the options as one JSON argument, it can be killed.

``rate`` [Hz], ``count``, ``first_ns`` stamp of the first, ``skip`` and ``repeat`` indices, ``wait``
for so many subscribers of each topic, ``best_effort``, ``latched``, ``topics`` (imu, truth, plain,
number: on imu's topic), ``accel``, ``hold`` [s] before the end, ``unstamped``: all stamps of
readings and truth are zero,
``spoil``: triples of a message's index, what is spoilt in it (stamp, gyro, accel, position, q_wb)
and the value, ``truths``: number of true states, after which there are readings alone, ``patience``
[s] for what others have to do.
"""

import json
import struct
import sys
import threading
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


class Driver:
    """Publishes in a thread of its own; :meth:`finish` waits for the end, :meth:`close` ends it."""

    def __init__(self, options: dict, domain: int | None = None) -> None:
        self._options = {**DEFAULTS, **options}
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("feed", context=self._context)
        self._begun, self._published, self._stop = (threading.Event() for _ in range(3))
        self._thread = threading.Thread(target=self._drive, name="driver", daemon=True)
        self._thread.start()

    def wait_until_it_begins(self) -> None:
        assert self._begun.wait(self._options["patience"]), "no subscriber came"

    def wait_until_all_is_published(self) -> None:
        assert self._published.wait(self._options["patience"]), "not all was published"

    def finish(self) -> None:
        """Wait until all messages were published and taken."""
        self.wait_until_all_is_published()
        self._thread.join(self._options["patience"])
        self.close()

    def close(self) -> None:
        """Stop publishing and leave the graph."""
        self._stop.set()
        self._thread.join()
        if self._context.ok():
            self._node.destroy_node()
            self._context.shutdown()

    def _drive(self) -> None:
        options, stop = self._options, self._stop
        qos = QoSProfile(depth=5000)
        if options["best_effort"]:
            qos.reliability = ReliabilityPolicy.BEST_EFFORT
        if options["latched"]:
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
        outputs = [
            (self._node.create_publisher(message, topic, qos), rows)
            for message, topic, rows in (contents(name, options) for name in options["topics"])
        ]
        while min(p.get_subscription_count() for p, _ in outputs) < options["wait"]:
            if stop.wait(0.01):
                return
        # A subscriber that is known here may still have to learn of this publisher.
        stop.wait(0.3)
        self._begun.set()
        begin = time.monotonic()
        for k in range(options["count"]):
            if stop.wait(max(0.0, begin + k / options["rate"] - time.monotonic())):
                return
            if k in options["skip"]:
                continue
            for publisher, rows in outputs:
                for row in rows[k : k + 1]:
                    for _ in range(1 + options["repeat"].count(k)):
                        publisher.publish(row)
        self._published.set()
        for publisher, _ in outputs:
            publisher.wait_for_all_acked(Duration(seconds=10))
        stop.wait(options["hold"])


def contents(name: str, options: dict) -> tuple:
    """Return the message type, the topic and the messages of one of ``topics``."""
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
    topic = "imu/data_raw" if name == "number" else "plain"
    return Float64, topic, [serialize_message(Float64(data=float(value))) for value in k]


def spoilt(arrays: dict, options: dict) -> dict:
    """Return the arrays with the values of ``spoil`` in their rows."""
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
    driver = Driver(json.loads(sys.argv[1]))
    driver.wait_until_it_begins()
    print("begin", flush=True)
    driver.finish()
