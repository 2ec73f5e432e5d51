# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Clouds that a bag holds: sensor_msgs/PointCloud2."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages.encode_cameras import POINT_CLOUD2, POINT_TYPES
from imu_sim_ros.bags.messages.schemas import Message
from imu_sim_ros.bags.read import decode_messages, open_bag
from imu_sim_ros.bags.reader import Bag, errors_naming
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.gate import stamp_ns
from imu_sim_ros.core.types import AnyArray, Array
from imu_sim_ros.recordings.cameras import TIME_FIELDS, CloudRecord

_FIRST: Final = 10
"""Clouds of a topic whose points are looked at."""


def measured_cloud_topics(path: Path) -> list[str]:
    """Return the topics of clouds in a bag, without those of the truth."""
    return [name for name in cloud_topics(path) if not is_truth(name)]


def is_truth(topic: str) -> bool:
    """Return True for a topic of the truth, by its name."""
    return "ground_truth" in topic.split("/")


def cloud_topics(path: Path) -> list[str]:
    """Return the topics of clouds in a bag."""
    with open_bag(path) as bag:
        return [topic.name for topic in bag.topics if topic.type == POINT_CLOUD2 and topic.count]


def read_cloud(path: Path, name: str) -> Array:
    """Return the points (n, 3) [m] of the first PointCloud2 of a topic; (0, 3): the bag has none.

    :raises InputError: for a cloud without x, y and z.
    """
    with open_bag(path) as bag:
        topic = next((info for info in bag.topics if info.name.strip("/") == name), None)
    if topic is None or not topic.count:
        return np.empty((0, 3))
    _, rows = next(read_clouds(path, topic.name))
    return np.stack([rows[axis].astype(np.float64) for axis in "xyz"], axis=-1)


def cloud_frame(path: Path, name: str) -> str:
    """Return the frame of the first cloud of a topic."""
    with open_bag(path) as bag:
        _, cloud = next(decode_messages(bag, [name]))
    return str(cloud.header.frame_id)


def read_clouds(path: Path, name: str) -> Iterator[tuple[int, NDArray[np.void]]]:
    """Yield stamps [ns] and points, structured arrays (k,), of the clouds of a topic.

    :raises InputError: for a cloud without x, y and z.
    """
    with open_bag(path) as bag:
        for _, cloud in decode_messages(bag, [name]):
            with errors_naming(path, f" ({name})"):
                rows = _points(cloud, name)
                t_ns = stamp_ns(int(cloud.header.stamp.sec), int(cloud.header.stamp.nanosec))
            yield t_ns, rows


def cloud_records(bag: Bag, source: str) -> Iterator[CloudRecord]:
    """Yield a record for each topic of clouds but those of the truth, of its first clouds.

    Clouds without positions, as those of radars, have none.

    :param source: name of the file.
    """
    for topic in bag.topics:
        if topic.type != POINT_CLOUD2 or not topic.count or is_truth(topic.name):
            continue
        times: dict[str, list[AnyArray]] = {}
        fields: tuple[str, ...] = ()
        organised = False
        for _, cloud in islice(decode_messages(bag, [topic.name]), _FIRST):
            if not _has_positions(cloud):
                break
            fields = tuple(str(field.name) for field in cloud.fields)
            organised = int(cloud.height) > 1
            with errors_naming(bag.path, f" ({topic.name})"):
                rows = _points(cloud, topic.name)
            for name in TIME_FIELDS:
                if name in (rows.dtype.names or ()):
                    times.setdefault(name, []).append(rows[name])
        columns = {name: tuple(values) for name, values in times.items()}
        if fields:
            yield CloudRecord(f"{source}, {topic.name}", fields, organised, columns)


def _has_positions(cloud: Message) -> bool:
    """Return True for a message with x, y and z as floating-point numbers."""
    types = {field.name: int(field.datatype) for field in cloud.fields}
    return all(types.get(axis) in (7, 8) for axis in "xyz")


def _points(cloud: Message, name: str) -> NDArray[np.void]:
    """Return the points (n,) of a message with all of its fields."""
    kinds = {number: kind for kind, number in POINT_TYPES.items()}
    order = ">" if cloud.is_bigendian else "<"
    fields = {field.name: field for field in cloud.fields if int(field.datatype) in kinds}
    if not _has_positions(cloud):
        raise InputError(f"{name}: a cloud without x, y and z as floating-point numbers")
    formats = [order + kinds[int(field.datatype)] for field in fields.values()]
    counts = [max(int(field.count), 1) for field in fields.values()]
    row = np.dtype(
        {
            "names": list(fields),
            "formats": [f if n == 1 else (f, (n,)) for f, n in zip(formats, counts, strict=True)],
            "offsets": [int(field.offset) for field in fields.values()],
            "itemsize": int(cloud.point_step),
        }
    )
    return np.frombuffer(bytes(cloud.data), dtype=row)
