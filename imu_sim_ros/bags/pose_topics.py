# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics of a bag that have poses, by their types."""

from typing import Final

from imu_sim_ros.bags.messages.encode import (
    ODOMETRY,
    PATH,
    POSE_STAMPED,
    POSE_WITH_COVARIANCE,
    TRANSFORM_STAMPED,
)
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE
from imu_sim_ros.bags.read import Bag
from imu_sim_ros.bags.reader import describe_topics
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.names import suggestion

POSE_TYPES: Final = (
    ODOMETRY,
    POSE_STAMPED,
    POSE_WITH_COVARIANCE,
    TRANSFORM_STAMPED,
    PATH,
    TF_MESSAGE,
)
"""Types of messages that have poses; without a topic, the first type that a bag has is read."""


def pose_topic(bag: Bag, topic: str | None) -> tuple[str, str, tuple[str, str] | None]:
    """Return name and type of the topic of poses, and the frames of ``/tf:PARENT.CHILD``.

    :raises InputError: if there is none, or several; the line lists them.
    """
    fitting = [info for info in bag.topics if info.type in POSE_TYPES]
    if topic is None:
        types = {info.type for info in fitting if info.type != TF_MESSAGE}
        type_name = next((kind for kind in POSE_TYPES if kind in types), ODOMETRY)
        return bag.topic(type_name, None).name, type_name, None
    plain, _, pair = topic.partition(":")
    frames = tuple(pair.split(".", 1)) if "." in pair else None
    info = bag.find(topic) or bag.find(plain)  # a name in a log may have a colon
    if info is None or info.type not in POSE_TYPES:
        available = describe_topics(fitting) if fitting else "none"
        hint = suggestion(plain, (info.name for info in fitting), "")
        raise InputError(
            f"{bag.path}: has no topic {topic} of poses; it has {available}{hint and f'; {hint}'}"
        )
    if info.type == TF_MESSAGE and (frames is None or not all(frames)):
        raise InputError(
            f"{bag.path}: {info.name} has transforms between several frames; name two: "
            f"{info.name}:PARENT.CHILD"
        )
    return info.name, info.type, None if frames is None else (frames[0], frames[1])
