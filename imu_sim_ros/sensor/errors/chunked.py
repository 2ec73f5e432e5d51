# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random processes generated in chunks of a fixed length and read in blocks of any length."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TOGETHER: Final = 8192
"""Values of a row generated at once, as far as whole chunks allow: they stay in the cache."""


class ChunkedProcess(ABC):
    """One process for each random stream; a value does not depend on the blocks it is read in."""

    def __init__(self, streams: Sequence[Generator], length: int, rows: int = 0) -> None:
        """Start with nothing generated.

        :param length: values in a chunk.
        :param rows: rows of a chunk; 0: one for each stream.
        """
        self._streams = streams
        self._length = length
        self._left = np.empty((rows or len(streams), 0))
        """Generated and not yet read."""

    @abstractmethod
    def _make_chunks(self, count: int) -> Array:
        """Return the next values, those of ``count`` chunks."""

    def next_block(self, count: int) -> Array:
        """Return the next values (rows of a chunk, count), a new array."""
        left = self._left
        if count <= left.shape[1]:
            self._left = left[:, count:]
            taken: Array = left[:, :count].copy()
            return taken
        parts, done = [left], left.shape[1]
        while done < count:
            chunks = min(-((done - count) // self._length), max(1, _TOGETHER // self._length))
            parts.append(self._make_chunks(chunks))
            done += chunks * self._length
        last = parts[-1]
        used = last.shape[1] - (done - count)
        self._left, parts[-1] = last[:, used:], last[:, :used]
        return np.concatenate(parts, axis=1)
