# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contents of ROS messages as tests compare them."""

from collections.abc import Iterable
from typing import Any


def stamp_ns(message: Any) -> int:
    """Return the stamp of a message's header [ns]."""
    stamp = message.header.stamp
    nanoseconds: int = stamp.sec * 10**9 + stamp.nanosec
    return nanoseconds


def stamps_ns(messages: Iterable[Any]) -> list[int]:
    """Return the stamps of messages' headers [ns], in the order of the messages."""
    return [stamp_ns(message) for message in messages]
