# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cameras of a recorded dataset: folder, tables, descriptions and image files."""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.core.bad_rows import (
    COLUMNS,
    STAMPS,
    VALUES,
    BadRows,
    Skipped,
)
from imu_sim_ros.core.errors import InputError, name_source, system_error
from imu_sim_ros.core.types import AnyArray, Array, Integers
from imu_sim_ros.inputs.rows import (
    is_present,
    names_in,
    open_regular,
    read_text,
    row_blocks,
    shorten_word,
)
from imu_sim_ros.recordings.cameras import PLUMB_BOB, CameraInfo, CameraRecord
from imu_sim_ros.recordings.clock import estimate_clock
from imu_sim_ros.sensors.camera import calibration_files
from imu_sim_ros.sensors.camera.images.files import JPEG, PNG, Size, decode_image, image_size, png

DEPTH_FOLDER: Final = "depth"
_TO_EUROC: Final = {
    "plumb_bob": "radial-tangential",
    "rational_polynomial": "radial-tangential8",
    **dict.fromkeys(("fisheye", "equidistant"), "equidistant"),
}
_SHAPES: Final = {"pinhole": (), "unified": ("xi",), "double_sphere": ("xi", "alpha")}
"""Numbers of each camera model in addition to the intrinsics of a pinhole."""


class Description(NamedTuple):
    """Properties of a camera; None if unknown."""

    info: CameraInfo | None = None
    pose: Array | None = None
    """T_bc (4, 4): maps points of the camera into the body."""


def pose_text(matrix: Array) -> str:
    """Return T_BS (4, 4) as in EuRoC's descriptions of sensors."""
    rows = ",\n         ".join(", ".join(decimal(value) for value in row) for row in matrix)
    return f"T_BS:\n  cols: 4\n  rows: 4\n  data: [{rows}]\n"


def sensor_yaml(camera: Description, stamps: Sequence[int], comment: str) -> str:
    """Return EuRoC's description of a camera, without unknown values."""
    text = f"# Camera\nsensor_type: camera\ncomment: {comment}\n\n"
    if camera.pose is not None:
        text += f"# T_BS maps points of the camera into the body.\n{pose_text(camera.pose)}\n"
    with suppress(InputError):  # fewer than two different stamps
        clock = estimate_clock(np.array(sorted(stamps), dtype=np.int64))
        text += f"rate_hz: {round(clock.rate, 3):g}\n"
    if camera.info is None:
        return text
    info, d = camera.info, camera.info.d
    model, kind = "pinhole", _TO_EUROC.get(info.distortion_model, info.distortion_model or "none")
    names = _SHAPES.get(info.distortion_model, ())
    if names:  # the spheres, whose numbers come first in D
        model, kind = info.distortion_model, "radial-tangential" if len(d) > len(names) else "none"
    shape = "".join(f"{name}: {decimal(value)}\n" for name, value in zip(names, d, strict=False))
    d = d[len(names) :] or (0.0,) * (4 if names else 0)
    if info.distortion_model == "plumb_bob" and len(d) == PLUMB_BOB and d[4] == 0.0:
        d = d[:4]
    if not d:
        kind, d = "none", (0.0,) * 4
    numbers = ", ".join(decimal(float(info.k[index])) for index in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return (
        f"{text}resolution: [{info.width}, {info.height}]\ncamera_model: {model}\n{shape}"
        f"intrinsics: [{numbers}] # fu, fv, cu, cv\ndistortion_model: {kind}\n"
        f"distortion_coefficients: [{', '.join(decimal(float(value)) for value in d)}]\n"
    )


_CONTENT: Final = "a table of stamps and file names"
_STAMP: Final = re.compile(r"[0-9]{1,19}")
_IMAGE: Final = re.compile(r"[0-9]{1,19}\.(png|jpe?g|bmp|pgm|tiff?)", re.IGNORECASE)
_PIXELS: Final = {
    (1, 1): "mono8",
    (1, 2): "mono16",
    (3, 1): "rgb8",
    (3, 2): "rgb16",
    (4, 1): "rgba8",
}
"""Encoding by number of channels and bytes of each."""
_PNG_CHANNELS: Final = {0: 1, 2: 3, 3: 3, 4: 4, 6: 4}
"""Channels by PNG's colour type, as OpenCV decodes them: grey, colour, palette, with alpha."""


class RecordedFrames(NamedTuple):
    """n images of a camera in time order."""

    folder: Path
    t_ns: Integers
    names: list[str]


class FolderCamera(NamedTuple):
    """The files of one camera in a folder."""

    name: str
    images: RecordedFrames | None
    depth: RecordedFrames | None
    description: Description
    text: str
    """Text of the camera's sensor.yaml; empty if there is none."""

    @property
    def frame(self) -> str:
        """Frame of the camera's messages, as in the simulator."""
        return f"{self.name}_optical_frame"

    @property
    def first_ns(self) -> int:
        """Stamp of its first image or depth [ns]; -1 without any."""
        parts = [frames.t_ns[:1] for frames in (self.images, self.depth) if frames is not None]
        return int(min(np.concatenate(parts).tolist(), default=-1))

    def record(self) -> CameraRecord | None:
        """Return its description and the size of its first image; None: it has no description.

        :raises InputError: for a first image that cannot be read.
        """
        frames = self.depth if self.images is None else self.images
        if self.description.info is None or frames is None:
            return None
        path = frames.folder / frames.names[0] if frames.names else None
        size = None if path is None else read_image(path)[1]
        return CameraRecord(str(frames.folder), (self.description.info,), (0,), size)


def folder_cameras(path: Path, skipped: Skipped | None = None) -> list[FolderCamera]:
    """Return the cameras of a EuRoC, TUM VI or kalibr_bagcreater folder: cam0, cam1, ...

    :param skipped: receives the number of bad rows skipped in a table; None: they are errors.
    :raises InputError: with a line for each row and each description that cannot be used.
    """
    cameras: dict[str, FolderCamera] = {}
    for parent in text_reader.parents(path):
        for name in text_reader.sensor_folders(parent, "cam"):
            folder = parent / name
            if name not in cameras:
                images = _images(folder, skipped)
                depth = _find_stamped_images(folder / DEPTH_FOLDER)
                if images is not None or depth is not None:
                    description, text = _read_description(path, folder)
                    camera = FolderCamera(name, images, depth, description, text)
                    cameras[name] = camera
    return list(cameras.values())


def _images(folder: Path, skipped: Skipped | None) -> RecordedFrames | None:
    """Return the images of a camera's folder: those of its table, or all with stamps as names."""
    table = folder / "data.csv"
    return _read_image_list(table, skipped) if is_present(table) else _find_stamped_images(folder)


def _find_stamped_images(folder: Path) -> RecordedFrames | None:
    """Return the images of a folder that are named by their stamps [ns]; None without any."""
    image_names = filter(_IMAGE.fullmatch, names_in(folder))
    names = sorted(image_names, key=lambda name: int(name.partition(".")[0]))
    stamps = [int(name.partition(".")[0]) for name in names]
    if stamps and stamps[-1] >= 1 << 63:
        raise InputError(f"{folder / names[-1]}: not a stamp in nanoseconds")
    return RecordedFrames(folder, np.array(stamps, dtype=np.int64), names) if names else None


def _read_image_list(table: Path, skipped: Skipped | None) -> RecordedFrames:
    """Return the images of a data.csv, all of which must exist."""
    folder = table.parent / "data"
    files = set(names_in(folder))
    bad = BadRows(table)
    stamps: list[int] = []
    names: list[str] = []
    for number, fields in _rows(table):
        problem = _problem(fields, files, stamps[-1] if stamps else 0)
        if problem is None:
            stamp, name = fields[:2]
            stamps.append(int(stamp))
            names.append(name)
            bad.good += 1
        else:
            reason, line = problem
            bad.rows += 1
            bad.note(reason, number, line)
    if skipped is None:
        bad.complain()
    elif bad.rows:
        skipped(bad.rows)
    return RecordedFrames(folder, np.array(stamps, dtype=np.int64), names)


def _rows(table: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield number and fields of each row."""
    is_first = True
    for rows in row_blocks(table, _CONTENT):
        for number, line in rows:
            header = is_first and not line[:1].isdigit()
            is_first = False
            if not header:
                fields = line.decode("utf-8", "replace").split(",")
                yield number, [field.strip() for field in fields]


def _problem(fields: list[str], files: set[str], last_ns: int) -> tuple[str, str] | None:
    """Return kind and description of the problem of a row; None for a good one."""
    if len(fields) != 2:
        return COLUMNS, f"{len(fields)} columns; expected nanoseconds and a file name"
    stamp, name = fields
    if not _STAMP.fullmatch(stamp) or int(stamp) >= 1 << 63:
        return STAMPS, f"{shorten_word(stamp)} is not a stamp in nanoseconds"
    if int(stamp) < last_ns:
        step = (last_ns - int(stamp)) * 1e-9
        return STAMPS, f"the stamp is {step:.9g} s before that of an earlier line"
    if name not in files:
        return VALUES, f"the image {shorten_word(name)} is not in data/"
    return None


def _read_description(path: Path, folder: Path) -> tuple[Description, str]:
    """Return the properties of a camera in a dataset, and the text of its sensor.yaml."""
    file = folder / "sensor.yaml"
    if is_present(file):
        return Description(*calibration_files.description(file)), read_text(file)
    for root in (path, path.parent) if path.name == "mav0" else (path,):
        chain = root / "dso" / "camchain.yaml"
        if is_present(chain):
            return Description(*calibration_files.description(chain, folder.name)), ""
    return Description(), ""


def read_image(path: Path) -> tuple[bytes, Size]:
    """Return the bytes of an image's file, and its size.

    :raises InputError: if it is not a file, or not a complete image.
    """
    with open_regular(path) as file, name_source(path):
        try:
            data = file.read()
        except OSError as error:
            raise system_error(path, error) from None
        return data, image_size(data)


class OneSize:
    """Check that all images of a camera have the size of the first."""

    def __init__(self) -> None:
        self.size: Size | None = None
        """Height and width of the first image; None: there is none yet."""

    def check(self, name: Path | str, size: Size) -> None:
        """Refuse an image of another size.

        :raises InputError: with both sizes.
        """
        expected = self.size = self.size or size
        if size != expected:
            raise InputError(
                f"{name}: {size[1]} x {size[0]} pixels; the images before it have "
                f"{expected[1]} x {expected[0]}"
            )


def png_bytes(data: bytes) -> bytes:
    """Return an encoded image as PNG; a PNG image is unchanged.

    :raises InputError: for bytes that are no image.
    """
    if data.startswith(PNG):
        return data
    image = decode_image(data)
    return png(image[..., :3] if image.ndim > 2 else image)


def compressed_image(data: bytes) -> tuple[str, str, bytes]:
    """Return format (png, jpeg), pixel encoding and bytes of an image as CompressedImage has them.

    PNG and JPEG are unchanged.
    """
    if data.startswith(PNG):
        size = (_PNG_CHANNELS.get(data[25], 0), 2 if data[24] > 8 else 1)
        if size in _PIXELS:
            return "png", _PIXELS[size], data
    image = decode_image(data)
    pixels = pixel_encoding(image)
    return ("jpeg", pixels, data) if data.startswith(JPEG) else ("png", pixels, png(image))


def pixel_encoding(image: AnyArray) -> str:
    """Return the encoding of sensor_msgs/Image for an image (h, w) or (h, w, channels).

    :raises InputError: for pixels that it has no name for.
    """
    channels = 1 if image.ndim == 2 else image.shape[2]
    size = (channels, image.dtype.itemsize)
    if size not in _PIXELS or image.dtype.kind != "u":
        raise InputError(f"{channels} channels of {image.dtype}: a message cannot hold such pixels")
    return _PIXELS[size]
