# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Encoded images: what is damaged or too large is refused before anything decodes it."""

import io
import struct
import zlib
from types import SimpleNamespace

import numpy as np
import pytest

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.sensors.camera.images.files import decoded, examined, png

IMAGE = np.random.default_rng(3).integers(0, 256, (17, 23), dtype=np.uint8)


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def made(width, height, pixels, depth=8, colour=0, chunks=b""):
    header = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    body = [
        chunk(b"IHDR", header),
        chunks,
        chunk(b"IDAT", zlib.compress(pixels)),
        chunk(b"IEND", b""),
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(body)


@pytest.mark.parametrize("mode", ["1", "L", "P", "LA", "RGB", "RGBA", "I;16"])
@pytest.mark.parametrize("size", [(1, 1), (3, 5), (23, 17), (64, 48)])
def test_the_size_of_every_kind_of_png_is_known(mode, size):
    image = pytest.importorskip("PIL.Image")
    file = io.BytesIO()
    image.new(mode, size).save(file, "png")
    dimensions, needed = examined(file.getvalue())
    assert dimensions == size[::-1]
    assert examined(needed)[0] == dimensions
    assert decoded(file.getvalue()).shape[:2] == dimensions


def plain(form, width, height):
    """Return the header of a form that OpenCV alone reads, and no pixels."""
    if form == "bmp":
        return struct.pack("<2sIIIIiiHHIIiiII", b"BM", 54, 0, 54, 40, width, -height, 1, 24,
                           0, 0, 0, 0, 0, 0)  # fmt: skip
    if form == "pgm":
        return f"P5\n# x\n{width} {height}\n255\n".encode()
    order = "<" if form == "tif" else ">"
    tags = [(256, 3 if width < 65536 else 4, width), (257, 4, height)]
    rows = [struct.pack(f"{order}HHIHxx" if kind == 3 else f"{order}HHII", tag, kind, 1, value)
            for tag, kind, value in tags]  # fmt: skip
    head = b"II*\0" if form == "tif" else b"MM\0*"
    return head + struct.pack(f"{order}IH", 8, len(tags)) + b"".join(rows)


@pytest.mark.parametrize("size", [(0, 24), (60_000, 60_000), (1 << 20, 1 << 10)])
@pytest.mark.parametrize("form", ["bmp", "pgm", "tif", "big-endian tif"])
def test_the_size_of_other_forms_is_bounded_before_they_are_decoded(form, size, monkeypatch):
    monkeypatch.setattr("imu_sim_ros.sensors.camera.images.files.opencv", SimpleNamespace)
    with pytest.raises(InputError, match=rf"^an image of {size[0]} x {size[1]} pixels; 1 to"):
        decoded(plain(form, *size))


@pytest.mark.parametrize("data", [b"", b"GIF89a", b"BM", b"P5\n", b"II*\0", b"P5 9 x ", bytes(99)])
def test_what_is_no_image_says_which_forms_are_read(data):
    with pytest.raises(InputError, match="bytes that are no image; PNG, JPEG, BMP, PGM, PPM and"):
        examined(data)


@pytest.mark.parametrize("form", [".bmp", ".pgm", ".tiff"])
def test_other_forms_are_decoded(form):
    cv2 = pytest.importorskip("cv2")
    data = cv2.imencode(form, IMAGE)[1].tobytes()
    np.testing.assert_array_equal(decoded(data), IMAGE)


@pytest.mark.parametrize("colours", [(), (3,)])
def test_a_jpeg_has_the_pixels_that_opencv_finds(colours):
    cv2 = pytest.importorskip("cv2")
    stream = np.random.default_rng(1)
    for restart in (0, 3):
        image = stream.integers(0, 256, (37, 53, *colours), dtype=np.uint8)
        options = [cv2.IMWRITE_JPEG_QUALITY, 70, cv2.IMWRITE_JPEG_RST_INTERVAL, restart]
        for progressive in (0, 1):
            progressive_option = [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive]
            data = cv2.imencode(".jpg", image, options + progressive_option)[1]
            expected = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
            decoded_pixels = decoded(data.tobytes())
            np.testing.assert_array_equal(
                decoded_pixels, expected[..., ::-1] if colours else expected
            )


def test_a_damaged_jpeg_is_refused_without_a_line_of_libjpeg(capfd):
    """Lost pixels are an error, even one row of blocks; superfluous bytes are none."""
    cv2 = pytest.importorskip("cv2")
    data = cv2.imencode(".jpg", np.tile(IMAGE, (4, 4)))[1].tobytes()
    whole = decoded(data[:-2] + bytes(20) + data[-2:])
    np.testing.assert_array_equal(whole, decoded(data))
    assert whole.shape == (68, 92)
    for end in (len(data) // 2, len(data) - 60):
        with pytest.raises(InputError, match="a JPEG that is damaged: image file is truncated"):
            decoded(data[:end] + data[-2:])
    table_start = data.index(b"\xff\xc4")  # a table of Huffman's code
    with pytest.raises(InputError, match="a JPEG that is damaged: "):
        decoded(data[: table_start + 6] + bytes([255] * 12) + data[table_start + 18 :])
    assert capfd.readouterr().err == ""


def test_what_pixels_do_not_depend_on_is_not_decoded():
    data = png(IMAGE)
    profile = chunk(b"iCCP", b"x\0\0" + zlib.compress(b"no profile"))
    text = chunk(b"tEXt", b"Comment\0hello")
    dimensions, needed = examined(data[:33] + profile + text + data[33:])
    assert (dimensions, needed) == ((17, 23), data)
    np.testing.assert_array_equal(decoded(data[:33] + profile + data[33:]), IMAGE)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (made(0, 0, b""), "0 x 0 pixels"),
        (made(60_000, 60_000, b""), "60000 x 60000 pixels; 1 to"),
        (made(9000, 9000, b""), "whose pixels are not 9000 x 9000"),
        (made(4, 4, bytes(19)), "whose pixels are not 4 x 4"),
        (made(4, 4, bytes(21)), "whose pixels are not 4 x 4"),
        (made(4, 4, bytes(10**8)), "whose pixels are not 4 x 4"),
        (made(4, 4, bytes(20), colour=9), "whose pixels are not 4 x 4"),
        (png(IMAGE)[:-12], "cut off after"),
        (png(IMAGE)[:40], "cut off after"),
        (png(IMAGE)[:8], "cut off after 8 bytes"),
        (b"\x89PNG\r\n\x1a\n" + chunk(b"IEND", b""), "without its header"),
        (png(IMAGE)[:60] + b"xx" + png(IMAGE)[62:], "the checksum at byte"),
        (b"\xff\xd8\xff\xd9", "without a frame"),
    ],
)
def test_damaged_and_endless_images_are_refused_and_nothing_is_printed(capfd, data, reason):
    for ask in (examined, decoded):
        with pytest.raises(InputError, match=reason):
            ask(data)
    assert capfd.readouterr() == ("", "")


def test_pixels_that_do_not_inflate(capfd):
    data = png(IMAGE)
    body = bytearray(data[41:-16])
    body[20:24] = b"\xff\xff\xff\xff"
    broken = data[:33] + chunk(b"IDAT", bytes(body)) + chunk(b"IEND", b"")
    with pytest.raises(InputError, match=r"damaged: Error|whose pixels"):
        examined(broken)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("progressive", [False, True])
def test_the_size_of_a_jpeg(progressive):
    image = pytest.importorskip("PIL.Image")
    file = io.BytesIO()
    image.fromarray(IMAGE).save(file, "jpeg", progressive=progressive, comment=b"x" * 300)
    data = file.getvalue()
    assert examined(data) == ((17, 23), data)
    with pytest.raises(InputError, match="JPEG that is cut off"):
        examined(data[:-40])
