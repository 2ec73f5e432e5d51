# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images of a bag as files: EuRoC's ``cam0/data``, with ``sensor.yaml``, or kalibr_bagcreater's.

A camera is described by the bag: its model by CameraInfo, its mount by /tf_static.
"""

from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.cameras import RecordedCamera, camera_info, camera_namespace, is_rectified
from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.messages.encode_cameras import CAMERA_INFO, COMPRESSED_IMAGE
from imu_sim_ros.bags.messages.schemas import Message
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE
from imu_sim_ros.bags.outputs import write_bytes
from imu_sim_ros.bags.read import decode_messages
from imu_sim_ros.bags.reader import Bag
from imu_sim_ros.bags.threads import core_count
from imu_sim_ros.core.conventions import CAMERA_INFO_TOPIC, TF_STATIC_TOPIC
from imu_sim_ros.core.errors import InputError, name_source, system_error
from imu_sim_ros.core.gate import stamp_ns
from imu_sim_ros.core.types import AnyArray, Array
from imu_sim_ros.datasets.images import image_name, millimetres, write_table
from imu_sim_ros.datasets.recorded import (
    DEPTH_FOLDER,
    Description,
    OneSize,
    png_bytes,
    sensor_yaml,
)
from imu_sim_ros.datasets.transforms import Transforms, transform_to_root, transforms_of_message
from imu_sim_ros.recordings.cameras import CameraInfo, CameraRecord
from imu_sim_ros.recordings.findings.cameras import UNUSABLE
from imu_sim_ros.recordings.findings.catalogue import camera_findings
from imu_sim_ros.sensors.camera.images.files import Size, image_size, png
from imu_sim_ros.sensors.camera.images.libraries import opencv

_DEPTH: Final = "32FC1"
_PIXELS: Final = {
    **dict.fromkeys(("mono8", "8UC1"), ("u1", 1)),
    **{f"bayer_{order}8": ("u1", 1) for order in ("rggb", "bggr", "gbrg", "grbg")},
    **dict.fromkeys(("mono16", "16UC1"), ("u2", 1)),
    **dict.fromkeys(("rgb8", "bgr8", "8UC3"), ("u1", 3)),
    **dict.fromkeys(("rgb16", "bgr16"), ("u2", 3)),
    **dict.fromkeys(("rgba8", "bgra8", "8UC4"), ("u1", 4)),
    _DEPTH: ("f4", 1),
}
"""Type and number of the values of a pixel, by encoding."""
_AHEAD: Final = 4
"""Number of images in progress for each thread."""


class RecordedImages:
    """The images of a bag, to be written into a dataset's folder."""

    def __init__(self, bag: Bag, cameras: Sequence[RecordedCamera], folder: Path, form: str):
        """Make the folders.

        :param folder: existing folder.
        :param form: euroc, or csv, which has neither tables nor depth.
        :raises MissingDependencyError: if OpenCV is not installed.
        """
        opencv().setNumThreads(1)  # the images are distributed over threads here
        self._bag, self._folder, self._euroc = bag, folder, form == "euroc"
        self._folders: dict[str, Path] = {}
        self._cameras = {camera.name: camera for camera in cameras}
        self._stamps: dict[str, dict[int, None]] = {}
        self._frames: dict[str, str] = {}
        """Frame of each camera's messages, by base."""
        self._infos: dict[str, list[tuple[int, CameraInfo]]] = {}
        """Numbers and contents of the CameraInfo that differ from the one before, by base."""
        self._described: Counter[str] = Counter()
        """Number of CameraInfo of each camera, by base."""
        self._transforms: Transforms = {}
        for camera in cameras:
            self._make_folder(camera.images, folder / camera.name / ("data" if self._euroc else ""))
            if self._euroc:
                self._make_folder(camera.depth, folder / camera.name / DEPTH_FOLDER)

    def _make_folder(self, topic: TopicInfo | None, folder: Path) -> None:
        """Make the folder for the images of a topic, if there is such a topic."""
        if topic is None:
            return
        try:
            folder.mkdir(parents=True)
        except OSError as error:
            raise system_error(folder, error) from None
        self._folders[topic.name], self._stamps[topic.name] = folder, {}

    @property
    def topics(self) -> list[TopicInfo]:
        """Topics that are written."""
        return [topic for topic in self._bag.topics if topic.name in self._folders]

    @property
    def counts(self) -> dict[str, int]:
        """Number of images by topic."""
        return {name: len(stamps) for name, stamps in self._stamps.items()}

    @property
    def last_ns(self) -> int:
        """Last stamp [ns]; -1 without images."""
        return max((max(stamps, default=-1) for stamps in self._stamps.values()), default=-1)

    def write(
        self, advance: Callable[[int], object], comment: str, warn: Callable[[str], object]
    ) -> None:
        """Write all images, then tables and descriptions.

        :param advance: receives the number of images written.
        :param warn: receives a line for each description that does not fit its images.
        :raises InputError: for messages that are no images, with the topic.
        """
        pending: deque[tuple[str, Future[Size]]] = deque()
        sizes = {name: OneSize() for name in self._folders}

        def collect() -> None:
            name, future = pending.popleft()
            sizes[name].check(name, future.result())
            advance(1)

        jobs = core_count()
        pool = ThreadPoolExecutor(jobs, thread_name_prefix="images")
        try:
            for topic, message in decode_messages(self._bag, self._topics_to_read()):
                if topic.name not in self._folders:
                    self._learn(topic, message)
                    continue
                with name_source(topic.name):
                    stamp = message.header.stamp
                    t_ns = stamp_ns(int(stamp.sec), int(stamp.nanosec))
                self._stamps[topic.name][t_ns] = None
                self._frames.setdefault(camera_namespace(topic.name), message.header.frame_id)
                path = self._folders[topic.name] / image_name(t_ns)
                pending.append((topic.name, pool.submit(_write, topic, message, path)))
                if len(pending) >= _AHEAD * jobs:
                    collect()
            while pending:
                collect()
        finally:
            pool.shutdown(cancel_futures=True)
        if self._euroc:
            for name, camera in self._cameras.items():
                self._describe(name, camera, sizes, comment, warn)

    def _topics_to_read(self) -> set[str]:
        """Return the topics to read: images and descriptions of their cameras."""
        bases = {camera.base for camera in self._cameras.values()}
        announced = {
            topic.name
            for topic in self._bag.topics
            if (topic.type == CAMERA_INFO and camera_namespace(topic.name) in bases)
            or (topic.name, topic.type) == (TF_STATIC_TOPIC, TF_MESSAGE)
        }
        return {*self._folders, *(announced if self._euroc else ())}

    def _learn(self, topic: TopicInfo, message: Message) -> None:
        """Note a message that describes cameras: camera_info or a transform."""
        if topic.type != CAMERA_INFO:
            self._transforms.update(transforms_of_message(message))
            return
        base, info = camera_namespace(topic.name), camera_info(message)
        infos = self._infos.setdefault(base, [])
        if not infos or not info.is_equal(infos[-1][1]):
            infos.append((self._described[base], info))
        self._described[base] += 1

    def _describe(
        self,
        name: str,
        camera: RecordedCamera,
        sizes: Mapping[str, OneSize],
        comment: str,
        warn: Callable[[str], object],
    ) -> None:
        """Write the table of a camera's images, and its description.

        A camera_info that does not fit the images is left out, and told.
        """
        topic = camera.images or camera.depth
        assert topic is not None
        stamps = list(self._stamps[topic.name])
        if camera.images is not None:
            write_table(self._folder / name, stamps)
        numbered = self._infos.get(camera.base, [])
        info = None
        if numbered:
            rows, infos = zip(*numbered, strict=True)
            source = f"{self._bag.path}, {camera.base}/{CAMERA_INFO_TOPIC}"
            record = CameraRecord(source, infos, rows, sizes[topic.name].size)
            findings = camera_findings(record)
            for finding in findings:
                warn(finding.sentence())
            if not any(finding.kind in UNUSABLE for finding in findings):
                info = next(info for info in reversed(infos) if info.k[0, 0] > 0.0).of_image()
                if not (info.height and info.width):  # not stated
                    height, width = sizes[topic.name].size or (0, 0)
                    info = info._replace(height=height, width=width)
            else:
                warn(f"{name}/sensor.yaml: without intrinsics: those of camera_info do not hold")
        pose = transform_to_root(self._transforms, self._frames.get(camera.base, ""))
        if info is not None and is_rectified(topic.name):
            if pose is not None:
                pose = pose @ _unrectifying_rotation(info.r)
            info = info.rectified()
            warn(
                f"{name}/sensor.yaml: {topic.name} is rectified: intrinsics of P, no distortion"
                if info is not None
                else f"{name}/sensor.yaml: without intrinsics: {topic.name} is rectified, and P of "
                f"{camera.base}/{CAMERA_INFO_TOPIC} has no focal length"
            )
        text = sensor_yaml(Description(info, pose), stamps, comment)
        (self._folder / name / "sensor.yaml").write_text(text, encoding="utf-8")


def _unrectifying_rotation(rectification: Array) -> Array:
    """Return (4, 4) that maps points of the rectified camera into the camera.

    :param rectification: (3, 3) R of camera_info, from the camera into the rectified one.
    """
    matrix = np.eye(4)
    matrix[:3, :3] = rectification.T
    return matrix


def _write(topic: TopicInfo, message: Message, path: Path) -> Size:
    """Write the image of a message as PNG, and return its size.

    An image that is PNG already is unchanged.
    """
    if topic.type == COMPRESSED_IMAGE:
        data = message.data.tobytes()
        with name_source(topic.name):
            size, data = image_size(data), png_bytes(data)
    else:
        image = pixels(topic.name, message)
        size = image.shape[0], image.shape[1]
        data = png(millimetres(image) if image.dtype == np.float32 else image)
    write_bytes(path, data)
    return size


def pixels(topic: str, message: Message) -> AnyArray:
    """Return the image of a sensor_msgs/Image: (h, w), or (h, w, 3) in red, green and blue.

    :raises InputError: for an encoding that is not known, and sizes that contradict each other.
    """
    if message.encoding not in _PIXELS:
        raise InputError(
            f"{topic}: encoding {message.encoding!r}: must be one of {', '.join(_PIXELS)}"
        )
    code, count = _PIXELS[message.encoding]
    dtype = np.dtype(code).newbyteorder(">" if message.is_bigendian else "<")
    height, width, step = int(message.height), int(message.width), int(message.step)
    row = width * count * dtype.itemsize
    if step < row or len(message.data) < step * height or not row * height:
        raise InputError(
            f"{topic}: an image of {width} x {height} pixels, {message.encoding}, step {step}, "
            f"in {len(message.data)} bytes"
        )
    rows = np.asarray(message.data, np.uint8)[: step * height].reshape(height, step)[:, :row]
    values: AnyArray = np.ascontiguousarray(rows).view(dtype).astype(dtype.newbyteorder("="))
    if count == 1:
        return values
    values = values.reshape(height, width, count)[..., :3]
    return values if message.encoding.startswith("rgb") else values[..., ::-1]
