# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of any kind: Imu topics as Readings, topics of poses of any type as States."""

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.messages.decode import quaternions_wxyz
from imu_sim_ros.bags.messages.encode import (
    IMU,
    ODOMETRY,
    PATH,
    POSE_STAMPED,
    POSE_WITH_COVARIANCE,
    TRANSFORM_STAMPED,
)
from imu_sim_ros.bags.messages.schemas import Message
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE
from imu_sim_ros.bags.pose_topics import POSE_TYPES, pose_topic
from imu_sim_ros.bags.read import (
    Bag,
    decode_blocks,
    decode_messages,
    imu_blocks,
    odometry_blocks,
    open_bag,
)
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings, States, concatenate
from imu_sim_ros.core.rotation import normalise
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.formats.handling import Handling

_FIELDS: Final = {
    POSE_STAMPED: ("position", "orientation"),
    POSE_WITH_COVARIANCE: ("position", "orientation", "pose_covariance"),
    TRANSFORM_STAMPED: ("translation", "rotation"),
}


def holds(path: Path) -> bool:
    """Return True: a path that no other format recognises is opened as a bag, or refused."""
    return True


def reading_blocks(
    path: Path, topic: str | None, frame: str | None, handling: Handling
) -> Iterator[Readings]:
    """Yield the readings of an Imu topic in blocks; arguments as for the door."""
    return imu_blocks(path, topic, handling.recover, handling.skipped, handling.warned, frame)


def imu_topics(path: Path) -> list[str]:
    """Return the names of the Imu topics that have messages."""
    with open_bag(path) as bag:
        return [info.name for info in bag.topics if info.type == IMU and info.count]


def odometry_topics(path: Path) -> list[str]:
    """Return the names of the Odometry topics."""
    with open_bag(path) as bag:
        return [info.name for info in bag.topics if info.type == ODOMETRY]


def truth_file(path: Path) -> Path | None:
    """Return the bag if it has an Odometry topic."""
    return path if odometry_topics(path) else None


def pose_topics(path: Path) -> list[str]:
    """Return the names of the topics of poses, one of each body; not those of transforms."""
    with open_bag(path) as bag:
        return [
            info.name for info in bag.topics if info.type in POSE_TYPES and info.type != TF_MESSAGE
        ]


def stated_units(path: Path, topic: str | None) -> dict[str, str]:
    """Return nothing: a message has SI units by its type, and drivers that differ say nothing."""
    return {}


def states(path: Path, topic: str | None, covariance: bool, handling: Handling) -> States:
    """Return the poses of a topic of any type in :data:`POSE_TYPES`; arguments as for the door."""
    source = str(path) if topic is None else f"{path}, {topic}"
    with open_bag(path, handling.recover) as bag:
        name, type_name, frames = pose_topic(bag, topic)
        if type_name in (PATH, TF_MESSAGE):
            return _read_poses(bag, name, frames, source)
    blocks = _blocks(path, name, type_name, covariance, handling)
    head = next(blocks, None)
    if head is None:
        raise InputError(f"{source}: 0 poses; a trajectory needs two or more")
    columns = concatenate(chain([head], blocks))
    if handling.warned is not None:  # passed on as they are
        return columns
    return States(
        columns.t_ns,
        columns.position,
        columns.q_wb,
        columns.velocity,
        columns.angular_velocity,
        source,
        covariance=columns.covariance,
        twist_covariance=columns.twist_covariance,
        frame_id=columns.frame_id,
        child_frame_id=columns.child_frame_id,
    )


def _blocks(
    path: Path, name: str, type_name: str, covariance: bool, handling: Handling
) -> Iterator[States]:
    """Yield the poses of a topic of messages that are read in bulk."""
    skipped, warned, recover = handling
    if type_name == ODOMETRY:
        for block in odometry_blocks(path, name, recover, skipped, warned):
            if not covariance:
                object.__setattr__(block, "covariance", None)
                object.__setattr__(block, "twist_covariance", None)
            yield block
        return
    names = _FIELDS[type_name]
    for fields in decode_blocks(path, type_name, name, names, recover, skipped, warned):
        position, orientation, *stated = fields.numbers.values()
        q_wb = quaternions_wxyz(orientation)
        yield States.unchecked(
            t_ns=fields.t_ns,
            position=position,
            q_wb=q_wb if warned is not None else normalise(q_wb),
            covariance=stated[0].reshape(-1, 6, 6) if stated and covariance else None,
            frame_id=fields.texts[0],
            child_frame_id=fields.texts[1] if len(fields.texts) > 1 else "",
            source=str(path),
        )


def _read_poses(bag: Bag, name: str, frames: tuple[str, str] | None, source: str) -> States:
    """Return the poses of the last Path of a topic, or the transforms between two frames.

    :param name: topic.
    :param frames: parent and child frame; None: the topic has messages of type Path.
    :param source: name of the states' source.
    :raises InputError: if there are none.
    """
    rows: list[tuple[int, tuple[float, ...], tuple[float, ...]]] = []
    for _, message in decode_messages(bag, {name}):
        if frames is None:
            rows = [
                (_stamp(pose.header), _xyz(pose.pose.position), _wxyz(pose.pose.orientation))
                for pose in message.poses
            ]
            continue
        rows += [
            (
                _stamp(entry.header),
                _xyz(entry.transform.translation),
                _wxyz(entry.transform.rotation),
            )
            for entry in message.transforms
            if (entry.header.frame_id.lstrip("/"), entry.child_frame_id.lstrip("/")) == frames
        ]
    if len(rows) < 2:
        raise InputError(f"{source}: {len(rows)} poses; a trajectory needs two or more")
    t_ns, position, q_wb = zip(*rows, strict=True)
    frame_id, child_frame_id = frames or ("", "")
    return States(
        np.array(t_ns, dtype=np.int64),
        np.array(position),
        np.array(q_wb),
        source=source,
        frame_id=frame_id,
        child_frame_id=child_frame_id,
    )


def _stamp(header: Message) -> int:
    """Return the stamp of a header [ns]."""
    return int(header.stamp.sec) * NANOSECONDS_PER_SECOND + int(header.stamp.nanosec)


def _xyz(vector: Message) -> tuple[float, ...]:
    return vector.x, vector.y, vector.z


def _wxyz(q: Message) -> tuple[float, ...]:
    return q.w, q.x, q.y, q.z
