# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writing past the system's page cache, where that is faster.

A write into the cache copies the bytes into pages that the kernel has to find first: that is 0.25
to 3 s of processor time for a GB, by the state of the machine's memory. With O_DIRECT (open(2)) the
disk takes the bytes from the program's own memory, which costs a tenth of the processor time, but
the program waits for the disk. A fast disk is faster so; a slow one is not, as the cache takes what
it cannot take yet.
"""

import fcntl
import mmap
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Final

import numpy as np
from numpy.typing import NDArray

_MIB: Final = 1 << 20
BLOCK_BYTES: Final = 4096
"""What O_DIRECT wants in multiples: places in the file, lengths and addresses."""
_STAGING_BYTES: Final = 2 * _MIB
"""Of memory from which the disk reads; one huge page, so that a request has few segments."""

_DIRECT_SECOND: Final = 0.5
"""What a second of direct writing counts."""
_NEWEST: Final = 0.25
"""Weight of the last piece in the average."""
_TRIALS: Final = 1 / 32
"""Part of the time that trials may take."""
_BETWEEN_S: Final = 0.1
"""[s] From one trial to the next, at least."""


class DirectAppender:
    """Appends to a file past the page cache: whole blocks, by way of aligned memory.

    A file's last block is written as a whole with zeros at its end, and again with what is appended
    next: after each call everything is in the file, which is at most a block too long.
    """

    def __init__(self, descriptor: int) -> None:
        """Prepare memory.

        :param descriptor: of a file that is open for reading and writing.
        """
        self._descriptor = descriptor
        memory = mmap.mmap(-1, 2 * _STAGING_BYTES, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        with suppress(OSError):  # of a kernel that has none
            memory.madvise(mmap.MADV_HUGEPAGE)
        whole: NDArray[np.uint8] = np.frombuffer(memory, np.uint8)
        start = -whole.ctypes.data % _STAGING_BYTES
        self._staging = whole[start : start + _STAGING_BYTES]
        self._end = -1
        """The position in the file of which the staging memory begins with the last block."""

    def append(self, position: int, parts: Sequence[bytes | memoryview]) -> None:
        """Write parts from a position on, which is the file's end.

        :raises OSError: where the file system refuses direct writing, or the disk is full; what
            stands before the position is untouched, what stands behind it is undefined.
        """
        tail = position % BLOCK_BYTES
        start = position - tail
        if tail and self._end != position:
            self._staging[:tail] = np.frombuffer(os.pread(self._descriptor, tail, start), np.uint8)
        self._end = -1
        filled = tail
        with self._direct():
            for part in parts:
                rest: NDArray[np.uint8] = np.frombuffer(part, np.uint8)
                while len(rest):
                    taken = min(len(rest), _STAGING_BYTES - filled)
                    self._staging[filled : filled + taken] = rest[:taken]
                    filled, rest = filled + taken, rest[taken:]
                    if filled == _STAGING_BYTES:
                        self._put(start, filled)
                        start, filled = start + filled, 0
            whole = -(-filled // BLOCK_BYTES) * BLOCK_BYTES
            self._staging[filled:whole] = 0
            self._put(start, whole)
        tail = filled % BLOCK_BYTES
        self._staging[:tail] = self._staging[filled - tail : filled]
        self._end = start + filled

    def forget(self) -> None:
        """Take the last block from the file: it was changed in another way."""
        self._end = -1

    def _put(self, start: int, size: int) -> None:
        """Write the first bytes of the staging memory."""
        if size and os.pwrite(self._descriptor, self._staging[:size].data, start) != size:
            raise OSError("written in part")  # who writes the rest through the cache learns why

    @contextmanager
    def _direct(self) -> Iterator[None]:
        flags = fcntl.fcntl(self._descriptor, fcntl.F_GETFL)
        fcntl.fcntl(self._descriptor, fcntl.F_SETFL, flags | os.O_DIRECT)
        try:
            yield
        finally:
            fcntl.fcntl(self._descriptor, fcntl.F_SETFL, flags)


class Pace:
    """Which way of writing a growing file is the faster one, found by looking at both.

    A file begins in the page cache. When that has taken a while, which small files never reach, a
    piece is written directly, and what takes less time on the average of the last pieces goes on;
    now and then a piece goes the other way, at most a thirty-second part of the time. A second of
    direct writing counts half: the thread sleeps meanwhile, and others have the processor, which
    the cache's pages need all the time.
    """

    def __init__(self, first_s: float = 0.03, piece: int = 4 * _MIB) -> None:
        """Begin in the cache.

        :param first_s: seconds of writing before direct writing is tried.
        :param piece: bytes between decisions.
        """
        self.direct = False
        """Whether the next bytes are to be written directly."""
        self._piece = piece
        self._cost: dict[bool, float] = {}
        """Seconds per byte of the last pieces, by ``direct``."""
        self._trying = False
        self._size, self._seconds = 0, 0.0
        """Of the piece that is being written."""
        self._until_trial = first_s

    def add(self, size: int, seconds: float) -> None:
        """Count what was written in the way of ``direct``, and decide on the next."""
        self._size += size
        self._seconds += seconds
        if self._size < self._piece:
            return
        cost = self._seconds / self._size * (_DIRECT_SECOND if self.direct else 1.0)
        before = self._cost.get(self.direct, cost)
        self._cost[self.direct] = before + _NEWEST * (cost - before)
        self._until_trial -= self._seconds
        if self._trying:
            self._until_trial = max(_BETWEEN_S, self._seconds / _TRIALS)
        self._trying = not self._trying and self._until_trial <= 0.0
        if self._trying:
            self.direct = not self.direct
        elif len(self._cost) == 2:
            self.direct = self._cost[True] < self._cost[False]
        self._size, self._seconds = 0, 0.0
