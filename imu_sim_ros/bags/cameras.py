# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cameras of a bag: their topics, and what camera_info says of them."""

import re
from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages import schemas
from imu_sim_ros.bags.messages.blocks import TopicInfo, as_list
from imu_sim_ros.bags.messages.encode_cameras import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE
from imu_sim_ros.bags.messages.schemas import Message
from imu_sim_ros.bags.read import decode_messages
from imu_sim_ros.bags.reader import Bag, errors_naming
from imu_sim_ros.core.conventions import (
    COMPRESSED_TOPIC,
    DEPTH_TOPIC,
    FLOW_TOPIC,
    IMAGE_TOPIC,
    MASK_TOPIC,
)
from imu_sim_ros.core.types import field_values
from imu_sim_ros.recordings.cameras import CameraInfo, CameraRecord

_ENDINGS: Final = (
    f"/{COMPRESSED_TOPIC}",
    "/image/compressed",
    f"/{DEPTH_TOPIC}",
    f"/{IMAGE_TOPIC}",
)
_STAMP_END: Final = 12
"""Bytes of a message before its frame: in ROS 2 encapsulation and stamp, in ROS 1 seq and stamp."""


class RecordedCamera(NamedTuple):
    """The topics of one camera in a bag."""

    name: str
    """Name of its folder."""
    base: str
    """Common start of the names of its topics."""
    images: TopicInfo | None
    depth: TopicInfo | None


def cameras_of_topics(topics: Sequence[TopicInfo]) -> list[RecordedCamera]:
    """Return the cameras among a bag's topics; of two topics of the same images the raw one.

    Names such as cam0 stay; others are numbered in the order of their topics.
    """
    cameras: dict[str, dict[str, TopicInfo]] = {}
    for topic in sorted(topics, key=lambda topic: (topic.type == COMPRESSED_IMAGE, topic.name)):
        is_mask_or_flow = topic.name.endswith((f"/{MASK_TOPIC}", f"/{FLOW_TOPIC}"))
        if topic.type in (IMAGE, COMPRESSED_IMAGE) and not is_mask_or_flow:
            kind = "depth" if topic.name.endswith(f"/{DEPTH_TOPIC}") else "images"
            cameras.setdefault(camera_namespace(topic.name), {}).setdefault(kind, topic)
    bases = sorted(cameras)
    names = [base.rpartition("/")[2] for base in bases]
    if not all(re.fullmatch(r"cam\d+", name) for name in names) or len(set(names)) < len(names):
        names = [f"cam{k}" for k in range(len(bases))]
    return [
        RecordedCamera(name, base, cameras[base].get("images"), cameras[base].get("depth"))
        for name, base in zip(names, bases, strict=True)
    ]


def is_rectified(topic: str) -> bool:
    """Return True for the name of a topic of rectified images (image_proc): image_rect, ..."""
    return topic.removesuffix("/compressed").rpartition("/")[2].startswith("image_rect")


def camera_namespace(topic: str) -> str:
    """Return the start of a topic's name that all topics of a camera share."""
    if is_rectified(topic):
        return topic.removesuffix("/compressed").rpartition("/")[0]
    for ending in _ENDINGS:
        if topic.endswith(ending):
            return topic.removesuffix(ending)
    return topic.rpartition("/")[0]


def camera_info(message: Message) -> CameraInfo:
    """Return a message of CameraInfo, of ROS 1 or ROS 2, as values."""
    values = {name.lower(): value for name, value in field_values(message).items()}
    d, k, r, p = (np.asarray(values[name]) for name in "dkrp")
    roi = message.roi
    return CameraInfo(
        int(message.height),
        int(message.width),
        str(message.distortion_model),
        tuple(d.tolist()),
        k.reshape(3, 3),
        r.reshape(3, 3),
        p.reshape(3, 4),
        (int(message.binning_x), int(message.binning_y)),
        (int(roi.x_offset), int(roi.y_offset), int(roi.height), int(roi.width)),
    )


def camera_records(
    bag: Bag, source: str, encoded_size: Callable[[bytes], tuple[int, int]]
) -> Iterator[CameraRecord]:
    """Yield a record for each topic of camera_info, with the size of the first image beside it.

    :param source: name of the file.
    :param encoded_size: returns height and width of an encoded image.
    """
    infos = [topic for topic in bag.topics if topic.type == CAMERA_INFO and topic.count]
    if not infos:
        return
    images = {
        camera.base: topic
        for camera in cameras_of_topics(bag.topics)
        for topic in (camera.images, camera.depth)
        if topic is not None and topic.count
    }
    sizes: dict[str, tuple[int, int]] = {}
    for base, topic in images.items():
        _, image = next(decode_messages(bag, [topic.name]), (None, None))
        if image is not None:
            raw = topic.type == IMAGE
            with errors_naming(bag.path, f" ({topic.name})"):
                sizes[base] = (
                    (int(image.height), int(image.width))
                    if raw
                    else encoded_size(image.data.tobytes())
                )
    for topic in infos:
        rows, descriptions = _changes(bag, topic)
        size = sizes.get(camera_namespace(topic.name))
        yield CameraRecord(f"{source}, {topic.name}", descriptions, rows, size)


def _changes(bag: Bag, topic: TopicInfo) -> tuple[tuple[int, ...], tuple[CameraInfo, ...]]:
    """Return numbers and contents of the messages that differ from the one before."""
    decode = schemas.decoder([(topic.type, topic.schema)], bag.encoding)
    previous, row = b"", 0
    rows, infos = [], []
    for group in bag.groups({topic.name}):
        for block in group:
            if block.topic.name != topic.name:
                continue
            for payload in as_list(block.payloads):
                content = bytes(payload[_STAMP_END:])
                if content != previous:
                    with errors_naming(bag.path, f" ({topic.name})"):
                        infos.append(camera_info(decode(payload, topic.type)))
                    rows.append(row)
                    previous = content
                row += 1
    return tuple(rows), tuple(infos)
