# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags that a program opens once, however many of its parts read them."""

import os
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from imu_sim_ros.bags.reader import Bag

_MOST: Final = 16
"""Bags that stay open at a time; those that were used longest ago are closed first."""


class SharedBags:
    """Open bags by their path and identity, in the order of use."""

    def __init__(self) -> None:
        self._bags: dict[Hashable, Bag] = {}

    def get(self, path: Path, open_new: Callable[[Path], "Bag"]) -> "Bag":
        """Return the bag at a path; it is opened if it is not open, or has changed.

        :param open_new: opens it.
        """
        state = _state(path)
        if state is None:
            return open_new(path)
        bag = self._bags.pop(state, None)
        if bag is None:
            bag = open_new(path)
            bag.hold()
        self._bags[state] = bag
        if len(self._bags) > _MOST:
            self._bags.pop(next(iter(self._bags))).release()
        return bag

    def close(self) -> None:
        """Close all bags that nobody uses any more; the others are closed after use."""
        while self._bags:
            self._bags.popitem()[1].release()


_shared: Final[ContextVar[SharedBags | None]] = ContextVar("bags", default=None)


def shared_bags() -> SharedBags | None:
    """Return the bags that the running program shares; None outside of :func:`bags_opened_once`."""
    return _shared.get()


@contextmanager
def bags_opened_once() -> Iterator[None]:
    """Open each bag only once until the end; threads that begin within have their own bags."""
    bags = SharedBags()
    token = _shared.set(bags)
    try:
        yield
    finally:
        _shared.reset(token)
        bags.close()


def _state(path: Path) -> Hashable | None:
    """Return the identity of a file or folder and of its content; None if it cannot be read."""
    try:
        entries = sorted(path.iterdir()) if path.is_dir() else []
        states = [file.stat() for file in (path, *entries)]
    except (OSError, ValueError):
        return None
    identities = ((s.st_dev, s.st_ino, s.st_size, s.st_mtime_ns) for s in states)
    # A process that inherits open files has its own bags.
    return os.getpid(), str(path), *entries, *identities
