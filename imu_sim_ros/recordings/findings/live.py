# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The same findings about messages that arrive one by one."""

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.conventions import TWIST_FRAMES
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import LiveReading, LiveState, Readings, States
from imu_sim_ros.recordings.clock import estimate_clock
from imu_sim_ros.recordings.findings.catalogue import (
    equality_findings,
    stamp_findings,
    twist_findings,
    unit_findings,
)
from imu_sim_ros.recordings.findings.finding import Finding
from imu_sim_ros.recordings.findings.measures import ReadingMeasures
from imu_sim_ros.recordings.findings.states import StateMeasures

START_NS: Final = 2_000_000_000
"""Time over which readings are judged together, first from the first one on [ns]."""
FEWEST: Final = 32
"""Readings from which on they are judged."""
_LARGEST_BATCH: Final = 1024
"""Readings with one stamp from which on they are no batch."""
_COMPARED_NS: Final = 500_000_000
"""Time of the messages whose twist is compared with their poses [ns]."""
_STEPS: Final = 100
"""Steps between the poses of a comparison, at most."""
_FEWEST_STATES: Final = 10
"""Messages from which on twist and poses are compared."""
_COMPARISONS: Final = 20
"""Comparisons in motion that agree, after which no more follow."""


class UnitWatch:
    """Judges the units of readings of two seconds, until the body moves or a unit is wrong.

    The first two seconds are judged; at rest again after 2, 4, 8, ... s, so that the work does not
    grow with the time at rest.
    """

    def __init__(self, source: str) -> None:
        """Initialise without readings.

        :param source: name of the topic.
        """
        self._source = source
        self._readings: list[LiveReading] = []
        self._begin_ns: int | None = None
        self._pause_ns = START_NS
        self.done = False
        """True if no more readings are needed."""

    def add(self, reading: LiveReading) -> list[Finding]:
        """Add a reading; return the findings every two seconds, none in between."""
        if self._begin_ns is None or reading.t_ns < self._begin_ns - self._pause_ns:
            self._begin_ns = reading.t_ns  # also after a reset of the clock
        if reading.t_ns < self._begin_ns:
            return []
        readings = self._readings
        readings.append(reading)
        if reading.t_ns - readings[0].t_ns < START_NS or len(readings) < FEWEST:
            return []
        self._readings = []
        self._begin_ns = reading.t_ns + self._pause_ns
        self._pause_ns *= 2
        times, rates, forces, _ = zip(*readings, strict=True)
        window = Readings.unchecked(
            t_ns=np.array(times, np.int64),
            gyro=np.array(rates),
            accel=np.array(forces),
            source=self._source,
        )
        measures = ReadingMeasures(window)
        findings = unit_findings(window, measures)
        self.done = bool(findings) or measures.moves
        return findings


class StampWatch:
    """Refuses readings whose stamps are all equal, or are no nanoseconds, until that ends."""

    def __init__(self) -> None:
        """Begin with the next reading."""
        self.begin()

    def begin(self) -> None:
        """Forget the stamps so far."""
        self._stamps: list[int] = []
        self._reason = ""
        self._is_equal = False
        self.done = False
        """True if the stamps are nanoseconds, so that no more are needed."""

    def add(self, t_ns: int) -> None:
        """Add a stamp [ns].

        :raises InputError: for each reading as long as there is no time in the stamps.
        """
        stamps = self._stamps
        if self._is_equal and t_ns != stamps[-1]:
            self.begin()
            stamps = self._stamps
        if not self._is_equal:
            stamps.append(t_ns)
        if len(stamps) == _LARGEST_BATCH and stamps[0] == stamps[-1]:
            window = np.array(stamps, np.int64)
            self._reason = equality_findings(window)[0].sentence()
            self._is_equal, self._stamps = True, stamps[-1:]
        elif len(stamps) >= FEWEST and stamps[0] != stamps[-1]:
            self._judge(stamps)
        if self._reason:
            raise InputError(self._reason)

    def _judge(self, stamps: list[int]) -> None:
        """Judge the unit of different stamps [ns]."""
        try:
            clock = estimate_clock(np.array(stamps, np.int64))
        except InputError:  # other stamps before equal ones
            self._stamps = [t_ns for t_ns in stamps if t_ns == stamps[-1]]
            return
        findings = stamp_findings(clock, "")
        reasons = [f.sentence() for f in findings if f.kind == "stamps_unit"]
        self._reason, self._stamps = next(iter(reasons), ""), []
        self.done = not reasons


class TwistWatch:
    """Compares the twist of odometry with the poses in the same messages, each half second.

    It ends with the first finding, or when the twist has agreed with a motion for ten seconds.
    """

    def __init__(self, source: str, twist_frame: str) -> None:
        """Initialise without messages.

        :param source: name of the topic.
        :param twist_frame: axes of the twist, body or world.
        """
        self._source, self._in_world = source, twist_frame == TWIST_FRAMES[1]
        self.begin()

    def begin(self) -> None:
        """Forget the messages so far."""
        self._states: list[LiveState] = []
        self._comparisons = 0
        self.done = False
        """True if no more messages are needed."""

    def add(self, states: Iterable[LiveState]) -> list[Finding]:
        """Add messages; return the findings about their twist."""
        findings: list[Finding] = []
        for state in states:
            waiting = self._states
            if waiting and state.t_ns <= waiting[-1].t_ns:
                waiting.clear()
            waiting.append(state)
            if state.t_ns - waiting[0].t_ns >= _COMPARED_NS and len(waiting) >= _FEWEST_STATES:
                findings = self._compare(waiting)
                waiting.clear()
                if findings or self._comparisons >= _COMPARISONS:
                    self.done = True
                    break
        return findings

    def _compare(self, states: Sequence[LiveState]) -> list[Finding]:
        """Return findings about velocities that contradict the poses."""
        chosen = states[:: max(len(states) // _STEPS, 1)]
        q_wb = np.array([state.q_wb for state in chosen])
        velocity = np.array([state.velocity_b for state in chosen])
        rate = np.array([state.angular_velocity_b for state in chosen])
        if self._in_world:
            rate = rotation.rotate_inverse(q_wb, rate)
        else:
            velocity = rotation.rotate(q_wb, velocity)
        record = States.unchecked(
            t_ns=np.array([state.t_ns for state in chosen], np.int64),
            position=np.array([state.position for state in chosen]),
            q_wb=q_wb,
            velocity=velocity,
            angular_velocity=rate,
            source=self._source,
        )
        measures = StateMeasures(record)
        self._comparisons += measures.moves
        return twist_findings(record, measures)
