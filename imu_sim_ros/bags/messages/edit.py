# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Imu messages with other units, or of one frame only; all other bytes stay."""

import struct
from typing import NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import MessageBlock, TopicInfo
from imu_sim_ros.bags.messages.decode import group_by_texts
from imu_sim_ros.bags.messages.encode import IMU
from imu_sim_ros.core.errors import InputError

_TRIADS = ("angular_velocity", "linear_acceleration")


class ImuEdit(NamedTuple):
    """Frame and units of Imu messages that are copied."""

    topic: str | None
    """Name of their topic, without a slash in front; None: all of Imu."""
    frame: str | None
    """Frame of the messages to keep; None: all."""
    factors: tuple[float, float]
    """SI values of the units of the gyroscope and of the accelerometer."""

    def concerns(self, topic: TopicInfo) -> bool:
        """Return True for a topic whose messages change."""
        return topic.type == IMU and self.topic in (None, topic.name.lstrip("/"))

    def apply(self, block: MessageBlock, encoding: str) -> MessageBlock:
        """Return a block with its Imu messages in SI units; blocks of other types as they are.

        Covariances change with the square of the unit; -1 for an absent triad stays.

        :raises InputError: for messages that are not Imu.
        """
        if not self.concerns(block.topic) or not len(block.t_ns):
            return block
        try:
            groups = group_by_texts(IMU, encoding, block.payloads)
        except (ArithmeticError, LookupError, ValueError, struct.error) as error:
            raise InputError(f"{block.topic.name}: not {IMU} messages: {error}") from None
        messages: dict[int, bytes] = {}
        for group in groups:
            if self.frame is not None and group.texts[0] != self.frame:
                continue
            payloads = np.array(group.payloads)
            values = payloads.view(group.form.dtype)[:, 0]
            for name, factor in zip(_TRIADS, self.factors, strict=True):
                if factor != 1.0:
                    covariance = values[f"{name}_covariance"]
                    stated = covariance[:, :1] != -1.0
                    values[name] *= factor
                    values[f"{name}_covariance"] = np.where(
                        stated, covariance * factor**2, covariance
                    )
            rows = np.arange(len(block.t_ns))[group.rows]
            messages.update(zip(rows.tolist(), map(bytes, payloads), strict=True))
        kept_rows = sorted(messages)
        return block._replace(t_ns=block.t_ns[kept_rows], payloads=[messages[k] for k in kept_rows])
