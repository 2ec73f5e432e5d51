# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images and points that a bag holds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import arguments
from imu_sim_ros.arguments import BAG_OR_FILE
from imu_sim_ros.errors import InputError
from imu_sim_ros.types import Array


def read_images(path: str | Path, topic: str | None = None) -> Iterator[tuple[int, NDArray[Any]]]:
    """Yield the images of a camera in a bag.

    :param path: the bag.
    :param topic: topic of type sensor_msgs/Image or CompressedImage; needed if a bag has several.
    :returns: an iterator over stamps [ns] and images: (h, w), or (h, w, 3) in red, green and blue;
        uint8, uint16 or float32 as recorded.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read or decoded, or has no images.
    :raises MissingDependencyError: without OpenCV, for compressed images.

    >>> import imu_sim_ros as ims
    >>> made = ims.generate(folder / "seen.mcap", duration=0.2, cameras="euroc_cam0")
    >>> [image.shape for _, image in ims.read_images(folder / "seen.mcap")]
    [(480, 752), (480, 752), (480, 752), (480, 752)]
    """
    from imu_sim_ros.bags.messages.encode_cameras import COMPRESSED_IMAGE, IMAGE
    from imu_sim_ros.bags.read import open_bag

    path = arguments.path("path", path, BAG_OR_FILE)
    name = arguments.topic("topic", topic)
    with open_bag(path) as bag:
        offered = [one.name for one in bag.topics if one.type in (IMAGE, COMPRESSED_IMAGE)]
    chosen = [one for one in offered if name is None or one.strip("/") == name.strip("/")]
    if len(chosen) != 1:
        words = ", ".join(offered) or "no images"
        options = "" if name is None else f"no images on {name}; "
        raise InputError(f"{path}: {options}has {words}; topic= names one")
    return _images(Path(path), chosen[0])


def _images(path: Path, name: str) -> Iterator[tuple[int, NDArray[Any]]]:
    from imu_sim_ros.bags.messages import schemas
    from imu_sim_ros.bags.messages.blocks import as_list
    from imu_sim_ros.bags.messages.encode_cameras import IMAGE
    from imu_sim_ros.bags.read import open_bag
    from imu_sim_ros.bags.reader import errors_naming
    from imu_sim_ros.datasets.recorded_bag import pixels
    from imu_sim_ros.sensors.camera.images.files import decoded

    with open_bag(path) as bag:
        topic = next(one for one in bag.topics if one.name == name)
        types = schemas.typestore([(topic.type, topic.schema)], bag.encoding)
        decode = types.deserialize_cdr if bag.encoding == "cdr" else types.deserialize_ros1
        for group in bag.groups():
            for block in group:
                if block.topic.name != name:
                    continue
                for payload in as_list(block.payloads):
                    with errors_naming(path, f" ({name})"):
                        message: Any = decode(payload, topic.type)
                        stamp = message.header.stamp
                        t_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
                        raw = topic.type == IMAGE
                        image = pixels(name, message) if raw else decoded(bytes(message.data))
                    yield t_ns, np.asarray(image)


def read_cloud(path: Path, name: str) -> Array:
    """Return the points (n, 3) [m] of the first PointCloud2 of a topic; (0, 3): the bag has none.

    :raises InputError: for a cloud without x, y and z.
    """
    from imu_sim_ros.bags.messages import schemas
    from imu_sim_ros.bags.messages.blocks import as_list
    from imu_sim_ros.bags.read import open_bag
    from imu_sim_ros.bags.reader import errors_naming

    with open_bag(path) as bag:
        topic = next((one for one in bag.topics if one.name.strip("/") == name), None)
        if topic is None or not topic.count:
            return np.empty((0, 3))
        types = schemas.typestore([(topic.type, topic.schema)], bag.encoding)
        decode = types.deserialize_cdr if bag.encoding == "cdr" else types.deserialize_ros1
        blocks = (block for group in bag.groups() for block in group)
        payload = next(as_list(b.payloads)[0] for b in blocks if b.topic.name == topic.name)
        with errors_naming(path, f" ({name})"):
            return _points(decode(payload, topic.type), name)


def _points(cloud: Any, name: str) -> Array:
    kinds = {7: "f4", 8: "f8"}  # sensor_msgs/PointField
    fields = {one.name: (kinds.get(int(one.datatype)), int(one.offset)) for one in cloud.fields}
    if any(fields.get(axis, (None, 0))[0] is None for axis in "xyz"):
        raise InputError(f"{name}: a cloud without x, y and z as floating-point numbers")
    order = ">" if cloud.is_bigendian else "<"
    row = np.dtype(
        {
            "names": list("xyz"),
            "formats": [f"{order}{fields[axis][0]}" for axis in "xyz"],
            "offsets": [fields[axis][1] for axis in "xyz"],
            "itemsize": int(cloud.point_step),
        }
    )
    rows = np.frombuffer(bytes(cloud.data), dtype=row)
    return np.stack([rows[axis].astype(np.float64) for axis in "xyz"], axis=-1)
