# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

r"""gtsam's visual-inertial odometry as a node on live topics: readings and features in, a path out.

    simulator --imu adis16448 --trajectory figure_eight --ros-args -p "cameras:=[cam0]" \
        -p cam0.camera.preset:=euroc_cam0
    python examples/gtsam_vio_node.py simulation.yaml -o estimate.txt

The file is the ``simulation.yaml`` of ``generate --with-configs``, or the parameter file of the
simulator. Subscribes ``imu/data_raw``, ``feature_tracker/feature`` (``features.layout: mono``) and,
for the first pose and velocity and to compare, ``ground_truth/odom``; publishes ``vio/odom``. Ends
when the publishers of features have gone.
"""

import argparse
import itertools
import json
import time
from pathlib import Path

import gtsam
import numpy as np
import rclpy
from gtsam_vio import Estimator, Result, compared, configuration
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu, PointCloud

from imu_sim_ros.core import rotation

LAST_WORDS = 5.0
"""[s] After this long without a message, none is under way any more."""
DEEP = QoSProfile(depth=20000)


def stamp(message) -> int:
    """Return a message's stamp [ns]."""
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


class VioNode(Node):
    """Keeps readings until a frame is complete, and passes them to the estimator in order."""

    def __init__(self, path: Path, rate: float) -> None:
        """Set up estimator and topics.

        :param path: of the simulation's parameters.
        :param rate: of key frames [Hz].
        """
        super().__init__("gtsam_vio")
        parameters, self._cameras = configuration(path)
        self._estimator = Estimator(parameters, *self._cameras)
        self._stride = max(1, round(self._cameras[0].rate / rate))
        self._imu: dict[int, np.ndarray] = {}
        self._truth: dict[int, Odometry] = {}
        self._frames: list[tuple[int, np.ndarray]] = []
        self._count = 0
        self._last = None
        self._rows: list[tuple] = []
        self._times: list[int] = []
        self._heard = False
        self.busy = time.monotonic()
        """Monotonic time at which the latest message was processed [s]."""
        self._path = self.create_publisher(Odometry, "vio/odom", 100)
        self.create_subscription(Imu, "imu/data_raw", self._on_imu, DEEP)
        self.create_subscription(Odometry, "ground_truth/odom", self._on_truth, DEEP)
        self.create_subscription(PointCloud, "feature_tracker/feature", self._on_features, DEEP)

    def _on_imu(self, message: Imu) -> None:
        w, a = message.angular_velocity, message.linear_acceleration
        self._imu[stamp(message)] = np.array([w.x, w.y, w.z, a.x, a.y, a.z])
        self._work()

    def _on_truth(self, message: Odometry) -> None:
        self._truth[stamp(message)] = message
        self._work()

    def _on_features(self, message: PointCloud) -> None:
        self._heard = True
        values = np.array([channel.values for channel in message.channels]).T
        # The first message is that of frame 1: frames 5, 10, ... are key frames.
        self._count += 1
        if self._count % self._stride == 0:
            self._frames.append((stamp(message), values))
        self._work()

    def _work(self) -> None:
        """Close the key frames whose readings and truth are all there."""
        self.busy = time.monotonic()
        while self._frames:
            frame_ns, values = self._frames[0]
            if frame_ns not in self._imu or frame_ns not in self._truth:
                return
            self._frames.pop(0)
            true = _pose(self._truth[frame_ns])
            if self._last is None:
                velocity = self._truth[frame_ns].twist.twist.linear
                in_body = np.array([velocity.x, velocity.y, velocity.z])
                self._estimator.start(true, true.rotation().rotate(in_body))
            else:
                self._integrate(frame_ns)
            cameras = len(self._cameras)
            identity, camera_numbers = np.divmod(values[:, 0].astype(np.int64), cameras)
            self._estimator.look(identity, values[:, 1:3].astype(float), camera_numbers)
            self._last = frame_ns
            self._times.append(frame_ns)
            self._rows.append(compared(self._estimator, true))
            self._publish(frame_ns)
            self._imu = {t: row for t, row in self._imu.items() if t >= frame_ns}
            self._truth = {t: row for t, row in self._truth.items() if t >= frame_ns}
            self.busy = time.monotonic()

    def _integrate(self, end_ns: int) -> None:
        times = sorted(t for t in self._imu if self._last <= t <= end_ns)
        for start, end in itertools.pairwise(times):
            mean = 0.5 * (self._imu[start] + self._imu[end])
            self._estimator.integrate(mean[3:], mean[:3], (end - start) * 1e-9)

    def _publish(self, stamp_ns: int) -> None:
        position, q, *_, covariance = self._rows[-1]
        message = Odometry()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        message.header.frame_id, message.child_frame_id = "world", "base_link"
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        place.x, place.y, place.z = position.tolist()
        turn.w, turn.x, turn.y, turn.z = q.tolist()
        # gtsam: rotation, position; ROS: position, rotation.
        order = [3, 4, 5, 0, 1, 2]
        message.pose.covariance = covariance[np.ix_(order, order)].ravel()
        self._path.publish(message)

    def over(self) -> bool:
        """Return whether there were features, and no publisher of them is left."""
        return self._heard and not self.count_publishers("feature_tracker/feature")

    def result(self) -> Result:
        """Return the path so far."""
        columns = (np.array(column) for column in zip(*self._rows, strict=True))
        return Result(np.array(self._times), *columns)


def _pose(truth: Odometry) -> gtsam.Pose3:
    p, q = truth.pose.pose.position, truth.pose.pose.orientation
    matrix = rotation.to_matrix(np.array([q.w, q.x, q.y, q.z]))
    return gtsam.Pose3(gtsam.Rot3(matrix), np.array([p.x, p.y, p.z]))


def main() -> None:
    """Run until the features end, then print the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("configuration", type=Path, help="simulation.yaml of --with-configs")
    parser.add_argument("-o", "--output", type=Path, help="the estimated path, for evaluate")
    parser.add_argument("--rate", type=float, default=4.0, help="of key frames [Hz]")
    arguments = parser.parse_args()
    rclpy.init()
    node = VioNode(arguments.configuration, arguments.rate)
    while not node.over():
        rclpy.spin_once(node, timeout_sec=0.5)
    while time.monotonic() - node.busy < LAST_WORDS:  # what was sent before still comes
        rclpy.spin_once(node, timeout_sec=0.1)
    result = node.result()
    if arguments.output is not None:
        result.write(arguments.output)
    print(json.dumps(result.summary(), indent=2), flush=True)
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
