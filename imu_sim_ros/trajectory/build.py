# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectory of parameters: a motion cut, repeated, slowed, with rests and vibration."""

import math
from collections.abc import Collection
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError, InputError, name_source
from imu_sim_ros.core.records import States, replace_fields
from imu_sim_ros.core.rotation import from_matrix, multiply, upright
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.poses import read_poses
from imu_sim_ros.trajectory.calibration_motion import six_position, turntable
from imu_sim_ros.trajectory.kinds import MOTIONS
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.trajectory.parameters import (
    GIVEN,
    DriveParameters,
    LeadInParameters,
    PoseReader,
    PosesParameters,
    SixPositionParameters,
    TourParameters,
    TrajectoryParameters,
    TurntableParameters,
)
from imu_sim_ros.trajectory.profile import Derivatives, Phase, RateProfile, smooth_step
from imu_sim_ros.trajectory.tour import tour
from imu_sim_ros.trajectory.vibration import Vibrating, Vibration


def build_trajectory(
    parameters: TrajectoryParameters,
    pose_reader: PoseReader = read_poses,
    bare_motion: Trajectory | None = None,
) -> Trajectory:
    """Return the trajectory of parameters: a motion cut, repeated, and so on.

    :param parameters: the section ``trajectory`` of a simulation.
    :param pose_reader: reader of a file of poses; the default reads text files only.
    :param bare_motion: motion of the type ``given``.
    :raises ConfigurationError: for parameters that do not describe a motion.
    :raises InputError: for a file of poses that cannot be used.
    """
    p = parameters
    trajectory = motion_of_section(p, pose_reader) if bare_motion is None else bare_motion
    if p.length:
        if p.length > trajectory.duration:
            raise ConfigurationError(
                f"trajectory.length = {p.length:g}: the motion lasts {trajectory.duration:g} s"
            )
        trajectory = Cut(trajectory, p.length)
    if p.repeat != 1:
        trajectory = _repeat(trajectory, p)
    with_lead_in = p.lead_in.rest > 0.0
    rest_before = p.rest_before + (p.lead_in.rest + p.lead_in.jerk_time if with_lead_in else 0.0)
    if rest_before or p.rest_after or p.time_scale != 1.0:
        trajectory = Retimed(trajectory, _rests(trajectory.duration, rest_before, p))
    if with_lead_in:
        trajectory = LeadIn(trajectory, p.lead_in)
    v = p.vibration
    if any(v.acceleration + v.noise_rms + v.angular_rate + v.angular_noise_rms):
        trajectory = Vibrating(trajectory, Vibration(v))
    return trajectory


def build_segments(
    parameters: PosesParameters, pose_reader: PoseReader, topics: Collection[str]
) -> dict[str, Trajectory]:
    """Return the trajectories of segments of one file, which start and end together.

    :param parameters: the section ``trajectory`` of a simulation.
    :param pose_reader: reads a file of poses.
    :param topics: names of the segments; empty: the only one.
    :raises ConfigurationError: for parameters that do not describe a motion.
    :raises InputError: for a file of poses that cannot be used, and segments without common times.
    """
    states = {
        name: pose_reader(Path(parameters.file), *((name,) if name else ())) for name in topics
    }
    times = reduce(np.intersect1d, (poses.t_ns for poses in states.values()))
    if len(times) < 2:
        raise InputError(f"{parameters.file}: {', '.join(topics)} have no times in common")
    trajectories = {}
    for name, poses in states.items():
        common = poses.rows((poses.t_ns >= times[0]) & (poses.t_ns <= times[-1]))
        section = replace(parameters, topic=name)
        with name_source(name or parameters.file):
            trajectories[name] = build_trajectory(section, lambda *_, poses=common: poses)
    return trajectories


def motion_of_section(parameters: TrajectoryParameters, pose_reader: PoseReader) -> Trajectory:
    """Return the motion of a section, before it is cut, repeated and so on.

    :param pose_reader: reads a file of poses.
    :raises ConfigurationError: for parameters that do not describe a motion.
    :raises InputError: for a file of poses that cannot be used.
    """
    p = parameters
    if isinstance(p, PosesParameters):
        from imu_sim_ros.trajectory.recorded import RecordedMotion  # SciPy

        return RecordedMotion(poses_of_section(p, pose_reader), p)
    if isinstance(p, TurntableParameters):
        return turntable(p)
    if isinstance(p, SixPositionParameters):
        return six_position(p)
    if isinstance(p, TourParameters):
        return tour(p)
    if isinstance(p, DriveParameters):
        from imu_sim_ros.trajectory.drive import drive  # SciPy

        return drive(p)
    for section in type(p).__mro__:
        if section in MOTIONS:
            return MOTIONS[section](p)
    if p.type == GIVEN:
        raise ConfigurationError(
            "trajectory.type = 'given': an object or a function from Python; give it as trajectory="
        )
    if not (hasattr(p, "sample") and hasattr(p, "duration")):
        raise ConfigurationError(
            f"trajectory.type = {p.type!r}: {type(p).__name__} lacks duration or sample(t)"
        )
    return _OwnMotion(p)


def poses_of_section(parameters: PosesParameters, pose_reader: PoseReader) -> States:
    """Return the recorded poses of a section, in metres and with z up.

    :param pose_reader: reads a file of poses.
    :raises InputError: for a file of poses that cannot be used.
    """
    p = parameters
    poses = pose_reader(Path(p.file), *((p.topic,) if p.topic else ()))
    if p.scale == 1.0 and p.up == "z":
        return poses
    matrix = upright(p.up)
    return replace_fields(
        poses,
        position=p.scale * poses.position @ matrix.T,
        q_wb=multiply(from_matrix(matrix), poses.q_wb),
        velocity=None,
        covariance=None,
        twist_covariance=None,
    )


class _OwnMotion:
    """The motion of a user's own parameters, which may leave out the highest frequency."""

    def __init__(self, parameters: Any) -> None:
        self.sample = parameters.sample
        self.duration: float = parameters.duration
        self.highest_frequency: float = getattr(parameters, "highest_frequency", 0.0)


# Largest difference of joined ends: position [m], velocity [m/s], attitude [rad], rate [rad/s].
_MEETING: Final = 1e-6
_HALF_TURN: Final = 0.34375  # integral of 1 - 2 smooth_step over [0, 1/2]


class TimeMap(Protocol):
    """Time within a motion as a function of the time outside."""

    @property
    def duration(self) -> float:
        """Length outside [s]."""

    @property
    def fastest(self) -> float:
        """Highest rate of the time within the motion."""

    def sample(self, t: Array) -> Derivatives:
        """Return the time within the motion, its rate and its acceleration at times t (n,)."""


class Retimed:
    """A motion whose time is mapped by u(t), with the chain rule's derivatives."""

    def __init__(self, inner: Trajectory, time_map: TimeMap) -> None:
        self.inner = inner
        self._time_map = time_map
        self.duration = time_map.duration
        self.highest_frequency = inner.highest_frequency * time_map.fastest

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        u, rate, acceleration = (x[:, None] for x in self._time_map.sample(t))
        p, v, a, q_wb, omega, alpha = self.inner.sample(u[:, 0])
        square = rate * rate
        return Motion(
            position=p,
            velocity=rate * v,
            acceleration=square * a + acceleration * v,
            q_wb=q_wb,
            angular_velocity=rate * omega,
            angular_acceleration=square * alpha + acceleration * omega,
        )


class Cut:
    """The beginning of a motion."""

    def __init__(self, inner: Trajectory, duration: float) -> None:
        self.inner = inner
        self.duration = duration
        self.highest_frequency = inner.highest_frequency

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        return self.inner.sample(t)


class Loop:
    """The time map of a motion that starts again when it has ended."""

    def __init__(self, length: float, passes: float) -> None:
        """Set up from the length of one pass [s] and the number of passes, finite or not."""
        self._length = length
        self._passes = passes
        self.duration = length * passes
        self.fastest = 1.0

    def sample(self, t: Array) -> Derivatives:
        """Return the time within the motion."""
        passed = np.clip(np.floor(t / self._length), 0.0, self._passes - 1.0)
        return Derivatives(t - passed * self._length, np.ones_like(t), np.zeros_like(t))


class ThereAndBack:
    """The time map of a motion that runs to its end, turns smoothly and runs back.

    Time within the motion slows down, stops at the very end and runs backwards, over the
    given time; so any motion can be repeated without a jump.
    """

    def __init__(self, length: float, passes: float, turn: float) -> None:
        """Set up from the length of a pass [s], the number of passes, and a turn's time [s]."""
        self._length = length
        self._passes = passes
        self._turn = turn
        self._overlap = _HALF_TURN * turn  # part of the motion within half a turn
        self._straight = length - 2.0 * self._overlap
        self._period = self._straight + turn
        self.duration = (passes - 1.0) * self._period + length
        self.fastest = 1.0

    def sample(self, t: Array) -> Derivatives:
        """Return the time within the motion."""
        elapsed = t - self._overlap
        passed = np.clip(np.floor(elapsed / self._period), 0.0, self._passes - 1.0)
        elapsed = elapsed - passed * self._period
        turning = (elapsed > self._straight) & (passed < self._passes - 1.0)
        x = np.where(turning, (elapsed - self._straight) / self._turn, 0.0)
        step = smooth_step(x)
        straight = np.where(turning, self._straight, elapsed)
        u = self._overlap + straight + self._turn * (x - 2.0 * step.integral)
        backward = passed % 2.0 == 1.0
        sign = np.where(backward, -1.0, 1.0)
        return Derivatives(
            np.where(backward, self._length - u, u),
            sign * (1.0 - 2.0 * step.value),
            sign * (-2.0 / self._turn) * step.slope,
        )


class LeadIn:
    """A motion that begins with rest, displaced and back once before it sets out.

    The displacement is ``d b(x)`` with ``b = 256 x^4 (1 - x)^4`` and x the fraction of the
    jerk: it rises to d and falls back, and its first three derivatives vanish at both ends.
    """

    def __init__(self, inner: Trajectory, parameters: LeadInParameters) -> None:
        """Displace a motion that rests from 0 until the jerk is over."""
        self.inner = inner
        self._parameters = parameters
        self.duration = inner.duration
        # The jerk is a smooth bump of at most four periods.
        self.highest_frequency = max(inner.highest_frequency, 4.0 / parameters.jerk_time)

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        p = self._parameters
        motion = self.inner.sample(t)
        x = np.clip((t - p.rest) / p.jerk_time, 0.0, 1.0)
        s, slope = x * (1.0 - x), 1.0 - 2.0 * x
        cube = s * s * s
        value = 256.0 * cube * s
        derivative = 1024.0 * cube * slope / p.jerk_time
        second = 1024.0 * s * s * (3.0 * slope * slope - 2.0 * s) / p.jerk_time**2
        d = np.asarray(p.jerk)
        return motion._replace(
            position=motion.position + value[:, None] * d,
            velocity=motion.velocity + derivative[:, None] * d,
            acceleration=motion.acceleration + second[:, None] * d,
        )


def _repeat(inner: Trajectory, parameters: TrajectoryParameters) -> Retimed:
    """Return a motion several times; ``trajectory.repeat`` is 0 for a motion without end."""
    passes = parameters.repeat or math.inf
    if math.isinf(inner.duration):
        raise ConfigurationError(
            f"trajectory.repeat = {parameters.repeat}: the motion has no end; "
            "trajectory.length gives it one"
        )
    if parameters.repeat_mode == "loop":
        _check_closed(inner, parameters.repeat)
        return Retimed(inner, Loop(inner.duration, passes))
    turn = parameters.rest_transition
    if inner.duration < 2.0 * _HALF_TURN * turn:
        raise ConfigurationError(_shortness_line(turn, inner.duration))
    return Retimed(inner, ThereAndBack(inner.duration, passes, turn))


def _check_closed(inner: Trajectory, repeat: int) -> None:
    """Refuse to repeat a motion whose end is not its begin."""
    ends = inner.sample(np.array([0.0, inner.duration]))
    step = np.linalg.norm(ends.position[1] - ends.position[0])
    turn = 2.0 * np.arccos(min(1.0, abs(float(np.sum(ends.q_wb[0] * ends.q_wb[1])))))
    speed = np.linalg.norm(ends.velocity[1] - ends.velocity[0])
    rate = np.linalg.norm(ends.angular_velocity[1] - ends.angular_velocity[0])
    # The arc cosine near 1 is good to 1e-8 only.
    if max(step, turn, speed, rate) > _MEETING:
        raise ConfigurationError(
            f"trajectory.repeat = {repeat}: the motion ends {step:.3g} m, {speed:.3g} m/s, "
            f"{turn:.3g} rad and {rate:.3g} rad/s from its start; "
            "trajectory.repeat_mode there_and_back repeats any motion"
        )


def _rests(length: float, rest_before: float, parameters: TrajectoryParameters) -> RateProfile:
    """Return the time map of a motion of a length [s] between two rests [s]."""
    rest_after = parameters.rest_after
    ramp, scale = parameters.rest_transition, parameters.time_scale
    if math.isinf(length) and rest_after > 0.0:
        raise ConfigurationError(
            f"trajectory.rest_after = {rest_after:g}: the motion has no end; "
            "trajectory.length gives it one"
        )
    ramps = ((rest_before > 0.0) + (rest_after > 0.0)) * ramp
    cruise = length / scale - 0.5 * ramps
    if cruise < 0.0:
        raise ConfigurationError(_shortness_line(ramp, length))
    phases = [Phase(cruise, scale, scale)]
    if rest_before > 0.0:
        phases = [Phase(rest_before, 0.0, 0.0), Phase(ramp, 0.0, scale), *phases]
    if rest_after > 0.0:
        phases += [Phase(ramp, scale, 0.0), Phase(rest_after, 0.0, 0.0)]
    return RateProfile(phases)


def _shortness_line(transition: float, length: float) -> str:
    """Return the line about a motion shorter than its transitions."""
    return (
        f"trajectory.rest_transition = {transition:g}: must be shorter for a motion that lasts "
        f"{length:g} s"
    )
