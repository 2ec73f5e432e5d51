# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags that are compressed as a whole: unpacked into the folder for temporary files."""

import bz2
import gzip
import lzma
import tempfile
import zlib
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any, BinaryIO, Final, NamedTuple

from imu_sim_ros.core.errors import InputError, MachineError

_MAGIC: Final = {
    "zstd": b"\x28\xb5\x2f\xfd",
    "lz4": b"\x04\x22\x4d\x18",
    "gzip": b"\x1f\x8b\x08",
    "bz2": b"BZh",
    "xz": b"\xfd7zXZ\x00",
}
SUFFIXES: Final = (".zstd", ".zst", ".lz4", ".gz", ".bz2", ".xz")
"""Endings of the names of compressed files."""
_STEP_BYTES: Final = 1 << 20
"""Bytes that are decompressed at once."""
_ALWAYS_ALLOWED: Final = 1 << 30
"""Decompressed size that no ratio forbids [bytes]."""
_LARGEST_RATIO: Final = 100
"""Largest ratio of compression of a larger file: a small one must not fill the disk."""


class Unpacked(NamedTuple):
    """A temporary file with the content of a compressed one."""

    path: Path
    torn: bool
    """True if the compressed data are damaged, or end early."""


def compression_of(magic: bytes) -> str | None:
    """Return the compression of a file that begins with these bytes; None if it has none."""
    return next((name for name, begin in _MAGIC.items() if magic.startswith(begin)), None)


def stem(path: Path) -> Path:
    """Return the name of a file without the ending of its compression."""
    return path.with_suffix("") if path.suffix in SUFFIXES else path


def unpack(path: Path, source: BinaryIO, compression: str, stack: ExitStack) -> Unpacked:
    """Unpack an open file.

    :param stack: removes the temporary file.
    :raises InputError: for a file that expands to more than any bag does.
    :raises MachineError: if the folder for temporary files has no room.
    """
    limit = max(_ALWAYS_ALLOWED, _LARGEST_RATIO * path.stat().st_size)
    folder = tempfile.gettempdir()
    try:
        target = Path(stack.enter_context(tempfile.TemporaryDirectory())) / stem(path).name
        with target.open("wb") as file:
            unpacked = _copy(_reader(source, compression), file, limit)
    except OSError as error:
        raise MachineError(
            f"{path}: cannot be unpacked into {folder}: {error.strerror or error}; the variable "
            "TMPDIR names a folder with more room"
        ) from None
    if unpacked is None:
        raise InputError(f"{path}: more than {limit} bytes of {compression} data exceed the limit")
    return Unpacked(target, torn=not unpacked)


def _copy(reader: Any, file: IO[bytes], limit: int) -> bool | None:
    """Copy the unpacked content; return False if it is torn, None if it is too large."""
    import zstandard

    # bz2 and gzip raise OSError for damaged data.
    damage = (EOFError, ValueError, RuntimeError, OSError, lzma.LZMAError, zlib.error)
    while True:
        try:
            part = reader.read1(_STEP_BYTES)  # what precedes damage, too
        except (*damage, zstandard.ZstdError):
            return False
        if not part:
            return True
        if file.tell() + len(part) > limit:
            return None
        file.write(part)


def _reader(source: IO[bytes], compression: str) -> Any:
    """Return a file object that reads the content of a compressed file."""
    if compression == "zstd":
        import zstandard

        return zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True)
    if compression == "lz4":
        import lz4.frame

        return lz4.frame.LZ4FrameFile(source)
    if compression == "gzip":
        return gzip.GzipFile(fileobj=source)
    return bz2.BZ2File(source) if compression == "bz2" else lzma.LZMAFile(source)
