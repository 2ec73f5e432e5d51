# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images and clouds that a bag holds, and the images of a folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from imu_sim_ros.core import arguments
from imu_sim_ros.core.arguments import BAG_OR_FILE, suggest_keywords
from imu_sim_ros.core.errors import InputError, name_source
from imu_sim_ros.core.gate import stamp_ns
from imu_sim_ros.core.types import AnyArray

if TYPE_CHECKING:
    from imu_sim_ros.datasets.recorded import RecordedFrames


@suggest_keywords
def read_images(path: str | Path, topic: str | None = None) -> Iterator[tuple[int, AnyArray]]:
    """Yield the images of a camera in a bag, or in a EuRoC, TUM VI or kalibr_bagcreater folder.

    :param path: the bag or the folder.
    :param topic: topic of type sensor_msgs/Image or CompressedImage, or ``cam0`` of a folder;
        needed if there are several.
    :returns: an iterator over stamps [ns] and images: (h, w), or (h, w, 3) in red, green and blue;
        uint8, uint16 or float32 as recorded.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read or decoded, or has no images.
    :raises MissingDependencyError: without OpenCV, for compressed images.

    >>> import imu_sim_ros as ims
    >>> _ = ims.generate(folder / "seen.mcap", duration=0.2, cameras="euroc_cam0")
    >>> [image.shape for _, image in ims.read_images(folder / "seen.mcap")]
    [(480, 752), (480, 752), (480, 752), (480, 752)]
    """
    from imu_sim_ros.bags.messages.encode_cameras import COMPRESSED_IMAGE, IMAGE
    from imu_sim_ros.bags.read import open_bag

    path = arguments.path("path", path, BAG_OR_FILE)
    name = arguments.topic("topic", topic)
    cameras = _cameras(path)
    if cameras is not None:
        offered = list(cameras)
    else:
        with open_bag(path) as bag:
            offered = [info.name for info in bag.topics if info.type in (IMAGE, COMPRESSED_IMAGE)]
    chosen = [
        topic_name
        for topic_name in offered
        if name is None or topic_name.strip("/") == name.strip("/")
    ]
    if len(chosen) != 1:
        available = ", ".join(offered) or "no images"
        options = "" if name is None else f"no images on {name}; "
        raise InputError(f"{path}: {options}has {available}; topic= names one")
    return _images(path, chosen[0]) if cameras is None else _camera_images(cameras[chosen[0]])


def camera_names(path: Path) -> list[str]:
    """Return the names of the cameras of a folder: cam0, cam1; none of a bag.

    :raises InputError: with a line for each row and each description that cannot be used.
    """
    return list(_cameras(path) or ())


def _cameras(path: Path) -> dict[str, RecordedFrames] | None:
    """Return the images of a folder by camera; None for a bag."""
    from imu_sim_ros.datasets.recorded import folder_cameras
    from imu_sim_ros.formats.door import has_topics

    if not path.is_dir() or has_topics(path):
        return None
    return {
        camera.name: camera.images for camera in folder_cameras(path) if camera.images is not None
    }


def _camera_images(frames: RecordedFrames) -> Iterator[tuple[int, AnyArray]]:
    """Yield stamps and pixels of the images in a camera's folder."""
    from imu_sim_ros.datasets.recorded import read_image
    from imu_sim_ros.sensors.camera.images.files import decode_image

    for t_ns, name in zip(frames.t_ns.tolist(), frames.names, strict=True):
        data, _ = read_image(frames.folder / name)
        with name_source(frames.folder / name):
            yield t_ns, np.asarray(decode_image(data))


def _images(path: Path, name: str) -> Iterator[tuple[int, AnyArray]]:
    """Yield stamps and pixels of a topic of images."""
    from imu_sim_ros.bags.messages import schemas
    from imu_sim_ros.bags.messages.blocks import as_list
    from imu_sim_ros.bags.messages.encode_cameras import IMAGE
    from imu_sim_ros.bags.read import open_bag
    from imu_sim_ros.bags.reader import errors_naming
    from imu_sim_ros.datasets.recorded_bag import pixels
    from imu_sim_ros.sensors.camera.images.files import decode_image

    with open_bag(path) as bag:
        topic = next(info for info in bag.topics if info.name == name)
        decode = schemas.decoder([(topic.type, topic.schema)], bag.encoding)
        for group in bag.groups():
            for block in group:
                if block.topic.name != name:
                    continue
                for payload in as_list(block.payloads):
                    with errors_naming(path, f" ({name})"):
                        message = decode(payload, topic.type)
                        stamp = message.header.stamp
                        t_ns = stamp_ns(int(stamp.sec), int(stamp.nanosec))
                        raw = topic.type == IMAGE
                        image = pixels(name, message) if raw else decode_image(bytes(message.data))
                    yield t_ns, np.asarray(image)


@suggest_keywords
def read_points(path: str | Path, topic: str | None = None) -> Iterator[tuple[int, AnyArray]]:
    """Yield the clouds that a bag holds.

    :param path: the bag.
    :param topic: topic of type sensor_msgs/PointCloud2; needed if a bag has several, but for those
        of the truth.
    :returns: an iterator over stamps [ns] and structured arrays (k,) with the fields of the
        message, such as x, y, z, intensity, ring and time.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read, or has no clouds.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(duration=0.2, sensors=["lidar"], scene={"type": "ground"})
    >>> path = flight.save(folder / "ranged.mcap")
    >>> [(t_ns, int(points["ring"].max())) for t_ns, points in ims.read_points(path)]
    [(1000000000, 1), (1100000000, 1)]
    """
    from imu_sim_ros.bags.clouds import cloud_topics, measured_cloud_topics, read_clouds

    path = arguments.path("path", path, BAG_OR_FILE)
    name = arguments.topic("topic", topic)
    offered, measured = cloud_topics(Path(path)), measured_cloud_topics(Path(path))
    chosen = (
        measured
        if name is None
        else [topic_name for topic_name in offered if topic_name.strip("/") == name.strip("/")]
    )
    if len(chosen) != 1:
        available = ", ".join(offered) or "no clouds"
        options = "" if name is None else f"no clouds on {name}; "
        raise InputError(f"{path}: {options}has {available}; topic= names one")
    return read_clouds(Path(path), chosen[0])
