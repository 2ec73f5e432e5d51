# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decompression of chunks, whole ones and torn ones."""

from typing import Any

from imu_sim_ros.errors import InputError


def decompress(data: bytes, compression: str, torn: bool = False) -> bytes:
    """Return the content of a chunk.

    :param compression: none or empty, lz4, zstd or bz2.
    :param torn: the end is missing; what comes before it is returned.
    :raises ValueError: for data that is not what the name says.
    """
    if compression in ("", "none"):
        return data
    try:
        if torn:
            return bytes(_stepwise(compression).decompress(data))
        return _whole(data, compression)
    except (RuntimeError, OSError, EOFError) as error:
        raise ValueError(str(error)) from None


def _whole(data: bytes, compression: str) -> bytes:
    if compression == "lz4":
        import lz4.frame

        return bytes(lz4.frame.decompress(data))
    if compression == "bz2":
        import bz2

        return bz2.decompress(data)
    import zstandard

    try:
        return bytes(_stepwise(compression).decompress(data))
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from None


def _stepwise(compression: str) -> Any:
    """Return an object that decompresses as much as there is."""
    if compression == "lz4":
        import lz4.frame

        return lz4.frame.LZ4FrameDecompressor()
    if compression == "bz2":
        import bz2

        return bz2.BZ2Decompressor()
    if compression == "zstd":
        import zstandard

        return zstandard.ZstdDecompressor().decompressobj()
    raise InputError(f"chunks are compressed by {compression!r}, which is not known here")
