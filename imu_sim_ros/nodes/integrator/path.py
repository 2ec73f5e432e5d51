# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The dead-reckoned path as RViz draws it: few poses, published at a low rate."""

from collections import deque
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from nav_msgs.msg import Path
from std_msgs.msg import Header

from imu_sim_ros.config import IntegratorParameters
from imu_sim_ros.nodes.integrator.odometer import Row


class PathPublisher:
    """Keeps a pose for each interval of the path's rate, as far back as ``path_length``."""

    def __init__(self, publisher: Any, frame_id: str, parameters: IntegratorParameters) -> None:
        self._publisher, self._frame_id = publisher, frame_id
        self._interval_ns = 1e9 / parameters.path_rate
        kept = int(parameters.path_length * parameters.path_rate) + 1
        self._poses: deque[PoseStamped] = deque(maxlen=kept)
        self._due_ns = 0.0

    def add(self, row: Row) -> None:
        """Take a state; most are skipped."""
        if self._due_ns - self._interval_ns <= row.t_ns < self._due_ns:
            return
        self._due_ns = row.t_ns + self._interval_ns
        w, x, y, z = row.q_wb
        px, py, pz = row.position
        pose = Pose(position=Point(x=px, y=py, z=pz), orientation=Quaternion(x=x, y=y, z=z, w=w))
        self._poses.append(PoseStamped(header=self._header(row.t_ns), pose=pose))

    def clear(self) -> None:
        """Forget the path."""
        self._poses.clear()
        self._due_ns = 0.0

    def publish(self) -> None:
        """Publish the path so far, where there is a subscriber."""
        if self._poses and self._publisher.get_subscription_count():
            poses = list(self._poses)
            self._publisher.publish(Path(header=poses[-1].header, poses=poses))

    def _header(self, t_ns: int) -> Header:
        second, nanosecond = divmod(t_ns, 1_000_000_000)
        return Header(stamp=Time(sec=second, nanosec=nanosecond), frame_id=self._frame_id)
