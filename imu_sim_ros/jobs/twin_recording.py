# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording next to its truth: readings that lie on the truth's spline."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.twin.alignment import axis_problems, coarse_offset, fit_mounting
from imu_sim_ros.calibration.twin.fit import Recording
from imu_sim_ros.calibration.twin.model import BodyMotion, KnownMotion
from imu_sim_ros.calibration.twin.pose_noise import (
    PoseNoise,
    add_pose_noise,
    highest_motion,
    noise_of,
)
from imu_sim_ros.core import arguments, timebase
from imu_sim_ros.core.arguments import BAG_OR_FILE
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import InputError, Problems, warn
from imu_sim_ros.core.records import Readings, States, replace_fields
from imu_sim_ros.core.rotation import to_matrix
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.jobs.flight import Flight, readings_of
from imu_sim_ros.jobs.readings import HasPoses, check_poses, judge_readings
from imu_sim_ros.jobs.selection import NOTHING, Selection
from imu_sim_ros.recordings.clock import estimate_clock
from imu_sim_ros.recordings.findings.catalogue import pose_findings
from imu_sim_ros.recordings.findings.policy import TWIN
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.trajectory.parameters import PosesParameters

_UNSAID: Final = 1.0
"""Length of readings without a truth that is not reported: margins, the clocks' offset [s]."""
_MARGIN: Final = 0.2
"""Ends of the truth that are left out: a spline has neighbours on one side only there [s]."""
_SHORTEST: Final = 10.0
"""Shortest readings with a truth [s]."""
_TURNING: Final = 0.02
"""RMS rate below which a motion determines nothing [rad/s]."""
_STILL_RATE: Final = 0.05
"""Angular rate above which a body is in motion [rad/s]."""
_STILL_SPEED: Final = 0.03
"""Speed above which a body is in motion [m/s]."""
_FILLED: Final = 10
"""Samples of the longest loss that is filled by a straight line."""
_PIECE: Final = 512
"""Samples without a longer loss that a spectrum needs."""


_DRAWS: Final = 2
"""Number of draws of the poses' noise."""
_ROOM: Final = 2.0
"""Cut-off over the highest frequency of the motion, up to which a fit goes."""
_SMOOTH: Final = 2.0
"""Cut-off of a path with next to no noise, which shows the rounding of the poses [Hz]."""
_SHARP: Final = 2.0
"""Cut-off of the spline that a fit sees over that of the motion: at the fit's highest frequency, a
quarter of it, 5e-5 of a rate are smoothed away."""
_LOWEST: Final = 1.0
"""Lowest cut-off [Hz]."""
_MIN_POSES: Final = 200
"""Smallest number of poses for a spectrum of the motion."""


class TwinRecording(NamedTuple):
    """A recording on the spline of its truth."""

    recording: Recording
    poses: States
    trajectory: Trajectory
    duration: float
    cutoff: float
    """Frequency above which motion is below the poses' noise, or counts as vibration [Hz]."""
    noise: PoseNoise
    """Noise of the poses."""
    noisy: tuple[Trajectory, ...]
    """The trajectory with more noise of the poses; none if they have no noise."""
    sharp: tuple[Trajectory, ...]
    """The trajectory and the noisy ones, smoothed only far above the frequencies of the fit unless
    noise hides what is faster."""
    gravity: float
    offset: float
    """First guess of true time minus stamp [s]."""
    r_ib: Array
    """(3, 3) first guess of the mounting."""
    t0_ns: int
    """Stamp of the truth's first pose [ns]."""
    name: str
    given_s: float
    """Time of all readings, of which the recording has those with a truth [s]."""
    notes: tuple[str, ...] = ()
    """Choices and conversions of reading, a line each."""

    @property
    def seconds(self) -> float:
        """Time of the readings with a truth [s]."""
        return float(np.ptp(self.recording.stamps))

    def coverage_lines(self) -> tuple[str, ...]:
        """Return a line if the truth covers a part of the readings only."""
        if self.given_s - self.seconds < _UNSAID:
            return ()
        return (
            f"the truth covers {self.seconds:.4g} of {self.given_s:.4g} s of the readings; the "
            "rest is not used",
        )

    def motion(self, t: Array) -> Motion:
        """Return the body's motion at times (n,) [s]."""
        return self.trajectory.sample(np.clip(t, 0.0, self.duration))

    def body_motion(self, t: Array) -> BodyMotion:
        """Return rate, specific force and angular acceleration in the body at times (n,) [s]."""
        return self._motion_along(self.trajectory, t)

    @property
    def truth(self) -> KnownMotion:
        """Known motion up to the cut-off; the rest counts as vibration."""
        return self._motion_along_path(self.trajectory, *self.noisy)

    @property
    def sharp_truth(self) -> KnownMotion:
        """Known motion for fits below the cut-off.

        A spline that is smooth above the cut-off lacks 0.3 % of the rates at half of it already,
        and the products of what it lacks above are slow specific forces.
        """
        return self._motion_along_path(*self.sharp)

    def _motion_along_path(self, trajectory: Trajectory, *noisy: Trajectory) -> KnownMotion:
        """Return the motion along a path, and along the same path with noise."""
        motion_at, *noisy_motions = (
            partial(self._motion_along, path) for path in (trajectory, *noisy)
        )
        return KnownMotion(motion_at, self.cutoff, tuple(noisy_motions))

    def _motion_along(self, trajectory: Trajectory, t: Array) -> BodyMotion:
        """Return the motion along a path at times (n,) [s]."""
        return body_motion(trajectory.sample(np.clip(t, 0.0, self.duration)), self.gravity)


def body_motion(motion: Motion, gravity: float) -> BodyMotion:
    """Return the ideal input of an IMU at the body's origin."""
    up = motion.acceleration + np.array([0.0, 0.0, gravity])
    r_bw = np.swapaxes(to_matrix(motion.q_wb), -1, -2)
    force = np.einsum("nij,nj->ni", r_bw, up)
    return BodyMotion(motion.angular_velocity, force, motion.angular_acceleration, r_bw)


def rows_in_motion(motion: Motion) -> Mask:
    """Return True (n,) for the times at which a body moves or turns."""
    rate, speed = (np.linalg.norm(v, axis=1) for v in (motion.angular_velocity, motion.velocity))
    return (rate > _STILL_RATE) | (speed > _STILL_SPEED)


def spline_recording(
    recording: Flight | Readings | str | Path,
    truth: HasPoses | str | Path,
    *,
    gravity: float,
    cutoff: float,
    max_offset: float,
    topic: str | None,
    truth_topic: str | None,
    skip_bad_rows: bool,
    selection: Selection = NOTHING,
) -> TwinRecording:
    """Return readings on the spline through their truth, at the time offset that fits best.

    :param cutoff: highest frequency of the spline [Hz]; less if the poses do not show as much.
    :param max_offset: largest time offset between readings and truth [s].
    :raises InputError: with a line for each reason why there is no twin.
    """
    problems = Problems()
    with problems.collect():
        skip = skip_bad_rows
        readings = readings_of("recording", recording, topic, "topic", skip, selection)
        readings = judge_readings(readings, TWIN)
        _check(readings)
    with problems.collect():
        poses, name = _poses(truth, truth_topic, skip_bad_rows)
    problems.tell()
    TWIN.judge(pose_findings(poses), warn)
    splines = _Splines(poses, name)
    noise, highest = splines.noise(cutoff)
    visible_cutoff = float(np.clip(_ROOM * highest, min(_LOWEST, cutoff), cutoff))
    paths = splines.draw_splines(noise, visible_cutoff)
    # Noise hides what smoothing takes, unless motion stands out of it up to the cut-off.
    sharp = paths if highest < cutoff else splines.draw_splines(noise, _SHARP * cutoff)
    trajectory, *noisy = paths
    duration = min(trajectory.duration, float(splines.t[-1]))
    t0_ns = int(poses.t_ns[0])
    stamps = timebase.seconds_since(readings.t_ns, t0_ns)
    candidates = (stamps > -max_offset) & (stamps < duration + max_offset)
    if np.count_nonzero(candidates) < 2 or np.ptp(stamps[candidates]) < _SHORTEST:
        raise InputError(
            f"{readings.source}: has {_common(stamps, duration):.3g} s in common with {name}; a "
            f"twin needs {_SHORTEST:g} s: their stamps must be of one clock"
        )
    empty = Recording(np.zeros(0), np.zeros((0, 6)), (), 1.0)
    unplaced = TwinRecording(
        recording=empty,
        poses=poses,
        trajectory=trajectory,
        duration=duration,
        cutoff=visible_cutoff,
        noise=noise,
        noisy=tuple(noisy),
        sharp=tuple(sharp),
        gravity=gravity,
        offset=0.0,
        r_ib=np.eye(3),
        t0_ns=t0_ns,
        name=readings.source,
        given_s=float(np.ptp(stamps)),
        notes=readings.notes,
    )
    return _place_on_truth(unplaced, readings, stamps, candidates, max_offset, name)


class _Splines:
    """Splines through true poses, and through the same poses with additional noise."""

    def __init__(self, poses: States, name: str) -> None:
        self.t = timebase.seconds_since(poses.t_ns, int(poses.t_ns[0]))
        self._poses, self._name = poses, name
        motion = self._spline(poses, _SMOOTH).sample(self.t)
        self._smooth = replace_fields(poses, position=motion.position, q_wb=motion.q_wb)

    def noise(self, cutoff: float) -> tuple[PoseNoise, float]:
        """Return the poses' noise, and the highest frequency [Hz] at which motion exceeds it.

        :param cutoff: frequency up to which motion counts [Hz].
        """
        noise = noise_of(self._poses, self._smooth)
        if not noise.is_present:
            return noise, np.inf
        times = np.arange(_MARGIN, self.t[-1] - _MARGIN, 0.25 / cutoff)
        if len(times) < _MIN_POSES:
            return noise, np.inf
        signal, *noisy = (
            np.concatenate([m.angular_velocity, m.acceleration], axis=1)
            for m in (spline.sample(times) for spline in self.draw_splines(noise, cutoff))
        )
        return noise, highest_motion(signal, noisy, 4.0 * cutoff)

    def draw_splines(self, noise: PoseNoise, cutoff: float) -> list[Trajectory]:
        """Return the spline through the poses, and those with more noise."""
        result = [self._spline(self._poses, cutoff)]
        if noise.is_present:
            rng = np.random.default_rng(0)
            for _ in range(_DRAWS):
                noisy = add_pose_noise(self._poses, *noise.draw(self._smooth, rng))
                result.append(self._spline(noisy, cutoff))
        return result

    def _spline(self, poses: States, cutoff: float) -> Trajectory:
        """Return the spline through poses, smooth up to a cutoff frequency [Hz]."""
        return build_trajectory(PosesParameters(file=self._name, cutoff=cutoff), lambda *_: poses)


def _place_on_truth(
    half: TwinRecording,
    readings: Readings,
    stamps: Array,
    candidates: Mask,
    max_offset: float,
    name: str,
) -> TwinRecording:
    """Return the recording with a first guess of clock and mounting.

    :param stamps: (n,) times of the readings [s].
    :param candidates: (n,) True for the readings that may have a truth.
    :param name: name of the truth.
    """
    duration = half.duration
    gyro, accel = readings.triads()
    offset = coarse_offset(
        stamps[candidates], gyro[candidates], half.body_motion, duration, max_offset
    )
    usable = (stamps + offset > _MARGIN) & (stamps + offset < duration - _MARGIN)
    if np.count_nonzero(usable) < 2 or np.ptp(stamps[usable]) < _SHORTEST:
        raise InputError(
            f"{readings.source}: has {_common(stamps + offset, duration):.3g} s in common with "
            f"{name}; a twin needs {_SHORTEST:g} s"
        )
    stamps = stamps[usable]
    y = np.concatenate([gyro[usable], accel[usable]], axis=1)
    motion = half.body_motion(stamps + offset)
    if np.sqrt(np.mean(motion.rate**2)) < _TURNING:
        raise InputError(f"{name}: hardly turns; a twin is found in motion, not at rest")
    problems = axis_problems(y[:, :3], y[:, 3:], motion)
    if problems:
        raise InputError([f"{readings.source}: {problem}" for problem in problems])
    return half._replace(
        recording=_cut_into_pieces(stamps, y, readings.source),
        offset=offset,
        r_ib=fit_mounting(y[:, :3], y[:, 3:], motion),
    )


def _poses(
    truth: HasPoses | str | Path, topic: str | None, skip_bad_rows: bool
) -> tuple[States, str]:
    """Return the true poses and their name."""
    if isinstance(truth, str | PathLike):
        from imu_sim_ros.formats.door import read_trajectory  # poses may be at hand

        path = arguments.path("truth", truth, BAG_OR_FILE)
        topic = arguments.topic("truth_topic", topic)
        return read_trajectory(path, topic, False, skip_bad_rows), f"the truth {truth}"
    arguments.topic("truth_topic", topic, of_a_file=False)
    return check_poses("truth", truth), "the truth"


def _check(readings: Readings) -> None:
    """Refuse readings of which an axis never changes."""
    problems = []
    for name, values in zip(TRIADS, readings.triads(), strict=True):
        if len(values) and np.any(np.ptp(values, axis=0) == 0.0):
            axis = "xyz"[int(np.argmin(np.ptp(values, axis=0)))]
            problems.append(f"{readings.source}: {name} {axis}: all readings are equal")
    if problems:
        raise InputError(problems)


def _common(stamps: Array, duration: float) -> float:
    """Return the time that readings and poses have in common [s]."""
    if not len(stamps):
        return 0.0
    return max(min(float(stamps[-1]), duration) - max(float(stamps[0]), 0.0), 0.0)


def _cut_into_pieces(stamps: Array, readings: Array, name: str) -> Recording:
    """Return a recording without repeated stamps, short losses filled, cut at long ones.

    :raises InputError: if no piece is long enough for a spectrum.
    """
    clock = estimate_clock(np.rint(stamps * 1e9).astype(np.int64))
    stamps, readings, interval = stamps[clock.rows], readings[clock.rows], clock.interval_ns * 1e-9
    filled = np.where(clock.missing <= _FILLED, clock.missing, 0)
    cut = clock.missing > _FILLED
    cut[[piece.start for piece in clock.pieces[1:]]] = True
    if filled.any():
        preceding = np.repeat(np.arange(len(stamps)), filled) - 1
        index = np.arange(len(preceding)) - np.repeat(np.cumsum(filled) - filled, filled) + 1
        steps = stamps[preceding + 1] - stamps[preceding]
        extra = stamps[preceding] + steps * index / (filled[preceding + 1] + 1)
        times = np.sort(np.concatenate([stamps, extra]))
        columns = [np.interp(times, stamps, readings[:, k]) for k in range(6)]
        stamps, readings = times, np.column_stack(columns)
    cuts = np.flatnonzero(cut) + np.cumsum(filled)[cut]
    edges = [0, *cuts.tolist(), len(stamps)]
    pieces = tuple(slice(a, b) for a, b in pairwise(edges))
    longest = max(piece.stop - piece.start for piece in pieces)
    if longest < _PIECE:
        raise InputError(
            f"{name}: the longest piece without a loss has {longest} samples; a twin needs {_PIECE}"
        )
    return Recording(stamps, readings, pieces, _round_rate(1.0 / interval))


def _round_rate(rate: float) -> float:
    """Return the nearest whole rate if a clock's skew can explain the difference."""
    return float(round(rate)) if abs(rate - round(rate)) < 1e-3 * rate else round(rate, 3)
