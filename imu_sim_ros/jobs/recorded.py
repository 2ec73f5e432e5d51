# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images and clouds that a bag holds, and the images of a folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import arguments
from imu_sim_ros.arguments import BAG_OR_FILE
from imu_sim_ros.errors import InputError
from imu_sim_ros.types import Array

if TYPE_CHECKING:
    from imu_sim_ros.datasets.recorded import RecordedFrames


def read_images(path: str | Path, topic: str | None = None) -> Iterator[tuple[int, NDArray[Any]]]:
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
    >>> made = ims.generate(folder / "seen.mcap", duration=0.2, cameras="euroc_cam0")
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
            offered = [one.name for one in bag.topics if one.type in (IMAGE, COMPRESSED_IMAGE)]
    chosen = [one for one in offered if name is None or one.strip("/") == name.strip("/")]
    if len(chosen) != 1:
        words = ", ".join(offered) or "no images"
        options = "" if name is None else f"no images on {name}; "
        raise InputError(f"{path}: {options}has {words}; topic= names one")
    return _images(path, chosen[0]) if cameras is None else _of_camera(cameras[chosen[0]])


def camera_names(path: Path) -> list[str]:
    """Return the names of the cameras of a folder: cam0, cam1; none of a bag.

    :raises InputError: with a line for each row and each description that cannot be used.
    """
    return list(_cameras(path) or ())


def _cameras(path: Path) -> dict[str, RecordedFrames] | None:
    """Return the images of a folder by camera; None for a bag."""
    from imu_sim_ros.bags.text.reader import is_text
    from imu_sim_ros.datasets.recorded import folder_cameras

    if not (path.is_dir() and is_text(path)):
        return None
    return {camera.name: camera.images for camera in folder_cameras(path)}


def _of_camera(frames: RecordedFrames) -> Iterator[tuple[int, NDArray[Any]]]:
    from imu_sim_ros.datasets.recorded import read_image
    from imu_sim_ros.errors import naming
    from imu_sim_ros.sensors.camera.images.files import decoded

    for t_ns, name in zip(frames.t_ns.tolist(), frames.names, strict=True):
        data, _ = read_image(frames.folder / name)
        with naming(frames.folder / name):
            yield t_ns, np.asarray(decoded(data))


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


def read_points(path: str | Path, topic: str | None = None) -> Iterator[tuple[int, NDArray[Any]]]:
    """Yield the clouds of a LiDAR in a bag.

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
    path = arguments.path("path", path, BAG_OR_FILE)
    name = arguments.topic("topic", topic)
    offered, measured = _cloud_topics(Path(path)), measured_clouds(Path(path))
    chosen = (
        measured if name is None else [one for one in offered if one.strip("/") == name.strip("/")]
    )
    if len(chosen) != 1:
        words = ", ".join(offered) or "no clouds"
        options = "" if name is None else f"no clouds on {name}; "
        raise InputError(f"{path}: {options}has {words}; topic= names one")
    return _clouds(Path(path), chosen[0])


def measured_clouds(path: Path) -> list[str]:
    """Return the topics of clouds in a bag, without those of the truth."""
    return [name for name in _cloud_topics(path) if "ground_truth" not in name.split("/")]


def _cloud_topics(path: Path) -> list[str]:
    from imu_sim_ros.bags.messages.encode_cameras import POINT_CLOUD2
    from imu_sim_ros.bags.read import open_bag

    with open_bag(path) as bag:
        return [one.name for one in bag.topics if one.type == POINT_CLOUD2 and one.count]


def read_cloud(path: Path, name: str) -> Array:
    """Return the points (n, 3) [m] of the first PointCloud2 of a topic; (0, 3): the bag has none.

    :raises InputError: for a cloud without x, y and z.
    """
    from imu_sim_ros.bags.read import open_bag

    with open_bag(path) as bag:
        topic = next((one for one in bag.topics if one.name.strip("/") == name), None)
    if topic is None or not topic.count:
        return np.empty((0, 3))
    _, rows = next(_clouds(path, topic.name))
    return np.stack([rows[axis].astype(np.float64) for axis in "xyz"], axis=-1)


def _clouds(path: Path, name: str) -> Iterator[tuple[int, NDArray[Any]]]:
    from imu_sim_ros.bags.messages import schemas
    from imu_sim_ros.bags.messages.blocks import as_list
    from imu_sim_ros.bags.read import open_bag
    from imu_sim_ros.bags.reader import errors_naming

    with open_bag(path) as bag:
        topic = next(one for one in bag.topics if one.name == name)
        types = schemas.typestore([(topic.type, topic.schema)], bag.encoding)
        decode = types.deserialize_cdr if bag.encoding == "cdr" else types.deserialize_ros1
        for block in (block for group in bag.groups([name]) for block in group):
            for payload in as_list(block.payloads):
                with errors_naming(path, f" ({name})"):
                    message: Any = decode(payload, topic.type)
                    rows = _points(message, name)
                stamp = message.header.stamp
                yield int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec), rows


def _points(cloud: Any, name: str) -> NDArray[Any]:
    """Return the points (n,) of a message with all of its fields."""
    from imu_sim_ros.bags.messages.encode_cameras import POINT_TYPES

    kinds = {number: kind for kind, number in POINT_TYPES.items()}
    order = ">" if cloud.is_bigendian else "<"
    fields = {one.name: one for one in cloud.fields if int(one.datatype) in kinds}
    if any(axis not in fields or int(fields[axis].datatype) not in (7, 8) for axis in "xyz"):
        raise InputError(f"{name}: a cloud without x, y and z as floating-point numbers")
    formats: list[Any] = [order + kinds[int(one.datatype)] for one in fields.values()]
    counts = [max(int(one.count), 1) for one in fields.values()]
    row = np.dtype(
        {
            "names": list(fields),
            "formats": [f if n == 1 else (f, (n,)) for f, n in zip(formats, counts, strict=True)],
            "offsets": [int(one.offset) for one in fields.values()],
            "itemsize": int(cloud.point_step),
        }
    )
    return np.frombuffer(bytes(cloud.data), dtype=row)
