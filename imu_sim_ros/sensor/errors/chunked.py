# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random processes generated in chunks of a fixed length and read in blocks of any length."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ChunkedProcess(ABC):
    """One process for each random stream; a value does not depend on the blocks it is read in."""

    def __init__(self, streams: Sequence[Generator], length: int) -> None:
        """Start with nothing generated.

        :param length: values in a chunk.
        """
        self._streams = streams
        self._chunk = np.empty((len(streams), length))
        self._used = length

    @abstractmethod
    def _make_chunk(self) -> None:
        """Fill ``_chunk`` with the next values."""

    def next_block(self, count: int) -> Array:
        """Return the next values (rows of a chunk, count)."""
        out = np.empty((len(self._chunk), count))
        length = self._chunk.shape[1]
        done = 0
        while done < count:
            if self._used == length:
                self._make_chunk()
                self._used = 0
            take = min(count - done, length - self._used)
            out[:, done : done + take] = self._chunk[:, self._used : self._used + take]
            done += take
            self._used += take
        return out
