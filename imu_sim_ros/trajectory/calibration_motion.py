# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration runs: a body that rests, is turned over and spins in place, one axis at a time."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.kinds import Vector
from imu_sim_ros.trajectory.motion import Motion
from imu_sim_ros.trajectory.parameters import SixPositionParameters, TurntableParameters
from imu_sim_ros.trajectory.profile import Phase, RateProfile

_UP: Final[tuple[Vector, ...]] = (
    (0.0, 0.0, 1.0),
    (0.0, 0.0, -1.0),
    (1.0, 0.0, 0.0),
    (-1.0, 0.0, 0.0),
    (0.0, 1.0, 0.0),
    (0.0, -1.0, 0.0),
)
_Z: Final = np.array([0.0, 0.0, 1.0])


class Turn(NamedTuple):
    """A phase of rotation about a body-fixed axis."""

    phase: Phase
    axis: Array
    """(3,) unit vector in the body."""


class CalibrationMotion:
    """A body at a fixed position that turns about one body axis after the other."""

    highest_frequency = 0.0
    """Turns are smooth over the time between two readings."""

    def __init__(self, first_q_wb: Array, turns: Sequence[Turn]) -> None:
        """Initialise with the attitude (4,) at the start and the turns, one after another."""
        self._profile = RateProfile([turn.phase for turn in turns])
        self.duration = self._profile.duration
        self._axes = np.array([turn.axis for turn in turns])
        changes = np.array([turn.phase.change for turn in turns])
        self._angles = np.concatenate([[0.0], np.cumsum(changes)[:-1]])
        steps = rotation.exp(changes[:-1, None] * self._axes[:-1])
        self._q_wb = rotation.cumulative_product(np.concatenate([first_q_wb[None], steps]))

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        k = self._profile.locate(t)
        angle, rate, acceleration = self._profile.sample(t)
        axis = self._axes[k]
        turned = (angle - self._angles[k])[:, None] * axis
        still = np.broadcast_to(np.zeros(3), axis.shape)
        return Motion(
            position=still,
            velocity=still,
            acceleration=still,
            q_wb=rotation.multiply(self._q_wb[k], rotation.exp(turned)),
            angular_velocity=rate[:, None] * axis,
            angular_acceleration=acceleration[:, None] * axis,
        )


def six_position(parameters: SixPositionParameters) -> CalibrationMotion:
    """Return the run: in each position rest to settle and to measure, then the next one.

    The positions are z up, z down, x up, x down, y up, y down; at the end the body is back in the
    first one, so that the run can be repeated.
    """
    positions = [upright(axis) for axis in _UP]
    turns = list(_rest(parameters.soak))
    for k, q in enumerate(positions):
        turns += _rest(parameters.settle + parameters.dwell)
        turns += _turn_over(q, positions[(k + 1) % len(positions)], parameters.transition)
    return CalibrationMotion(positions[0], turns)


def turntable(parameters: TurntableParameters) -> CalibrationMotion:
    """Return the run: each axis up, at rest, then at each rate in both directions.

    Between two rates the table stops and settles; at the end the body is back where it started.
    """
    axes = _UP if parameters.upside_down else _UP[::2]
    tilt = rotation.exp([parameters.tilt, 0.0, 0.0])
    positions = [rotation.multiply(tilt, upright(axis)) for axis in axes]
    turns = list(_rest(parameters.soak))
    for k, (axis, q) in enumerate(zip(axes, positions, strict=True)):
        turns += _rest(parameters.settle + parameters.dwell)
        for rate in parameters.rates:
            turns += _spin(np.array(axis), rate, parameters)
            turns += _spin(np.array(axis), -rate, parameters)
        # Both directions for the same time: the body is back in its position.
        turns += _turn_over(q, positions[(k + 1) % len(positions)], parameters.transition)
    return CalibrationMotion(positions[0], turns)


def upright(axis: Vector) -> Array:
    """Return the attitude q_wb (4,) in which a body axis points up, by the shortest rotation."""
    e = np.array(axis)
    across = np.cross(e, _Z)
    sine, cosine = float(np.linalg.norm(across)), float(e @ _Z)
    if sine == 0.0:
        return rotation.exp([0.0 if cosine > 0 else np.pi, 0.0, 0.0])
    return rotation.exp(across / sine * np.arctan2(sine, cosine))


def _rest(time: float) -> list[Turn]:
    """Return a rest of some time [s]."""
    return [Turn(Phase(time, 0.0, 0.0), _Z)]


def _turn_over(start: Array, end: Array, time: float) -> list[Turn]:
    """Return a turn between attitudes about one axis: faster over half the time, then slower."""
    vector = rotation.log(rotation.multiply(rotation.conjugate(start), end))
    angle = float(np.linalg.norm(vector))
    half, peak = 0.5 * time, 2.0 * angle / time
    axis = vector / angle
    return [Turn(Phase(half, 0.0, peak), axis), Turn(Phase(half, peak, 0.0), axis)]


def _spin(axis: Array, rate: float, parameters: TurntableParameters) -> list[Turn]:
    """Return the phases of a spin: spin up, turn at a constant rate, stop, settle."""
    ramp = parameters.ramp
    phases = (
        Phase(ramp, 0.0, rate),
        Phase(parameters.dwell, rate, rate),
        Phase(ramp, rate, 0.0),
        Phase(parameters.settle, 0.0, 0.0),
    )
    return [Turn(phase, axis) for phase in phases]
