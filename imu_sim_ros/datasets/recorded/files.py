# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cameras of a dataset's folder, their tables, and what an image's file is."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.camera.images import JPEG, PNG, Size, decoded, examined, png
from imu_sim_ros.datasets.images import DEPTH_FOLDER
from imu_sim_ros.datasets.recorded.description import (
    Description,
    read_camchain,
    read_sensor_yaml,
)
from imu_sim_ros.errors import InputError, naming, system_error
from imu_sim_ros.inputs import (
    COLUMNS,
    STAMPS,
    VALUES,
    BadRows,
    Skipped,
    is_present,
    names_in,
    open_regular,
    read_text,
    row_blocks,
    shortened,
)

_WHAT: Final = "a table of stamps and file names"
_STAMP: Final = re.compile(r"[0-9]{1,19}")
_IMAGE: Final = re.compile(r"[0-9]{1,19}\.(png|jpe?g|bmp|pgm|tiff?)", re.IGNORECASE)
_PIXELS: Final = {
    (1, 1): "mono8",
    (1, 2): "mono16",
    (3, 1): "rgb8",
    (3, 2): "rgb16",
    (4, 1): "rgba8",
}
"""By number of channels, and bytes of each."""
_PNG_CHANNELS: Final = {0: 1, 2: 3, 3: 3, 4: 4, 6: 4}
"""Of PNG's kinds of colour, as OpenCV decodes them: grey, colour, palette, and with alpha."""


class Frames(NamedTuple):
    """n images of a camera, in time order."""

    folder: Path
    t_ns: NDArray[np.int64]
    names: list[str]


class FolderCamera(NamedTuple):
    """What a folder has of one camera."""

    name: str
    images: Frames
    depth: Frames | None
    described: Description
    text: str
    """Of its sensor.yaml; empty where there is none."""

    @property
    def frame(self) -> str:
        """The frame of its messages, as the simulator names it."""
        return f"{self.name}_optical_frame"


def folder_cameras(path: Path, skipped: Skipped | None = None) -> list[FolderCamera]:
    """Return the cameras of a EuRoC, TUM VI or kalibr_bagcreater folder: cam0, cam1, ...

    :param skipped: receives the number of bad rows skipped in a table; None: they are errors.
    :raises InputError: with a line for each row and each description that cannot be used.
    """
    found: dict[str, FolderCamera] = {}
    for place in text_reader.places(path):
        for name in text_reader.sensor_folders(place, "cam"):
            folder = place / name
            if name not in found:
                images = _images(folder, skipped)
                if images is not None:
                    depth = _listed(folder / DEPTH_FOLDER)
                    described, text = _described(path, folder)
                    camera = FolderCamera(name, images, depth, described, text)
                    found[name] = camera
    return list(found.values())


def _images(folder: Path, skipped: Skipped | None) -> Frames | None:
    table = folder / "data.csv"
    return _tabled(table, skipped) if is_present(table) else _listed(folder)


def _listed(folder: Path) -> Frames | None:
    """Return the images of a folder that are named by their stamps [ns]; None without any."""
    found = filter(_IMAGE.fullmatch, names_in(folder))
    names = sorted(found, key=lambda name: int(name.partition(".")[0]))
    stamps = [int(name.partition(".")[0]) for name in names]
    if stamps and stamps[-1] >= 1 << 63:
        raise InputError(f"{folder / names[-1]}: not a stamp in nanoseconds")
    return Frames(folder, np.array(stamps, dtype=np.int64), names) if names else None


def _tabled(table: Path, skipped: Skipped | None) -> Frames:
    """Return the images that a data.csv lists, all of which exist."""
    folder = table.parent / "data"
    there = set(names_in(folder))
    bad = BadRows(table)
    stamps: list[int] = []
    names: list[str] = []
    for number, fields in _rows(table):
        problem = _problem(fields, there, stamps[-1] if stamps else 0)
        if problem is None:
            stamps.append(int(fields[0]))
            names.append(fields[1])
            bad.good += 1
        else:
            bad.rows += 1
            bad.note(problem[0], number, problem[1])
    if skipped is None:
        bad.complain()
    elif bad.rows:
        skipped(bad.rows)
    return Frames(folder, np.array(stamps, dtype=np.int64), names)


def _rows(table: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield number and fields of each row."""
    first = True
    for rows in row_blocks(table, _WHAT):
        for number, line in rows:
            header = first and not line[:1].isdigit()
            first = False
            if not header:
                words = line.decode("utf-8", "replace").split(",")
                yield number, [word.strip() for word in words]


def _problem(fields: list[str], there: set[str], last_ns: int) -> tuple[str, str] | None:
    """Return class and words of what is wrong with a row; None for a good one."""
    if len(fields) != 2:
        return COLUMNS, f"{len(fields)} columns; expected nanoseconds and a file name"
    stamp, name = fields
    if not _STAMP.fullmatch(stamp) or int(stamp) >= 1 << 63:
        return STAMPS, f"{shortened(stamp)} is not a stamp in nanoseconds"
    if int(stamp) < last_ns:
        step = (last_ns - int(stamp)) * 1e-9
        return STAMPS, f"the stamp is {step:.9g} s before that of an earlier line"
    if name not in there:
        return VALUES, f"the image {shortened(name)} is not in data/"
    return None


def _described(path: Path, folder: Path) -> tuple[Description, str]:
    """Return what a dataset says about a camera, and the text of its sensor.yaml."""
    file = folder / "sensor.yaml"
    if is_present(file):
        return read_sensor_yaml(file), read_text(file)
    for root in (path, path.parent) if path.name == "mav0" else (path,):
        chain = root / "dso" / "camchain.yaml"
        if is_present(chain):
            return read_camchain(chain, folder.name), ""
    return Description(), ""


def read_image(path: Path) -> tuple[bytes, Size]:
    """Return the bytes of an image's file, and its size.

    :raises InputError: for what is no file, or no whole image.
    """
    with open_regular(path) as file, naming(path):
        try:
            data = file.read()
        except OSError as error:
            raise system_error(path, error) from None
        return data, image_size(data)


def image_size(data: bytes) -> Size:
    """Return the size of an encoded image, which is whole.

    :raises InputError: for one that is not.
    """
    size = examined(data)[0]
    if size is None:
        height, width = decoded(data).shape[:2]
        size = height, width
    return size


class OneSize:
    """The size that all images of a camera have: that of the first."""

    def __init__(self) -> None:
        self._first: Size | None = None

    def check(self, name: Path | str, size: Size) -> None:
        """Refuse an image of another size.

        :raises InputError: with both sizes.
        """
        first = self._first = self._first or size
        if size != first:
            raise InputError(
                f"{name}: {size[1]} x {size[0]} pixels; the images before it have "
                f"{first[1]} x {first[0]}"
            )


def as_png(data: bytes) -> bytes:
    """Return an encoded image as PNG; one that is PNG already stays as it is.

    :raises InputError: for bytes that are no image.
    """
    if data.startswith(PNG):
        return data
    image = decoded(data)
    return png(image[..., :3] if image.ndim > 2 else image)


def as_sent(data: bytes) -> tuple[str, str, bytes]:
    """Return form (png, jpeg), pixels' encoding and bytes of an image as CompressedImage has it.

    PNG and JPEG stay as they are.
    """
    if data.startswith(PNG):
        size = (_PNG_CHANNELS.get(data[25], 0), 2 if data[24] > 8 else 1)
        if size in _PIXELS:
            return "png", _PIXELS[size], data
    image = decoded(data)
    pixels = pixel_encoding(image)
    return ("jpeg", pixels, data) if data.startswith(JPEG) else ("png", pixels, png(image))


def pixel_encoding(image: NDArray[Any]) -> str:
    """Return the encoding of sensor_msgs/Image for an image (h, w) or (h, w, channels).

    :raises InputError: for pixels that it has no name for.
    """
    channels = 1 if image.ndim == 2 else image.shape[2]
    size = (channels, image.dtype.itemsize)
    if size not in _PIXELS or image.dtype.kind != "u":
        raise InputError(f"{channels} channels of {image.dtype}: a message cannot hold such pixels")
    return _PIXELS[size]
