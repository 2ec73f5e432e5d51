# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about a stream of readings of any length, from windows along it."""

from collections.abc import Callable
from typing import Final

from imu_sim_ros.core.records import Readings, concatenate
from imu_sim_ros.recordings.findings.finding import Finding
from imu_sim_ros.recordings.findings.measures import ReadingMeasures

_WINDOW: Final = 4096
"""Readings that are judged together."""
_EACH: Final = 4
"""Windows of each doubling of the length that are judged."""
Find = Callable[[Readings, ReadingMeasures], list[Finding]]


class ReadingSurvey:
    """Judgement of readings that need not fit into memory.

    Some faults show in motion alone, which may come late: windows along the whole stream are
    judged, ever fewer of them, so that the work hardly grows with its length.
    """

    def __init__(self, find: Find) -> None:
        """Initialise without readings.

        :param find: finds what is wrong with the readings of a window.
        """
        self._find = find
        self._waiting: Readings | None = None
        self._window = 0
        self._kinds: set[str] = set()
        self.readings = 0
        """Number of readings so far."""
        self.moved = False
        """True if a window in motion has been judged."""

    def add(self, block: Readings) -> list[Finding]:
        """Add readings; return the findings of kinds that no earlier window had."""
        self.readings += len(block)
        readings = block if self._waiting is None else concatenate([self._waiting, block])
        findings: list[Finding] = []
        while len(readings) >= _WINDOW:
            findings += self._judge(readings.rows(slice(_WINDOW)))
            readings = readings.rows(slice(_WINDOW, None))
        self._waiting = readings
        return findings

    def finish(self) -> list[Finding]:
        """Judge the readings of a record that is shorter than a window."""
        readings = self._waiting
        return [] if self._window or readings is None else self._judge(readings)

    def _judge(self, readings: Readings) -> list[Finding]:
        """Return the findings about the next window."""
        number, self._window = self._window, self._window + 1
        if not len(readings) or not _is_judged(number):
            return []
        measures = ReadingMeasures(readings)
        self.moved |= measures.moves
        findings = [f for f in self._find(readings, measures) if f.kind not in self._kinds]
        self._kinds |= {finding.kind for finding in findings}
        return findings


def _is_judged(number: int) -> bool:
    """Return True for the windows that are judged: all of the first eight, then every second."""
    doublings = max(number.bit_length() - _EACH.bit_length(), 0)
    return number % (1 << doublings) == 0
