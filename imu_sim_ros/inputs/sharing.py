# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags and text files that a program opens once, however many of its parts read them."""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Final, TypeVar, cast

_MOST: Final = 16
"""Files of a kind that stay open; those that were used longest ago are closed first."""


class Shareable(ABC):
    """An open file that stays open until its last user releases it."""

    _users = 0

    def hold(self) -> None:
        """Keep the file open until :meth:`release`."""
        self._users += 1

    def release(self) -> None:
        """Close the file if it has no other user."""
        self._users -= 1
        if self._users <= 0:
            self._close_files()

    @abstractmethod
    def _close_files(self) -> None:
        """Close the file, even if it has users."""


File = TypeVar("File", bound=Shareable)


class SharedFiles:
    """Open files by the function that opened them, path and identity, in the order of use."""

    def __init__(self) -> None:
        self._files: dict[tuple[object, Hashable], Shareable] = {}

    def get(self, path: Path, open_new: Callable[[Path], File]) -> File:
        """Return the file at a path; it is opened if it is not open, or has changed.

        :param open_new: function that opens a file of this kind.
        """
        state = _state(path)
        if state is None:
            return open_new(path)
        file = cast("File | None", self._files.pop((open_new, state), None))
        if file is None:
            file = open_new(path)
            file.hold()
        self._files[open_new, state] = file
        keys = [key for key in self._files if key[0] is open_new]
        if len(keys) > _MOST:
            self._files.pop(keys[0]).release()
        return file

    def close(self) -> None:
        """Close all files that nobody uses any more; the others are closed after use."""
        while self._files:
            self._files.popitem()[1].release()


_shared: Final[ContextVar[SharedFiles | None]] = ContextVar("files", default=None)


def shared_files() -> SharedFiles | None:
    """Return the files that the running program shares; None outside of :func:`open_files_once`."""
    return _shared.get()


@contextmanager
def open_files_once() -> Iterator[None]:
    """Open each file only once until the end; threads that begin within have their own files."""
    files = SharedFiles()
    token = _shared.set(files)
    try:
        yield
    finally:
        _shared.reset(token)
        files.close()


def _state(path: Path) -> Hashable | None:
    """Return the identity of a file or folder and of its content; None if it cannot be read."""
    try:
        entries = sorted(path.iterdir()) if path.is_dir() else []
        states = [file.stat() for file in (path, *entries)]
    except (OSError, ValueError):
        return None
    identities = ((s.st_dev, s.st_ino, s.st_size, s.st_mtime_ns) for s in states)
    # A process that inherits open files opens its own.
    return os.getpid(), str(path), *entries, *identities
