# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What compressed chunks hold, within limits of size."""

from collections.abc import Iterator
from typing import Any, Final, TypeVar

_Data = TypeVar("_Data", bytes, memoryview)

LARGEST_CHUNK: Final = 1 << 30
"""[bytes] A larger chunk is refused; those of rosbag2 and roscpp have about 1 MB."""
_ALWAYS_ALLOWED: Final = 64 << 20
_LARGEST_RATIO: Final = 40
"""Largest ratio of compression of larger chunks: a file of 10 MB must not fill the memory."""
_STEP: Final = 1 << 20


def allowed(compressed: int) -> int:
    """Return how many bytes a chunk of a given compressed size may hold."""
    return min(LARGEST_CHUNK, max(_ALWAYS_ALLOWED, _LARGEST_RATIO * compressed))


def decompress(data: _Data, compression: str, size: int, torn: bool = False) -> bytes | _Data:
    """Return the content of a chunk; the data themselves if they are not compressed.

    :param compression: none or empty, lz4, zstd or bz2.
    :param size: stated size of the content [bytes].
    :param torn: the end is missing; what precedes it is returned.
    :raises ValueError: for data in another format or of another size.
    """
    if size > allowed(len(data)):
        raise ValueError(f"{size} bytes in {len(data)} compressed ones exceed the limit")
    content = data if compression in ("", "none") else _decompressed(data, compression, size, torn)
    if not torn and len(content) != size:
        raise ValueError("it does not have the expected size")
    return content


def _decompressed(data: bytes | memoryview, compression: str, size: int, torn: bool) -> bytes:
    """Return the content, or a little more than its size if it is larger than stated."""
    content = bytearray()
    try:
        for part in _stepwise(data, compression):
            content += part
            if len(content) > size:
                break
    except (RuntimeError, OSError, EOFError, ValueError) as error:
        if not torn:
            raise ValueError(str(error)) from None
    return bytes(content)


def _stepwise(data: bytes | memoryview, compression: str) -> Iterator[bytes]:
    """Yield the content in steps of a bounded size, of one stream."""
    if compression == "zstd":
        yield from _zstd_steps(data)
        return
    stream = _stream(compression)
    position = 0
    while not stream.eof:
        part: bytes | memoryview = b""
        if stream.needs_input:
            part = data[position : position + _STEP]
            position += len(part)
            if not part:
                return
        yield stream.decompress(part, _STEP)


def _zstd_steps(data: bytes | memoryview) -> Iterator[bytes]:
    import zstandard

    stream = zstandard.ZstdDecompressor().stream_reader(data)
    try:
        while part := stream.read(_STEP):
            yield part
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from None


def _stream(compression: str) -> Any:
    """Return an object that decompresses in steps of a bounded size."""
    if compression == "lz4":
        import lz4.frame

        return lz4.frame.LZ4FrameDecompressor()
    if compression == "bz2":
        import bz2

        return bz2.BZ2Decompressor()
    raise ValueError(f"chunks are compressed by {compression[:20]!r}, which is not supported")
