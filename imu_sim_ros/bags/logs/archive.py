# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording of several files: a folder, or the same files in a zip archive."""

import os
import zipfile
import zlib
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path, PurePosixPath
from typing import Final

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.inputs.rows import open_shared

ZIP_MAGIC: Final = b"PK\x03\x04"
_DEPTH: Final = 5
"""Number of folders above a file that is looked for."""
_MOST_NAMES: Final = 200_000
"""Largest number of files in an archive."""
_ALWAYS_ALLOWED: Final = 1 << 30
"""Size of unpacked files that is allowed whatever the ratio of compression [bytes]."""
_LARGEST_RATIO: Final = 100
"""Largest ratio of compression of larger files: a small archive must not fill the memory."""
_DAMAGE: Final = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError)
"""Exceptions of Python for archives that are damaged, encrypted or of another method."""


class Archive(AbstractContextManager["Archive"]):
    """Files of a folder or of a zip archive; use as a context manager."""

    def __init__(self, path: Path, depth: int = _DEPTH) -> None:
        """Open an archive.

        :param depth: number of folders above the files that are listed.
        :raises InputError: for an archive that is not whole.
        """
        self.path = path
        self._stack = ExitStack()
        self._zip: zipfile.ZipFile | None = None
        if path.is_dir():
            self.names = tuple(_names_below(path, depth))
        else:
            try:
                file = self._stack.enter_context(open_shared(path))
                self._zip = self._stack.enter_context(zipfile.ZipFile(file))
                self.names = tuple(
                    entry.filename for entry in self._zip.infolist() if not entry.is_dir()
                )
            except _DAMAGE as error:
                self._stack.close()
                raise InputError(f"{path}: damaged: {_reason(error)}") from None

    def __exit__(self, *_: object) -> None:
        """Close the file of a zip archive."""
        self._stack.close()

    def names_of(self, *endings: str) -> list[str]:
        """Return the sorted names of files whose paths end in one of some endings, in any case.

        Resource files of macOS, in ``__MACOSX``, are none.
        """
        return sorted(
            name
            for name in self.names
            if f"/{name}".lower().endswith(endings) and "__MACOSX" not in name
        )

    def refuse_several(self, names: Sequence[str]) -> None:
        """Refuse several recordings in one archive.

        :param names: files that lie in one folder if they are of one recording.
        :raises InputError: with the folders.
        """
        folders = sorted({str(PurePosixPath(name).parent) for name in names})
        if len(folders) > 1:
            raise InputError(
                f"{self.path}: has several recordings: {', '.join(folders[:6])}; name one of them"
            )

    def read(self, name: str, size: int = -1) -> bytes:
        """Return the content of a file, or its first bytes.

        :param size: number of bytes; -1: all.
        :raises InputError: for a file that is damaged, or too large.
        """
        try:
            if self._zip is None:
                with open_shared(self.path / name) as file:
                    return file.read(size)
            limit = max(_ALWAYS_ALLOWED, _LARGEST_RATIO * os.stat(self.path).st_size)
            if size < 0 and self._zip.getinfo(name).file_size > limit:
                raise InputError(
                    f"{self.path}: {name}: more than {limit} bytes of data exceed the limit"
                )
            with self._zip.open(name) as member:
                return member.read(size)
        except _DAMAGE as error:
            raise InputError(f"{self.path}: damaged: {name}: {_reason(error)}") from None


def is_archive(path: Path, magic: bytes) -> bool:
    """Return True for a folder and for a zip archive.

    :param magic: first bytes of the file; empty for a folder.
    """
    return path.is_dir() or magic.startswith(ZIP_MAGIC)


def stem(name: str) -> str:
    """Return the name of a file without its folders and its ending."""
    return PurePosixPath(name).stem


def _names_below(folder: Path, depth: int, prefix: str = "") -> list[str]:
    """Return the names of the files in a folder and in those below it, relative to the first."""
    names: list[str] = []
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda entry: entry.name):
            if len(names) >= _MOST_NAMES:
                break
            if entry.is_dir(follow_symlinks=False):
                if depth:
                    names += _names_below(Path(entry.path), depth - 1, f"{prefix}{entry.name}/")
            else:
                names.append(prefix + entry.name)
    return names


def _reason(error: Exception) -> str:
    """Return the text of an exception in one line."""
    return " ".join(str(error).split()) or type(error).__name__
