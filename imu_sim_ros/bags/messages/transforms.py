# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""tf2_msgs/TFMessage: transforms between frames, as bytes."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.bags.messages.encode import ROS_ORDER, seconds
from imu_sim_ros.bags.messages.layouts import Builder, Bytes
from imu_sim_ros.types import Times

TF_MESSAGE: Final = "tf2_msgs/msg/TFMessage"


class TransformsEncoder:
    """tf2_msgs/TFMessage with the same frames in each message."""

    type_name = TF_MESSAGE

    def __init__(self, frames: Sequence[tuple[str, str]], encoding: str = "cdr") -> None:
        """Set up the messages.

        :param frames: parent and child of each of the m transforms in a message.
        """
        builder = Builder(encoding)
        builder.length(len(frames))
        for k, (parent, child) in enumerate(frames):
            builder.field("stamp", "header", suffix=f"_{k}")
            builder.text(parent)
            builder.text(child)
            builder.field("translation", "f8", 3, f"_{k}")
            builder.field("rotation", "f8", 4, f"_{k}")
        self._count, self._encoding = len(frames), encoding
        self._dtype = builder.dtype()
        self._template = np.frombuffer(bytes(builder.template), np.uint8)

    @staticmethod
    def stamp_offset() -> int:
        """Return where the stamp of the first transform begins, in CDR."""
        builder = Builder("cdr")
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
        second, nanosecond = seconds(t_ns, self._encoding)
        translation, q = np.asarray(translation), np.asarray(q)[..., ROS_ORDER]
        rows = np.empty((len(t_ns), len(self._template)), np.uint8)
        rows[:] = self._template
        fields: NDArray[np.void] = rows.view(self._dtype)[:, 0]
        for k in range(self._count):
            fields[f"sec_{k}"], fields[f"nanosec_{k}"] = second, nanosecond
            fields[f"translation_{k}"] = translation[:, k]
            fields[f"rotation_{k}"] = q[:, k]
        return rows
