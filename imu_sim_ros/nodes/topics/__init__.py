# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What comes in and goes out as bytes: subscriptions without objects, publishers, message types.

``decode`` reads numbers out of messages, ``sensor_description`` is the text beside the readings of
an IMU. Imports bags, config, conventions and errors.
"""

from imu_sim_ros.nodes.topics import decode, message_types, sensor_description
from imu_sim_ros.nodes.topics.decode import ImuReading, Truth
from imu_sim_ros.nodes.topics.message_types import (
    definition,
    message_class,
    stamp_offset,
    type_hash,
)
from imu_sim_ros.nodes.topics.publishing import Counter, check_overrides, create
from imu_sim_ros.nodes.topics.raw_subscription import (
    Message,
    RawSubscriptions,
    is_weaker,
    matching_qos,
    offered_qos,
)

__all__ = [
    "Counter",
    "ImuReading",
    "Message",
    "RawSubscriptions",
    "Truth",
    "check_overrides",
    "create",
    "decode",
    "definition",
    "is_weaker",
    "matching_qos",
    "message_class",
    "message_types",
    "offered_qos",
    "sensor_description",
    "stamp_offset",
    "type_hash",
]
