# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images of a dataset's folder as messages, or in another folder.

EuRoC's and TUM VI's ``cam0/data.csv`` and ``cam0/data``, or kalibr_bagcreater's
``cam0/<stamp>.png``; the camera's model and mount from ``sensor.yaml``, or TUM VI's
``dso/camchain.yaml``. Threads decode images ahead of the writer; their number in memory is
bounded.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.messages.encode_cameras import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    CameraInfoEncoder,
    CompressedImageEncoder,
    ImageEncoder,
)
from imu_sim_ros.bags.messages.schemas import LATCHED
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE, TransformsEncoder
from imu_sim_ros.bags.outputs import write_bytes
from imu_sim_ros.bags.threads import core_count
from imu_sim_ros.bags.writer import BagTopic, Block, Writer
from imu_sim_ros.core.bad_rows import Skipped
from imu_sim_ros.core.conventions import (
    BODY_FRAME,
    CAMERA_INFO_TOPIC,
    COMPRESSED_TOPIC,
    DEPTH_TOPIC,
    IMAGE_TOPIC,
    TF_STATIC_TOPIC,
)
from imu_sim_ros.core.errors import InputError, name_source, system_error, warn
from imu_sim_ros.datasets.images import image_name, write_table
from imu_sim_ros.datasets.recorded import (
    DEPTH_FOLDER,
    FolderCamera,
    OneSize,
    RecordedFrames,
    compressed_image,
    folder_cameras,
    pixel_encoding,
    png_bytes,
    read_image,
    sensor_yaml,
)
from imu_sim_ros.recordings.findings.cameras import UNUSABLE
from imu_sim_ros.recordings.findings.catalogue import camera_findings
from imu_sim_ros.sensors.camera.images.files import Size, decode_image

KINDS: Final = {
    "raw": (IMAGE_TOPIC,),
    "compressed": (COMPRESSED_TOPIC,),
    "both": (IMAGE_TOPIC, COMPRESSED_TOPIC),
}
"""Topics of a camera's images below its name, by value of ``camera.images``."""
_TYPES: Final = {
    IMAGE_TOPIC: IMAGE,
    COMPRESSED_TOPIC: COMPRESSED_IMAGE,
    DEPTH_TOPIC: IMAGE,
    CAMERA_INFO_TOPIC: CAMERA_INFO,
}
_BATCH: Final = 8
"""Number of images of a camera that are written at once."""
_PREFETCHED: Final = 4
"""Number of further images in progress for each thread."""

Messages = dict[str, bytes]
"""Messages of one frame, by topic below the camera's name."""


class FolderImages:
    """The images of a folder, to be written elsewhere; use as a context manager."""

    def __init__(self, path: Path, skipped: Skipped | None = None) -> None:
        """Find the cameras of the folder.

        :param path: the folder; any other path has no images.
        :param skipped: receives the number of bad rows skipped in a table; None: they are errors.
        :raises InputError: with a line for each row and each description that cannot be used.
        """
        self.cameras = folder_cameras(path, skipped)
        records = [camera.record() for camera in self.cameras]
        findings = [finding for camera in records if camera for finding in camera_findings(camera)]
        if any(finding.kind in UNUSABLE for finding in findings):
            raise InputError([finding.sentence() for finding in findings])
        for finding in findings:
            warn(finding.sentence())
        jobs = core_count()
        self._prefetched = _BATCH + _PREFETCHED * jobs
        self._pool = ThreadPoolExecutor(jobs, thread_name_prefix="images")

    def __enter__(self) -> "FolderImages":
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def streams(
        self, writer: Writer, renamed: Mapping[str, str], kind: str
    ) -> list[Iterator[list[Block]]]:
        """Return streams of blocks in time order, one for each camera, its depth, and its mount.

        :param renamed: output names by topic.
        :param kind: raw, compressed or both.
        """
        streams = [self._mounts(writer, renamed)]
        for camera in self.cameras:
            keys = (*KINDS[kind], *([CAMERA_INFO_TOPIC] if camera.description.info else []))
            depth_keys = [DEPTH_TOPIC]
            if camera.images is not None:
                streams.append(self._stream(writer, renamed, camera, camera.images, keys))
            elif camera.description.info:
                depth_keys.append(CAMERA_INFO_TOPIC)
            if camera.depth is not None:
                streams.append(self._stream(writer, renamed, camera, camera.depth, depth_keys))
        return streams

    def _stream(
        self,
        writer: Writer,
        renamed: Mapping[str, str],
        camera: FolderCamera,
        frames: RecordedFrames,
        keys: Sequence[str],
    ) -> Iterator[list[Block]]:
        """Yield the images of a camera as messages, in blocks."""
        topics: dict[str, BagTopic] = {}
        for key in keys:
            name = f"/{camera.name}/{key}"
            topics[key] = writer.add_topic(renamed.get(name, name), _TYPES[key])
        maker = _Maker(camera, keys, writer.encoding)
        count = len(frames.t_ns)
        orders = iter(range(count))
        sizes = OneSize()
        pending: deque[tuple[Path, Future[tuple[Size, Messages]]]] = deque()
        for start in range(0, count, _BATCH):
            for k in islice(orders, self._prefetched - len(pending)):
                t_ns, path = int(frames.t_ns[k]), frames.folder / frames.names[k]
                pending.append((path, self._pool.submit(maker.messages, t_ns, path)))
            block_t_ns, frames_messages = frames.t_ns[start : start + _BATCH], list[Messages]()
            for _ in block_t_ns:
                path, future = pending.popleft()
                size, messages = future.result()
                sizes.check(path, size)
                frames_messages.append(messages)
            yield [
                Block(topics[key], block_t_ns, [messages[key] for messages in frames_messages])
                for key in keys
            ]

    def _mounts(self, writer: Writer, renamed: Mapping[str, str]) -> Iterator[list[Block]]:
        """Yield the mounts of the cameras on the body, once."""
        mounted_cameras = [
            c for c in self.cameras if c.description.pose is not None and c.first_ns >= 0
        ]
        if not mounted_cameras:
            return
        poses = np.stack(
            [c.description.pose for c in mounted_cameras if c.description.pose is not None]
        )
        names = [(BODY_FRAME, c.frame) for c in mounted_cameras]
        t_ns = np.array([min(c.first_ns for c in mounted_cameras)])
        rows = TransformsEncoder(names, writer.encoding).encode_fixed(t_ns, poses)
        name = renamed.get(TF_STATIC_TOPIC, TF_STATIC_TOPIC)
        yield [Block(writer.add_topic(name, TF_MESSAGE, [LATCHED]), t_ns, rows)]

    def copy(
        self, folder: Path, form: str, comment: str, advance: Callable[[int], object]
    ) -> dict[str, int]:
        """Copy all images into another folder, as PNG; return their number by topic.

        :param folder: existing folder.
        :param form: euroc, or csv, which has neither tables nor depth.
        """
        counts = {}
        for camera in self.cameras:
            target = folder / camera.name
            if camera.images is not None:
                self._copy(camera.images, target / ("data" if form == "euroc" else ""), advance)
                counts[f"/{camera.name}/{IMAGE_TOPIC}"] = len(camera.images.t_ns)
            if form != "euroc":
                continue
            frames = camera.images if camera.images is not None else camera.depth
            stamps = [] if frames is None else frames.t_ns.tolist()
            if camera.depth is not None:
                self._copy(camera.depth, target / DEPTH_FOLDER, advance)
                counts[f"/{camera.name}/{DEPTH_TOPIC}"] = len(camera.depth.t_ns)
            if camera.images is not None:
                write_table(target, stamps)
            text = camera.text or sensor_yaml(camera.description, stamps, comment)
            try:
                (target / "sensor.yaml").write_text(text, encoding="utf-8")
            except OSError as error:
                raise system_error(target / "sensor.yaml", error) from None
        return counts

    def _copy(self, frames: RecordedFrames, target: Path, advance: Callable[[int], object]) -> None:
        """Copy the images of a camera into another folder, as PNG."""
        try:
            target.mkdir(parents=True)
        except OSError as error:
            raise system_error(target, error) from None
        orders = zip(frames.t_ns.tolist(), frames.names, strict=True)
        sizes = OneSize()
        pending: deque[tuple[Path, Future[Size]]] = deque()
        while True:
            for t_ns, name in islice(orders, self._prefetched - len(pending)):
                path, copy = frames.folder / name, target / image_name(t_ns)
                pending.append((path, self._pool.submit(_copy_image, path, copy)))
            if not pending:
                return
            path, future = pending.popleft()
            sizes.check(path, future.result())
            advance(1)


def _copy_image(path: Path, target: Path) -> Size:
    """Copy an image as PNG; return its size."""
    data, size = read_image(path)
    with name_source(path):
        data = png_bytes(data)
    write_bytes(target, data)
    return size


class _Maker:
    """Converter of one camera's files to the messages of its topics; thread-safe."""

    def __init__(self, camera: FolderCamera, keys: Sequence[str], encoding: str) -> None:
        self._frame, self._keys, self._encoding = camera.frame, keys, encoding
        self._info = None
        if camera.description.info is not None:
            self._info = CameraInfoEncoder(camera.frame, camera.description.info, encoding)

    def messages(self, t_ns: int, path: Path) -> tuple[Size, Messages]:
        """Return the size and the messages of an image."""
        data, size = read_image(path)
        with name_source(path):
            return size, {key: self._message(key, t_ns, data) for key in self._keys}

    def _message(self, key: str, t_ns: int, data: bytes) -> bytes:
        """Return the message of one of the camera's topics for an image."""
        if key == CAMERA_INFO_TOPIC:
            assert self._info is not None
            return self._info.encode(t_ns)
        if key == COMPRESSED_TOPIC:
            form, pixels, data = compressed_image(data)
            return CompressedImageEncoder(self._frame, pixels, self._encoding, form).encode(
                t_ns, data
            )
        image = decode_image(data)
        pixels = pixel_encoding(image)
        if key == DEPTH_TOPIC and pixels == "mono16":
            pixels = "16UC1"  # millimetres (REP 118), not grey values
        height, width = image.shape[:2]
        return ImageEncoder(self._frame, height, width, pixels, self._encoding).encode(t_ns, image)
