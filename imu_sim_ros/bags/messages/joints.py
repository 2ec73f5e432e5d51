# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""sensor_msgs/JointState: angles and speeds of joints, as bytes."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.bags.messages.blocks import Column, RowTemplate
from imu_sim_ros.bags.messages.encode import seconds
from imu_sim_ros.bags.messages.layouts import Builder
from imu_sim_ros.types import Times

JOINT_STATE: Final = "sensor_msgs/msg/JointState"


class JointStateEncoder:
    """sensor_msgs/JointState of the same joints in each message; efforts are left empty."""

    type_name = JOINT_STATE

    def __init__(self, joints: Sequence[str], frame_id: str = "", encoding: str = "cdr") -> None:
        """Set up the messages.

        :param joints: their names, at least one.
        """
        builder = Builder(encoding)
        builder.field("stamp", "header")
        builder.text(frame_id)
        builder.length(len(joints))
        for name in joints:
            builder.text(name)
        for name in ("position", "velocity"):
            builder.length(len(joints))
            builder.field(name, "f8", len(joints))
        builder.length(0)
        self._encoding, self._template = encoding, bytes(builder.template)
        self._offsets = dict(zip(builder.names, builder.offsets, strict=True))
        self._formats = {"sec": "<i4" if encoding == "cdr" else "<u4", "nanosec": "<u4"}

    def pattern(self, t_ns: Times, position: ArrayLike, velocity: ArrayLike) -> RowTemplate:
        """Return n messages.

        :param t_ns: (n,) stamps.
        :param position: (n, m) angles of the m joints [rad].
        :param velocity: (n, m) [rad/s].
        :raises InputError: for stamps that a message cannot hold.
        """
        t_ns = np.asarray(t_ns, dtype=np.int64)
        stamps = zip(("sec", "nanosec"), seconds(t_ns, self._encoding), strict=True)
        columns = [
            Column(self._offsets[name], values.astype(self._formats[name]))
            for name, values in stamps
        ]
        for name, given in (("position", position), ("velocity", velocity)):
            columns.append(Column(self._offsets[name], np.asarray(given, dtype="<f8")))
        return RowTemplate(self._template, columns, len(t_ns))
