# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes: subscriptions without message objects, publishers, message types.

``decode`` reads numbers out of messages, ``sensor_description`` is the text beside the readings of
an IMU, ``transform_type`` is tf2_msgs/TFMessage where tf2_msgs is not installed. Imports bags,
config, conventions and errors; its modules are imported when first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.nodes.topics import decode as decode
    from imu_sim_ros.nodes.topics import message_types as message_types
    from imu_sim_ros.nodes.topics import sensor_description as sensor_description
    from imu_sim_ros.nodes.topics.decode import ImuReading as ImuReading
    from imu_sim_ros.nodes.topics.decode import Truth as Truth
    from imu_sim_ros.nodes.topics.message_types import definition as definition
    from imu_sim_ros.nodes.topics.message_types import message_class as message_class
    from imu_sim_ros.nodes.topics.message_types import stamp_offset as stamp_offset
    from imu_sim_ros.nodes.topics.message_types import type_hash as type_hash
    from imu_sim_ros.nodes.topics.publishing import Counter as Counter
    from imu_sim_ros.nodes.topics.publishing import check_overrides as check_overrides
    from imu_sim_ros.nodes.topics.publishing import create as create
    from imu_sim_ros.nodes.topics.raw_subscription import RawSubscriptions as RawSubscriptions
    from imu_sim_ros.nodes.topics.raw_subscription import Taken as Taken
    from imu_sim_ros.nodes.topics.raw_subscription import is_weaker as is_weaker
    from imu_sim_ros.nodes.topics.raw_subscription import matching_qos as matching_qos
    from imu_sim_ros.nodes.topics.raw_subscription import offered_qos as offered_qos
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": ["decode", "message_types", "sensor_description"],
            "decode": ["ImuReading", "Truth"],
            "message_types": ["definition", "message_class", "stamp_offset", "type_hash"],
            "publishing": ["Counter", "check_overrides", "create"],
            "raw_subscription": [
                "RawSubscriptions",
                "Taken",
                "is_weaker",
                "matching_qos",
                "offered_qos",
            ],
        },
    )
