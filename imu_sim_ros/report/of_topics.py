# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All topics of a bag in one pass: rates, gaps and sizes, true biases, and a strip of images."""

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags import Bag, open_bag, told, vector_blocks
from imu_sim_ros.bags.messages import (
    COMPRESSED_IMAGE,
    IMAGE,
    VECTOR3_STAMPED,
    MessageBlock,
    TopicInfo,
    as_list,
    schemas,
)
from imu_sim_ros.errors import ImuSimError
from imu_sim_ros.report.page import Item, table
from imu_sim_ros.report.streams import GAP, extremes

Array = NDArray[np.float64]

_FIRST: Final = 64
"""Messages whose median interval is the usual one."""
_IMAGES: Final = 6
"""Images of each camera."""
_WIDTH: Final = 180
"""Pixels of an image of the strip."""
_MOST_CAMERAS: Final = 4
_IMAGE_TYPES: Final = (IMAGE, COMPRESSED_IMAGE)
_UNITS: Final = {"gyroscope": "rad/s", "accelerometer": "m/s^2", "magnetometer": "T"}


class _Passed:
    """What has passed of a topic."""

    def __init__(self, topic: TopicInfo) -> None:
        self.topic = topic
        self.count, self.size, self.gaps, self.longest = 0, 0, 0, 0.0
        self.interval: float | None = None
        self.ends: tuple[int, int] | None = None
        self.images: list[tuple[int, bytes]] = []
        self._waiting: list[NDArray[np.int64]] = []
        wanted = topic.type in _IMAGE_TYPES and topic.count
        places = np.linspace(0, topic.count - 1, _IMAGES) if wanted else np.empty(0)
        self._wanted = sorted(set(places.round().astype(int).tolist()))

    def add(self, block: MessageBlock) -> None:
        payloads, count = block.payloads, len(block.t_ns)
        if not count:
            return
        listed = isinstance(payloads, list)
        self.size += sum(map(len, payloads)) if listed else int(payloads.size)  # type: ignore[union-attr]
        for place in [one for one in self._wanted if self.count <= one < self.count + count]:
            k = place - self.count
            self.images.append((int(block.t_ns[k]), as_list(payloads[k : k + 1])[0]))
        self.count += count
        first = self.ends[0] if self.ends else int(block.t_ns[0])
        before = self.ends[1] if self.ends else int(block.t_ns[0])
        self.ends = (first, int(block.t_ns[-1]))
        self._waiting.append(np.diff(block.t_ns, prepend=before)[0 if self.count > count else 1 :])
        if self.count > _FIRST:
            self.close()

    def close(self) -> None:
        """Count the gaps of what has come."""
        steps = np.concatenate([np.empty(0, np.int64), *self._waiting]) * 1e-9
        self._waiting = []
        if self.interval is None and (steps > 0.0).any():
            self.interval = float(np.median(steps[steps > 0.0]))
        if self.interval is not None and len(steps):
            self.gaps += int(np.count_nonzero(steps > GAP * self.interval))
            self.longest = max(self.longest, float(steps.max()))

    def row(self) -> list[Any]:
        duration = (self.ends[1] - self.ends[0]) * 1e-9 if self.ends else 0.0
        rate = None if self.interval is None else 1.0 / self.interval
        mean = None if duration <= 0.0 else (self.count - 1) / duration
        each = self.size / self.count if self.count else None
        named = [self.topic.name, self.topic.type, self.count, rate, mean]
        gaps = [None, None] if self.interval is None else [self.gaps, self.longest]
        return [*named, *gaps, each, self.size * 1e-6]


def topic_items(path: Path, topics: Sequence[TopicInfo]) -> list[Item]:
    """Return the table of a bag's topics, and the strips of its cameras."""
    passed = {topic.name: _Passed(topic) for topic in topics}
    strips = []
    with open_bag(path) as bag:
        for group in bag.groups():
            for block in group:
                passed[block.topic.name].add(block)
        for one in passed.values():
            one.close()
        cameras = [one for one in passed.values() if one.images][:_MOST_CAMERAS]
        strips = [_strip(bag, one) for one in cameras]
    header = ["topic", "type", "messages", "rate [Hz]", "mean rate [Hz]"]
    header += ["gaps", "longest [s]", "bytes each", "MB"]
    rows = [one.row() for one in passed.values()]
    words = (
        f"The rate is that of the usual interval between record times; a gap is longer than "
        f"{GAP:g} of it. Sizes are those of the messages, before compression."
    )
    items = [table("topics", header, rows, search=False), {"kind": "text", "text": words}]
    items[-1]["faint"] = True
    return items + strips


def _strip(bag: Bag, passed: _Passed) -> Item:
    """Return images of a camera over the time, small; what cannot be decoded is said."""
    from imu_sim_ros.camera.images import png

    topic, (first_ns, _) = passed.topic, passed.images[0]
    types = schemas.typestore([(topic.type, topic.schema)], bag.encoding)
    decode = types.deserialize_cdr if bag.encoding == "cdr" else types.deserialize_ros1
    frames: list[Item] = []
    try:
        for t_ns, payload in passed.images:
            with told(bag.path, f" ({topic.name})"):
                message = decode(payload, topic.type)
            data = base64.b64encode(png(_small(topic, message))).decode()
            frames.append({"t_s": (t_ns - first_ns) * 1e-9, "png": data})
    except ImuSimError as error:
        return {"kind": "text", "text": f"{topic.name}: {error}"}
    return {"kind": "strip", "title": topic.name, "frames": frames}


def _small(topic: TopicInfo, message: Any) -> NDArray[np.uint8]:
    """Return the image of a message, 8 bits deep, its pixels averaged to a small width."""
    from imu_sim_ros.camera.images import decoded
    from imu_sim_ros.datasets.recorded import pixels

    raw = topic.type == IMAGE
    image = pixels(topic.name, message) if raw else decoded(bytes(message.data))
    image = np.asarray(image[..., :3] if image.ndim == 3 else image)
    every = max(1, -(-image.shape[1] // _WIDTH))
    height, width = (size // every * every for size in image.shape[:2])
    if not height or not width:
        every, (height, width) = 1, image.shape[:2]
    parts = image[:height, :width].astype(np.float32)
    parts = parts.reshape(height // every, every, width // every, every, *image.shape[2:])
    small = np.nan_to_num(parts.mean(axis=(1, 3)), posinf=0.0, neginf=0.0)
    if image.dtype != np.uint8:  # depths and deep grey values: their own range
        low, high = float(small.min()), float(small.max())
        small = (small - low) * (255.0 / max(high - low, 1e-9))
    found: NDArray[np.uint8] = small.round().astype(np.uint8)
    return found


def bias_series(path: Path, topics: Sequence[TopicInfo]) -> list[tuple[str, str, list[Item]]]:
    """Return title, unit and lines of every bias that a bag has as Vector3Stamped."""
    found = []
    for topic in topics:
        if topic.type != VECTOR3_STAMPED or "bias" not in topic.name or not topic.count:
            continue
        times, vectors = zip(*vector_blocks(path, topic.name, gated=False), strict=True)
        t_ns, values = np.concatenate(times), np.concatenate(vectors)
        t_s = (t_ns - t_ns[0]) * 1e-9
        series = []
        for k, axis in enumerate("xyz"):
            rows = extremes(values[:, k])
            line = {"name": axis, "colour": k, "x": t_s[rows], "y": values[rows, k]}
            series.append(line | {"thin": True})
        unit = next((unit for name, unit in _UNITS.items() if name in topic.name), "")
        found.append((f"Bias: {topic.name}", unit, series))
    return found
