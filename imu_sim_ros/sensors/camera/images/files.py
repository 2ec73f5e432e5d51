# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images as files: encoded by OpenCV, read by Pillow, which is silent about damage and refuses it.

Only pixels of several channels with more than eight bits each, which Pillow reduces to eight, are
decoded by OpenCV, after Pillow has found the file to be whole.
"""

import importlib
import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

import numpy as np

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import AnyArray
from imu_sim_ros.sensors.camera.images.libraries import opencv

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

_DEEP: Final = 1
"""Compression level of 16-bit values, depths: their repetitions are found at all levels."""
PNG: Final = b"\x89PNG\r\n\x1a\n"
JPEG: Final = b"\xff\xd8\xff"
_PNG_END: Final = b"IEND\xaeB`\x82"
"""Name and checksum of the last chunk of a PNG."""
_JPEG_END: Final = b"\xff\xd9"
"""Mark at the end of a JPEG."""
_AHEAD: Final = 8
"""Bytes that libjpeg reads ahead at most."""
_MAX_PIXELS: Final = 1 << 27
_FORMS: Final = {
    PNG: "PNG",
    JPEG: "JPEG",
    b"BM": "BMP",
    **{b"P%d" % k: "PPM" for k in range(1, 7)},
    b"II*\0": "TIFF",
    b"MM\0*": "TIFF",
}
"""Forms of images by the first bytes of their files."""
_GREY: Final = ("L", "I", "I;16", "I;16B", "F")
"""Modes of Pillow with one channel of the file's own values."""

Size = tuple[int, int]
"""Height and width [px]."""


def png(image: AnyArray) -> bytes:
    """Return an image (h, w), or (h, w, 3) in red, green and blue, as the bytes of a PNG.

    OpenCV's own settings find runs of equal differences only. In images with noise there is little
    else to find: at 3.9 ms and 259 kB for one of EuRoC's camera, level 1 takes 9.9 ms for 256 kB.
    Smooth depths have more to find: 101 kB instead of 231 in 7.4 ms instead of 5.7.

    :raises InputError: if OpenCV refuses it.
    """
    cv2 = opencv()
    options = [cv2.IMWRITE_PNG_COMPRESSION, _DEEP] if image.dtype == np.uint16 else []
    ordered = image if image.ndim == 2 else image[..., ::-1]  # OpenCV's order is the other one
    done, encoded = cv2.imencode(".png", ordered, options)
    if not done:
        raise InputError(f"OpenCV cannot encode an image of {image.shape} as PNG")
    data: bytes = encoded.tobytes()
    return data


def image_size(data: bytes) -> Size:
    """Return the size of an encoded image; everything but the pixels of a JPEG is examined.

    :raises InputError: for bytes that are no image, damaged, cut off, or of more than 2^27 pixels.
    """
    form, image = _open(data)
    if form != "JPEG":
        with _refuse_damage(form):
            image.load()
    return image.height, image.width


def decode_image(data: bytes) -> AnyArray:
    """Return the pixels of an encoded image: (h, w), or (h, w, 3 or 4) in red, green, blue, alpha.

    Single bits are 0 and 255; palettes become colours, and grey values with alpha colours with it.

    :raises InputError: for bytes that are no image, damaged, cut off, or of more than 2^27 pixels.
    """
    form, image = _open(data)
    codec = str(image.tile)  # "ppm" is that of colours with another maximum than 255
    is_deep = image.mode not in _GREY and (";16" in codec or "'ppm'" in codec)
    with _refuse_damage(form):
        image.load()
    if is_deep:
        return _pixels_of_opencv(data)
    if image.mode in _GREY:
        pixels = np.asarray(image)
        # Pillow has 16 bits of a PGM as 32, and those of other forms in the file's order.
        return pixels if pixels.dtype.isnative and image.mode != "I" else pixels.astype(np.uint16)
    transparent = image.mode in ("LA", "PA", "RGBA") or "transparency" in image.info
    mode = "L" if image.mode == "1" else "RGBA" if transparent else "RGB"
    return np.asarray(image if image.mode == mode else image.convert(mode))


def _pixels_of_opencv(data: bytes) -> AnyArray:
    """Return the pixels (h, w, 3 or 4) of a complete image."""
    cv2 = opencv()
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim == 2:
        raise InputError(f"{len(data)} bytes that OpenCV cannot decode as a colour image")
    return np.ascontiguousarray(image[..., (2, 1, 0, 3)[: image.shape[2]]])


def _open(data: bytes) -> "tuple[str, ImageFile]":
    """Return form and header of an image, after checks of its size and of the end of the file."""
    form = next((form for magic, form in _FORMS.items() if data.startswith(magic)), "")
    if not form:
        raise InputError(
            f"{len(data)} bytes that are no image; PNG, JPEG, BMP, PGM, PPM and TIFF are read"
        )
    end = len(data.rstrip(b"\0")) - len(_JPEG_END)
    is_whole = {"PNG": _PNG_END in data, "JPEG": data[end:].startswith(_JPEG_END)}
    if not is_whole.get(form, True):
        raise InputError(f"a {form} that is cut off after {len(data)} bytes")
    plugin = importlib.import_module(f"PIL.{form.title()}ImagePlugin")
    reader = getattr(plugin, f"{form.title()}ImageFile")
    with _refuse_damage(form):
        image: ImageFile = reader(io.BytesIO(data))
        if form == "PNG":
            image.verify()  # the checksums
            image = reader(io.BytesIO(data))
        elif form == "JPEG" and "progressive" not in image.info:
            # Without the mark at the end lost pixels are an error; a progressive image needs it.
            image = reader(io.BytesIO(data[:end] + bytes(_AHEAD)))
    if image.width * image.height > _MAX_PIXELS:
        raise InputError(
            f"an image of {image.width} x {image.height} pixels; 1 to {_MAX_PIXELS:,} are read"
        )
    return form, image


@contextmanager
def _refuse_damage(form: str) -> Iterator[None]:
    """Turn the errors of Pillow, which are of many classes, into one of the input."""
    try:
        yield
    except (InputError, MemoryError):
        raise
    except Exception as error:
        reason = "its header states no pixels" if "not identified" in str(error) else error
        raise InputError(f"a {form} that is damaged: {reason}") from None
