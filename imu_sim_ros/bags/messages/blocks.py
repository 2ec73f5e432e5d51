# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blocks of encoded messages, and the topics that they belong to."""

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages.layouts import Bytes
from imu_sim_ros.bags.messages.qos import Qos
from imu_sim_ros.bags.messages.schemas import Schema

Times = NDArray[np.int64]
Payloads: TypeAlias = Bytes | list[bytes]


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a bag."""

    name: str
    type: str
    """In the form of ROS 2, for instance sensor_msgs/msg/Imu."""
    count: int
    schema: Schema
    qos: tuple[Qos, ...] = (Qos(),)


class MessageBlock(NamedTuple):
    """n messages of one topic, in the order of their record times."""

    topic: TopicInfo
    t_ns: Times
    """(n,) record times."""
    payloads: Payloads
    """(n, size) bytes of messages of equal size, or a list of n messages."""


def as_list(payloads: Payloads) -> list[bytes]:
    """Return messages as a list of bytes."""
    if isinstance(payloads, list):
        return payloads
    if payloads.shape[1] == 0:
        return [b""] * len(payloads)
    rows = np.ascontiguousarray(payloads)
    result: list[bytes] = rows.view(f"V{rows.shape[1]}")[:, 0].tolist()
    return result
