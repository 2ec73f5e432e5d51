# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Events at random times that last for a while: jumps, outages, slipping wheels."""

import math

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.random_streams import generator


class Events:
    """A Poisson process whose events last for exponentially distributed times; none overlap."""

    def __init__(self, seed: int, source: str, rate: float, duration: float, dt: float) -> None:
        """Start before the first event.

        :param source: the first part of the names of its random streams.
        """
        self._begins, self._lengths = (generator(seed, f"{source}{part}") for part in ("", "_end"))
        self._probability = -math.expm1(-rate * dt)
        self._duration = duration / dt
        self._done = self._end = self.count = 0

    def next(self, count: int) -> NDArray[np.int64]:
        """Return the number of the event (count,), from 1, that each sample lies in; 0: none."""
        found = np.zeros(count, np.int64)
        if not self._probability:
            return found
        first = self._done
        if self._end > first:
            found[: self._end - first] = self.count
        for k in np.flatnonzero(self._begins.random(count) < self._probability):
            if first + k >= self._end:
                self.count += 1
                length = max(1, math.ceil(self._lengths.exponential() * self._duration))
                self._end = first + int(k) + length
                found[k : k + length] = self.count
        self._done = first + count
        return found
