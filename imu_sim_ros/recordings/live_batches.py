# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Times of readings that arrive live in batches, with one stamp each or stamps close together."""

from collections.abc import Callable
from typing import Final

import numpy as np

from imu_sim_ros.core.records import LiveReading
from imu_sim_ros.recordings.clock import bunch_limit

_LARGEST_BATCH: Final = 1024
"""Readings of a batch; so many with one stamp come from a driver without stamps."""
_WINDOW: Final = 64
"""Stamps in which bunches are looked for."""
_STRETCH: Final = 1.5
"""Ratio of an interval to the one before from which on readings between two batches are lost."""


class BatchSpreader:
    """Spreads the readings of each batch over the time to the stamp of the next one.

    A sensor with a FIFO delivers several readings at a time, which many drivers stamp alike. The
    first reading of a batch has the batch's stamp; the others wait for the next stamp. A reading
    that equals the one before it is a message that came twice, and passes unchanged.

    A host that stamps readings when they arrive gives those of a batch stamps close together:
    bunches, which are spread likewise once 64 stamps show them.
    """

    def __init__(self, complain: Callable[[str], None]) -> None:
        """Initialise without readings.

        :param complain: receives a line when readings share a stamp.
        """
        self._complain = complain
        self._previous: LiveReading | None = None
        self._waiting: list[LiveReading] = []
        """Readings of the latest batch behind its first one."""
        self._head_ns = 0
        """Stamp of the first reading of the latest batch [ns]."""
        self._interval_ns = 0.0
        """Interval of the readings of the batch before [ns]; 0: not known."""
        self._has_batches = False
        self._stamps: list[int] = []
        """Stamps in which bunches are looked for next."""
        self._bunch_ns = 0.0
        """Longest step within a batch [ns]."""

    def add(self, reading: LiveReading) -> list[LiveReading]:
        """Add a reading; return the readings whose times are now known, in order."""
        previous, self._previous = self._previous, reading
        if len(self._stamps) < _WINDOW:
            self._look_for_bunches(reading.t_ns)
        if previous is None:
            self._head_ns = reading.t_ns
            return [reading]
        step_ns = reading.t_ns - previous.t_ns
        if 0 <= step_ns <= self._bunch_ns:
            if not step_ns and reading.gyro == previous.gyro and reading.accel == previous.accel:
                return [] if self._waiting else [reading]
            self._tell(reading.t_ns)
            if len(self._waiting) < _LARGEST_BATCH:
                self._waiting.append(reading)
            return []
        spread = self._spread(reading.t_ns) if self._waiting else ()
        self._head_ns = reading.t_ns
        return [*spread, reading]

    def _look_for_bunches(self, t_ns: int) -> None:
        """Add a stamp; with enough of them, find the longest step within a bunch."""
        stamps = self._stamps
        if stamps and t_ns < stamps[-1]:
            stamps.clear()
        stamps.append(t_ns)
        if len(stamps) == _WINDOW and stamps[0] != stamps[-1]:
            self._bunch_ns = max(bunch_limit(np.array(stamps, np.int64)), 0.0)

    def _tell(self, t_ns: int) -> None:
        """Report once that there are batches, and each batch without an end."""
        if not self._has_batches:
            self._has_batches = True
            self._complain(
                "readings share a stamp: those of a batch are spread over the time to the next "
                "stamp, and wait for it [stamps_shared]"
                if not self._bunch_ns
                else "readings come in bunches: those of a bunch are spread over the time to the "
                "next one, and wait for it [stamps_bunched]"
            )
        if len(self._waiting) == _LARGEST_BATCH - 1:
            self._complain(
                f"more than {_LARGEST_BATCH} readings have the stamp {t_ns * 1e-9:.9f} s: the "
                "driver does not stamp them, so that they cannot be integrated"
            )

    def _spread(self, next_ns: int) -> list[LiveReading]:
        """Return the waiting readings with times of their own, before the next stamp [ns]."""
        waiting, self._waiting = self._waiting, []
        t_ns = self._head_ns
        interval_ns = (next_ns - t_ns) / (len(waiting) + 1)
        usual_ns = self._interval_ns
        if usual_ns and not 0.0 < interval_ns <= _STRETCH * usual_ns:
            interval_ns = usual_ns
        elif interval_ns <= 0.0:
            return []  # the clock was reset before an interval was known
        self._interval_ns = interval_ns
        return [
            reading._replace(t_ns=t_ns + round(k * interval_ns))
            for k, reading in enumerate(waiting, 1)
        ]
