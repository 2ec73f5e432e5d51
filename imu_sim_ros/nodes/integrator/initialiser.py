# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The initial state of integration: given values, the truth, or levelled at rest.

Each initialiser receives readings and truths as they arrive, keeps what it may still need, and
returns a :class:`Start` once it can; it is not called again after that.
"""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import LiveReading, LiveState
from imu_sim_ros.navigation import initialisation
from imu_sim_ros.navigation.initialisation import Initial
from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.navigation.state import NavigationState
from imu_sim_ros.recordings.order import LiveGap

_KEPT = 20000
"""Number of readings and truths that may wait for each other: 2.5 s at 8 kHz."""


class Start(NamedTuple):
    """The initial condition of integration."""

    initial: Initial
    """State, correction and covariance at the first of the readings."""
    readings: list[LiveReading]
    """All readings since the start; the first one belongs to the state."""
    frames: tuple[str, ...] = ("", "")
    """Frames of the pose and of the body in the message that it started from; empty: none."""


class Initialiser(Protocol):
    """One of the ways to start."""

    def add_reading(self, reading: LiveReading) -> Start | None:
        """Add a reading; return the start once it is known."""

    def add_truth(self, truth: LiveState) -> Start | None:
        """Add a true state; return the start once it is known."""


def initialiser(
    parameters: IntegratorParameters, gap: LiveGap, complain: Callable[[str], None]
) -> Initialiser:
    """Return the start that the parameters choose.

    :param gap: longest step of the readings that is no gap.
    :param complain: is called with the reason while a start is not possible.
    """
    if parameters.initial_state == "truth":
        return _FromTruth(parameters)
    if parameters.initial_state == "level":
        return _FromRest(parameters, gap, complain)
    return _FromParameters(parameters)


class _FromParameters:
    """Start of dead reckoning at the state that the parameters state, with the first reading."""

    def __init__(self, parameters: IntegratorParameters) -> None:
        self._parameters = parameters

    def add_reading(self, reading: LiveReading) -> Start | None:
        """Return the start: the first reading is enough."""
        return Start(initialisation.from_parameters(self._parameters), [reading])

    def add_truth(self, truth: LiveState) -> Start | None:
        """Ignore the truth."""
        return None


class _FromTruth:
    """Starts at the first true state that has a reading with its stamp.

    Readings wait for the truth and truths for the readings, whichever topic is ahead. Where no
    stamps coincide, the last truth before the first reading is extrapolated to it with its velocity
    and rate.
    """

    def __init__(self, parameters: IntegratorParameters) -> None:
        self._parameters = parameters
        self._readings: deque[LiveReading] = deque(maxlen=_KEPT)
        self._truths: deque[LiveState] = deque(maxlen=_KEPT)

    def add_reading(self, reading: LiveReading) -> Start | None:
        """Return the start if a truth of the same time has come."""
        if self._readings and reading.t_ns <= self._readings[-1].t_ns:
            self._readings.clear()
        self._readings.append(reading)
        return self._match()

    def add_truth(self, truth: LiveState) -> Start | None:
        """Return the start if a reading of the same time has come."""
        if self._truths and truth.t_ns <= self._truths[-1].t_ns:
            self._truths.clear()
        self._truths.append(truth)
        return self._match()

    def _match(self) -> Start | None:
        """Return the start at the first time that readings and truth have in common."""
        readings, truths = self._readings, self._truths
        while readings and truths and readings[0].t_ns < truths[0].t_ns:
            readings.popleft()
        if not (readings and truths):
            return None
        t_ns = readings[0].t_ns
        while len(truths) > 1 and truths[1].t_ns <= t_ns:
            truths.popleft()
        # An older truth will do only once it is certain that none with this stamp follows.
        if truths[0].t_ns < t_ns and len(truths) == 1:
            return None
        rate = np.array(truths[0].angular_velocity_b)
        state = _extrapolate(truths[0], t_ns)
        initial = initialisation.from_state(self._parameters, state, rate)
        return Start(initial, list(readings), truths[0].frames)


class _FromRest:
    """Start of dead reckoning at the last of the readings at rest, from their averages."""

    def __init__(
        self, parameters: IntegratorParameters, gap: LiveGap, complain: Callable[[str], None]
    ) -> None:
        self._parameters, self._gap, self._complain = parameters, gap, complain
        self._readings: list[LiveReading] = []

    def add_reading(self, reading: LiveReading) -> Start | None:
        """Return the start after enough readings at rest."""
        parameters, readings = self._parameters, self._readings
        if readings and reading.t_ns == readings[-1].t_ns:  # it came twice
            return None
        if readings and self._gap.is_gap(step_ns := reading.t_ns - readings[-1].t_ns):
            self._complain(
                f"level: a step of {step_ns * 1e-9:.6f} s between two stamps, so that the "
                f"{parameters.level_time:g} s at rest begin again"
            )
            readings.clear()
        readings.append(reading)
        if not initialisation.is_long_enough(parameters, readings[0].t_ns, reading.t_ns):
            return None
        gyro = [reading.gyro for reading in readings]
        accel = [reading.accel for reading in readings]
        try:
            return Start(initialisation.from_rest(parameters, gyro, accel), [reading])
        except InputError as error:
            self._complain(str(error))
            self._readings = []
            return None

    def add_truth(self, truth: LiveState) -> Start | None:
        """Ignore the truth."""
        return None


def _extrapolate(truth: LiveState, t_ns: int) -> NavigationState:
    """Return a true state, extrapolated to a later time with its velocity and rate."""
    h = (t_ns - truth.t_ns) * 1e-9
    velocity = rotation.rotate(truth.q_wb, truth.velocity_b)
    turn = rotation.exp(np.multiply(truth.angular_velocity_b, h))
    q_wb = rotation.multiply(truth.q_wb, turn) if h else np.array(truth.q_wb)
    return NavigationState(np.array(truth.position) + velocity * h, velocity, q_wb)
