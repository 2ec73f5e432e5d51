# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images as files: encoded, and examined before anything decodes them."""

import io
import re
import struct
import zlib
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Bytes
from imu_sim_ros.sensors.camera.images.libraries import opencv

_DEEP: Final = 1
"""Compression level of 16-bit values, depths: their repetitions are found at all levels."""


def png(image: NDArray[Any]) -> bytes:
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


def decoded(data: bytes) -> NDArray[Any]:
    """Return an encoded image as it is: (h, w), or (h, w, 3 or 4) in red, green, blue, alpha.

    :raises InputError: for bytes that are damaged, cut off, or that OpenCV cannot decode.
    """
    cv2 = opencv()
    data = examined(data)[1]
    if data.startswith(JPEG):
        return _pixels_of_jpeg(data)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # of sizes that it refuses
        image = None
    if image is None:
        raise InputError(f"{len(data)} bytes that OpenCV cannot decode as an image")
    if image.ndim == 2:
        return np.asarray(image)
    order = (2, 1, 0, 3)[: image.shape[2]]
    return np.ascontiguousarray(image[..., order])


def _pixels_of_jpeg(data: bytes) -> Bytes:
    """Return the pixels of a JPEG (h, w) or (h, w, 3), as Pillow reads it.

    OpenCV writes what libjpeg says to standard error, and returns grey where pixels are lost.
    Pillow is silent, and refuses data that end before the last pixel, unless an end of the image is
    marked: the mark is taken off, and zeros make up for what libjpeg reads ahead. A progressive
    image needs its mark.
    """
    from PIL.JpegImagePlugin import JpegImageFile

    end = len(data.rstrip(b"\0")) - len(_END)
    try:
        image = JpegImageFile(io.BytesIO(data))
        if "progressive" not in image.info:
            image = JpegImageFile(io.BytesIO(data[:end] + bytes(_AHEAD)))
        return np.asarray(image if image.mode == "L" else image.convert("RGB"))
    except MemoryError:
        raise
    except Exception as error:  # damaged ones raise errors of many classes in Pillow
        raise InputError(f"a JPEG that is damaged: {error}") from None


_END: Final = b"\xff\xd9"
"""Mark at the end of a JPEG."""
_AHEAD: Final = 8
"""Bytes that libjpeg reads ahead at most."""
PNG: Final = b"\x89PNG\r\n\x1a\n"
JPEG: Final = b"\xff\xd8\xff"
_MAX_PIXELS: Final = 1 << 27
_NEEDED: Final = (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND")
"""Chunks that pixels depend on."""
_CHANNELS: Final = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
"""Values of a pixel in a PNG, by its kind of colour."""
_ADAM7: Final = (
    *((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4)),
    *((0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)),
)
"""First column and row, and the steps, of each pass (PNG specification, 8.2)."""
_STEP: Final = 1 << 20
_LONGEST_HEADER: Final = 1 << 16
_START_OF_FRAME: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}

Size = tuple[int, int]
"""Height and width [px]."""


def examined(data: bytes) -> tuple[Size | None, bytes]:
    """Return the size of a PNG or JPEG, and the bytes to decode; None for BMP, PNM and TIFF.

    Those of a PNG lack the chunks that no pixel depends on. Whether one of the last three
    forms is whole is known when it is decoded.

    :raises InputError: for one that is damaged, cut off, or larger than 2^27 pixels, and for any
        other form.
    """
    if data.startswith(PNG):
        return _png(data)
    if data.startswith(JPEG):
        return _jpeg(data), data
    try:
        width, height = _stated(data)
    except (struct.error, ValueError, KeyError):
        raise InputError(
            f"{len(data)} bytes that are no image; PNG, JPEG, BMP, PGM, PPM and TIFF are read"
        ) from None
    _check_size(width, height)
    return None, data


def _stated(data: bytes) -> tuple[int, int]:
    """Return width and height that the header of a BMP, PNM or TIFF states.

    :raises ValueError: for another form, or a struct.error or KeyError for a header that lacks it.
    """
    if data.startswith(b"BM"):
        core_header = struct.unpack_from("<I", data, 14) == (12,)
        width, height = struct.unpack_from("<HH" if core_header else "<ii", data, 18)
        return width, abs(height)
    if data[:1] == b"P" and data[1:2] in b"123456":
        tokens = re.sub(rb"#[^\n]*", b"", data[2:_LONGEST_HEADER]).split(maxsplit=2)
        width, height, _ = tokens  # and the pixels
        return int(width[:9]), int(height[:9])
    order = {b"II*\0": "<", b"MM\0*": ">"}[data[:4]]
    (directory,) = struct.unpack_from(f"{order}I", data, 4)
    (count,) = struct.unpack_from(f"{order}H", data, directory)
    sizes = {}
    for offset in range(directory + 2, directory + 2 + 12 * count, 12):
        tag, kind = struct.unpack_from(f"{order}HH", data, offset)
        if tag in (256, 257):
            (sizes[tag],) = struct.unpack_from(
                f"{order}{'H' if kind == 3 else 'I'}", data, offset + 8
            )
    return sizes[256], sizes[257]


def _png(data: bytes) -> tuple[Size, bytes]:
    chunks: list[tuple[bytes, bytes]] = []
    needed, position = [PNG], len(PNG)
    while not chunks or chunks[-1][0] != b"IEND":
        if position + 12 > len(data):
            raise InputError(f"a PNG that is cut off after {len(data)} bytes")
        length, kind = struct.unpack_from(">I4s", data, position)
        end = position + 12 + length
        if end > len(data):
            raise InputError(f"a PNG that is cut off after {len(data)} bytes")
        if zlib.crc32(data[position + 4 : end - 4]) != int.from_bytes(data[end - 4 : end], "big"):
            raise InputError(f"a PNG that is damaged: the checksum at byte {end - 4} is wrong")
        chunks.append((kind, data[position + 8 : end - 4]))
        if kind in _NEEDED:
            needed.append(data[position:end])
        position = end
    kind, header = chunks[0]
    if kind != b"IHDR" or len(header) != 13:
        raise InputError("a PNG without its header")
    width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", header)
    _check_size(width, height)
    bits = depth * _CHANNELS.get(colour, 0)
    passes = _ADAM7 if interlaced else ((0, 0, 1, 1),)
    sizes = [(-((x - width) // dx), -((y - height) // dy)) for x, y, dx, dy in passes]
    expected = sum(h * (1 - (-w * bits // 8)) for w, h in sizes if w > 0 and h > 0)
    if _inflated(b"".join(body for kind, body in chunks if kind == b"IDAT"), expected) != expected:
        raise InputError(f"a PNG whose pixels are not {width} x {height}")
    return (height, width), b"".join(needed)


def _inflated(data: bytes, limit: int) -> int:
    """Return how many bytes compressed data hold, or more than ``most`` if they hold more."""
    stream, count = zlib.decompressobj(), 0
    try:
        while count <= limit and (part := stream.decompress(data, _STEP)):
            count += len(part)
            data = stream.unconsumed_tail
    except zlib.error as error:
        raise InputError(f"a PNG that is damaged: {error}") from None
    return count


def _jpeg(data: bytes) -> Size:
    """Return the size that the header of the first frame states (ITU-T T.81, B.2.2)."""
    position = 2
    while position + 9 <= len(data) and data[position] == 0xFF:
        marker, length = struct.unpack_from(">xBH", data, position)
        if marker in _START_OF_FRAME:
            height, width = struct.unpack_from(">HH", data, position + 5)
            _check_size(width, height)
            if not data.rstrip(b"\0").endswith(_END):
                raise InputError(f"a JPEG that is cut off after {len(data)} bytes")
            return height, width
        position += 1 if marker == 0xFF else 2 + length
    raise InputError("a JPEG without a frame")


def _check_size(width: int, height: int) -> None:
    """Refuse images without pixels, or with too many."""
    if not 0 < width * height <= _MAX_PIXELS:
        raise InputError(f"an image of {width} x {height} pixels; 1 to {_MAX_PIXELS:,} are read")
