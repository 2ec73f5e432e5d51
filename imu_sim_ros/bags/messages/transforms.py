# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages with any number of parts: transforms between frames, states of joints, and paths."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.bags.messages.blocks import RowTemplate
from imu_sim_ros.bags.messages.encode import (
    PATH,
    ROS_ORDER,
    Encoder,
    PoseStampedEncoder,
    seconds,
)
from imu_sim_ros.bags.messages.layouts import LayoutBuilder
from imu_sim_ros.core.rotation import from_matrix
from imu_sim_ros.core.types import Array, Bytes, Times

TF_MESSAGE: Final = "tf2_msgs/msg/TFMessage"
JOINT_STATE: Final = "sensor_msgs/msg/JointState"
_CDR: Final = b"\0\1\0\0"
"""Encapsulation of little-endian CDR."""
_ENCAPSULATION: Final = len(_CDR)
_LENGTH: Final = 4
"""Size of the length of a string or an array [bytes]."""
_STAMP_AND_LENGTH: Final = 12
"""Size of a header before its frame [bytes]."""
_POSE_SIZE: Final = 56
"""Size of the numbers of a pose [bytes]."""


class TransformsEncoder:
    """tf2_msgs/TFMessage with the same frames in each message."""

    type_name = TF_MESSAGE

    def __init__(self, frames: Sequence[tuple[str, str]], encoding: str = "cdr") -> None:
        """Set up the messages.

        :param frames: parent and child of each of the m transforms in a message.
        """
        builder = LayoutBuilder(encoding)
        builder.length(len(frames))
        for k, (parent, child) in enumerate(frames):
            builder.field("stamp", "header", suffix=f"_{k}")
            builder.text(parent)
            builder.text(child)
            builder.field("translation", "f8", 3, f"_{k}")
            builder.field("rotation", "f8", 4, f"_{k}")
        self._count, self._layout = len(frames), builder.layout(self.type_name)

    @staticmethod
    def stamp_offset() -> int:
        """Return where the stamp of the first transform begins, in CDR."""
        builder = LayoutBuilder("cdr")
        builder.length(1)
        builder.field("stamp", "header")
        return builder.offsets[builder.names.index("sec")]

    def encode(self, t_ns: Times, translation: ArrayLike, q: ArrayLike) -> Bytes:
        """Return messages (n, size).

        :param t_ns: (n,) stamps.
        :param translation: (n, m, 3) origin of the child in its parent [m].
        :param q: (n, m, 4) rotation from the child to its parent.
        :raises InputError: for stamps that a message cannot hold.
        """
        t_ns = np.asarray(t_ns, dtype=np.int64)
        second, nanosecond = seconds(t_ns, self._layout.encoding)
        translation, q = np.asarray(translation), np.asarray(q)[..., ROS_ORDER]
        rows = np.tile(np.frombuffer(self._layout.template, np.uint8), (len(t_ns), 1))
        fields: NDArray[np.void] = rows.view(self._layout.dtype)[:, 0]
        for k in range(self._count):
            fields[f"sec_{k}"], fields[f"nanosec_{k}"] = second, nanosecond
            fields[f"translation_{k}"] = translation[:, k]
            fields[f"rotation_{k}"] = q[:, k]
        return rows

    def encode_fixed(self, t_ns: Times, poses: Array) -> Bytes:
        """Return messages (n, size) of transforms that do not change.

        :param t_ns: (n,) stamps.
        :param poses: (m, 4, 4), each maps coordinates in the child to its parent.
        """
        return self.encode(t_ns, poses[None, :, :3, 3], from_matrix(poses[:, :3, :3])[None])


class JointStateEncoder(Encoder):
    """sensor_msgs/JointState of the same joints in each message; efforts are left empty."""

    type_name = JOINT_STATE

    def __init__(self, joints: Sequence[str], frame_id: str = "", encoding: str = "cdr") -> None:
        """Set up the messages.

        :param joints: names of the joints, at least one.
        """
        builder = LayoutBuilder(encoding)
        builder.field("stamp", "header")
        builder.text(frame_id)
        builder.length(len(joints))
        for name in joints:
            builder.text(name)
        for name in ("position", "velocity"):
            builder.length(len(joints))
            builder.field(name, "f8", len(joints))
        builder.length(0)
        super().__init__(builder.layout(self.type_name))

    def pattern(self, t_ns: Times, position: ArrayLike, velocity: ArrayLike) -> RowTemplate:
        """Return n messages.

        :param t_ns: (n,) stamps.
        :param position: (n, m) angles of the m joints [rad].
        :param velocity: (n, m) velocities of the joints [rad/s].
        :raises InputError: for stamps that a message cannot hold.
        """
        return self._row_template(t_ns, position=position, velocity=velocity)


class PathEncoder:
    """nav_msgs/Path in CDR of poses in one frame, each of which is encoded once.

    A path that grows has thousands of poses in each message; all of them but the first have the
    bytes of a message of their own.
    """

    type_name = PATH

    def __init__(self, frame_id: str) -> None:
        self._poses = PoseStampedEncoder(frame_id)
        self._header_size = _STAMP_AND_LENGTH + len(frame_id.encode()) + 1

    def pose(self, t_ns: int, position: Sequence[float], q: Sequence[float]) -> bytes:
        """Return a pose of the path.

        :param position: (3,) position [m].
        :param q: (4,) attitude.
        :raises InputError: for a stamp that a message cannot hold.
        """
        (message,) = self._poses.encode([t_ns], [position], [q])
        pose: bytes = message[_ENCAPSULATION:].tobytes()
        return pose

    def message(self, poses: Sequence[bytes]) -> bytes:
        """Return the message of poses, at least one, with the stamp of the latest.

        :param poses: what :meth:`pose` has returned for each.
        """
        size = self._header_size
        count = bytes(-size % _LENGTH) + len(poses).to_bytes(_LENGTH, "little")
        begin = size + len(count)
        # Numbers of eight bytes lie at multiples of eight in the message: not where they do in one
        # of the pose alone, if the path's own header is no such multiple.
        oldest_pose = poses[0]
        aligned = oldest_pose[:size] + bytes(-(begin + size) % 8) + oldest_pose[-_POSE_SIZE:]
        later_poses = iter(poses)
        next(later_poses)
        return b"".join((_CDR, poses[-1][:size], count, aligned, *later_poses))
