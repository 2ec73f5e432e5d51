# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Features that a bag holds: sensor_msgs/PointCloud as VINS-Mono and VINS-Fusion send it."""

from collections.abc import Iterator
from itertools import islice
from typing import Final

import numpy as np

from imu_sim_ros.bags.clouds import is_truth
from imu_sim_ros.bags.messages.encode_cameras import POINT_CLOUD
from imu_sim_ros.bags.messages.schemas import Message
from imu_sim_ros.bags.read import decode_messages
from imu_sim_ros.bags.reader import Bag
from imu_sim_ros.core.gate import stamp_ns
from imu_sim_ros.recordings.tracks import FeatureTracks, TrackedFrame

_MOST: Final = 1200
"""Frames of a topic that are looked at: a minute of a camera at 20 Hz."""
_CHANNELS: Final = 5
"""Fewest channels of a feature: number, pixel, velocity (VINS-Mono, feature_tracker_node.cpp)."""
_CHANNELS_OF_SEVERAL: Final = 8
"""Fewest channels if the second is the number of a camera (VINS-Fusion, rosNodeTest.cpp)."""


def feature_tracks(bag: Bag, source: str) -> Iterator[FeatureTracks]:
    """Yield the features of the first camera of each topic of tracked features.

    :param source: name of the file.
    """
    for topic in bag.topics:
        if topic.type != POINT_CLOUD or not topic.count or is_truth(topic.name):
            continue
        messages = islice(decode_messages(bag, [topic.name]), _MOST)
        candidates = [_frame(message) for _, message in messages]
        frames = tuple(frame for frame in candidates if frame is not None)
        if frames:
            yield FeatureTracks(f"{source}, {topic.name}", frames)


def _frame(message: Message) -> TrackedFrame | None:
    """Return the features of a message; None: it has other channels or no features."""
    channels = [np.asarray(channel.values, np.float64) for channel in message.channels]
    points = np.array([(point.x, point.y, point.z) for point in message.points], np.float64)
    if len(channels) < _CHANNELS or not len(points) or {*map(len, channels)} != {len(points)}:
        return None
    lengths = np.linalg.norm(points, axis=1)
    usable = np.isfinite(lengths) & (lengths > 0.0) & np.isfinite(channels[0])
    if not usable.any():
        return None
    if len(channels) >= _CHANNELS_OF_SEVERAL:
        usable &= channels[1] == channels[1].min()
    ids, rows = np.unique(channels[0][usable].astype(np.int64), return_index=True)
    bearings = points[usable][rows] / lengths[usable][rows][:, None]
    stamp = message.header.stamp
    return TrackedFrame(stamp_ns(int(stamp.sec), int(stamp.nanosec)), ids, bearings)
