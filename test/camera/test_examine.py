# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Encoded images: damaged ones and too large ones are refused, in silence."""

import io
import struct
import zlib

import numpy as np
import pytest

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.sensors.camera.images.files import decode_image, image_size, png

IMAGE = np.random.default_rng(3).integers(0, 256, (17, 23), dtype=np.uint8)


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png_bytes(width, height, pixels, depth=8, colour=0, chunks=b""):
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
    assert image_size(file.getvalue()) == size[::-1]
    assert decode_image(file.getvalue()).shape[:2] == size[::-1]


def plain(form, width, height):
    """Return the header of an image, and no pixels."""
    if form == "bmp":
        return struct.pack("<2sIIIIiiHHIIiiII", b"BM", 54, 0, 54, 40, width, -height, 1, 24,
                           0, 0, 0, 0, 0, 0)  # fmt: skip
    if form == "pgm":
        return f"P5\n# x\n{width} {height}\n255\n".encode()
    order = "<" if form == "tif" else ">"
    tags = [(256, 3 if width < 65536 else 4, width), (257, 4, height), (258, 3, 8), (262, 3, 1)]
    tags.append((273, 4, 8))
    rows = [struct.pack(f"{order}HHIHxx" if kind == 3 else f"{order}HHII", tag, kind, 1, value)
            for tag, kind, value in tags]  # fmt: skip
    head = b"II*\0" if form == "tif" else b"MM\0*"
    return head + struct.pack(f"{order}IH", 8, len(tags)) + b"".join(rows) + bytes(4)


@pytest.mark.parametrize("size", [(0, 24), (60_000, 60_000), (1 << 20, 1 << 10)])
@pytest.mark.parametrize("form", ["bmp", "pgm", "tif", "big-endian tif"])
def test_the_size_of_other_forms_is_bounded_before_they_are_decoded(form, size):
    """There are no pixels behind the headers: decoding them would be another error."""
    reason = f"an image of {size[0]} x {size[1]} pixels; 1 to"
    if not size[0]:
        reason = "a (BMP|PPM|TIFF) that is damaged: its header states no pixels"
    for reader in (decode_image, image_size):
        with pytest.raises(InputError, match=f"^{reason}"):
            reader(plain(form, *size))


@pytest.mark.parametrize("data", [b"", b"GIF89a", bytes(99)])
def test_what_is_no_image_says_which_forms_are_read(data):
    with pytest.raises(InputError, match="bytes that are no image; PNG, JPEG, BMP, PGM, PPM and"):
        image_size(data)


@pytest.mark.parametrize(
    ("data", "form"), [(b"BM", "BMP"), (b"P5\n", "PPM"), (b"II*\0", "TIFF"), (b"P5 9 x ", "PPM")]
)
def test_a_header_that_is_cut_off_is_damage(data, form):
    with pytest.raises(InputError, match=f"^a {form} that is damaged: "):
        image_size(data)


@pytest.mark.parametrize("channels", [(), (3,), (4,)])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("form", [".png", ".tiff", ".pgm", ".bmp"])
def test_pixels_are_those_that_opencv_finds(form, dtype, channels):
    """8 and 16 bits, grey and in colours, with and without alpha."""
    cv2 = pytest.importorskip("cv2")
    if (form == ".bmp" and dtype == np.uint16) or (form == ".pgm" and channels == (4,)):
        return  # there are none
    image = np.random.default_rng(2).integers(0, np.iinfo(dtype).max, (17, 23, *channels), dtype)
    data = cv2.imencode(".ppm" if form == ".pgm" and channels else form, image)[1]
    expected = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    pixels = decode_image(data.tobytes())
    assert pixels.dtype == expected.dtype
    order = (2, 1, 0, 3)[: expected.shape[2]] if channels else ...
    np.testing.assert_array_equal(pixels, expected[..., order] if channels else expected)
    assert image_size(data.tobytes()) == (17, 23)


@pytest.mark.parametrize("depth", [1, 2, 4, 8])
@pytest.mark.parametrize("colour", [0, 3])
def test_few_bits_and_palettes_are_those_that_opencv_finds(depth, colour):
    cv2 = pytest.importorskip("cv2")
    stream = np.random.default_rng(depth)
    palette = chunk(b"PLTE", stream.integers(0, 256, 3 << depth, np.uint8).tobytes())
    length = -(-23 * depth // 8)
    rows = [b"\0" + stream.integers(0, 256, length, np.uint8).tobytes() for _ in range(17)]
    for transparent in (b"", chunk(b"tRNS", b"\0"))[: 1 + (colour == 3)]:
        chunks = palette + transparent if colour == 3 else b""
        data = png_bytes(23, 17, b"".join(rows), depth, colour, chunks)
        expected = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        order = (2, 1, 0, 3)[: expected.shape[2]] if colour else ...
        np.testing.assert_array_equal(
            decode_image(data), expected[..., order] if colour else expected
        )


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
            decoded_pixels = decode_image(data.tobytes())
            np.testing.assert_array_equal(
                decoded_pixels, expected[..., ::-1] if colours else expected
            )


def test_a_damaged_jpeg_is_refused_without_a_line_of_libjpeg(capfd):
    """Lost pixels are an error, even one row of blocks; superfluous bytes are none."""
    cv2 = pytest.importorskip("cv2")
    data = cv2.imencode(".jpg", np.tile(IMAGE, (4, 4)))[1].tobytes()
    whole = decode_image(data[:-2] + bytes(20) + data[-2:])
    np.testing.assert_array_equal(whole, decode_image(data))
    assert whole.shape == (68, 92)
    for end in (len(data) // 2, len(data) - 60):
        with pytest.raises(InputError, match="a JPEG that is damaged: image file is truncated"):
            decode_image(data[:end] + data[-2:])
    table_start = data.index(b"\xff\xc4")  # a table of Huffman's code
    with pytest.raises(InputError, match="a JPEG that is damaged: "):
        decode_image(data[: table_start + 6] + bytes([255] * 12) + data[table_start + 18 :])
    assert capfd.readouterr().err == ""


def test_what_pixels_do_not_depend_on_is_not_decoded():
    data = png(IMAGE)
    profile = chunk(b"iCCP", b"x\0\0" + zlib.compress(b"no profile"))
    text = chunk(b"tEXt", b"Comment\0hello")
    assert image_size(data[:33] + profile + text + data[33:]) == (17, 23)
    np.testing.assert_array_equal(decode_image(data[:33] + profile + data[33:]), IMAGE)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (png_bytes(0, 0, b""), "a PNG that is damaged: its header states no pixels"),
        (png_bytes(60_000, 60_000, b""), "60000 x 60000 pixels; 1 to"),
        (png_bytes(9000, 9000, b""), "a PNG that is damaged: image file is truncated"),
        (png_bytes(4, 4, bytes(19)), "a PNG that is damaged: image file is truncated"),
        (
            png_bytes(4, 4, bytes(20), colour=9),
            "a PNG that is damaged: its header states no pixels",
        ),
        (png(IMAGE)[:-12], "cut off after"),
        (png(IMAGE)[:40], "cut off after"),
        (png(IMAGE)[:8], "cut off after 8 bytes"),
        (b"\x89PNG\r\n\x1a\n" + chunk(b"IEND", b""), "damaged: its header states no pixels"),
        (png(IMAGE)[:60] + b"xx" + png(IMAGE)[62:], "a PNG that is damaged: .*checksum in b'IDAT'"),
        (b"\xff\xd8\xff\xd9", "a JPEG that is damaged: "),
    ],
)
def test_damaged_and_endless_images_are_refused_and_nothing_is_printed(capfd, data, reason):
    for ask in (image_size, decode_image):
        with pytest.raises(InputError, match=reason):
            ask(data)
    assert capfd.readouterr() == ("", "")


def test_pixels_that_do_not_inflate(capfd):
    data = png(IMAGE)
    body = bytearray(data[41:-16])
    body[20:24] = b"\xff\xff\xff\xff"
    broken = data[:33] + chunk(b"IDAT", bytes(body)) + chunk(b"IEND", b"")
    with pytest.raises(InputError, match="a PNG that is damaged: "):
        image_size(broken)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("progressive", [False, True])
def test_the_size_of_a_jpeg(progressive):
    image = pytest.importorskip("PIL.Image")
    file = io.BytesIO()
    image.fromarray(IMAGE).save(file, "jpeg", progressive=progressive, comment=b"x" * 300)
    data = file.getvalue()
    assert image_size(data) == (17, 23)
    with pytest.raises(InputError, match="JPEG that is cut off"):
        image_size(data[:-40])


@pytest.mark.parametrize("extra", [1, 10**8])
def test_data_behind_the_last_pixel_are_not_read(extra):
    """Superfluous bytes leave an image whole; a hundred million take no memory."""
    np.testing.assert_array_equal(
        decode_image(png_bytes(4, 4, bytes(20 + extra))), np.zeros((4, 4))
    )
