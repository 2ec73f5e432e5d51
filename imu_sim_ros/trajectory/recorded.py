# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recorded motion: a B-spline fitted to poses, and how well it fits them."""

from dataclasses import replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation, timebase
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array
from imu_sim_ros.recordings.findings.catalogue import disturbance_findings, pose_findings
from imu_sim_ros.recordings.findings.policy import RECORDED_MOTION
from imu_sim_ros.recordings.findings.pose_order import sort_poses
from imu_sim_ros.recordings.order import longest_step_ns, usual_step
from imu_sim_ros.recordings.repair import impossible_motion_lines, repair_poses
from imu_sim_ros.trajectory.bspline import PoseSpline, UniformKnots
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.trajectory.parameters import PosesParameters
from imu_sim_ros.trajectory.spline_fit import fit

_LEAST_POSES: Final = 4
"""Smallest number of poses of a spline."""
_LEAST_SPACING: Final = 0.02  # s
_KNOTS: Final = 0.2  # spacing times cut-off: fine enough to follow, coarse enough to be solved well
_MAX_BRIDGED: Final = 500  # knots in a gap: its shape keeps 3 digits; from 2000 on none
_PEAK_SAMPLES: Final = 4  # per segment


def _highest_frequency(cutoff: float, knot_spacing: float) -> float:
    """Return the highest frequency that a spline follows [Hz].

    :param cutoff: frequency above which it is smooth [Hz].
    :param knot_spacing: time between its knots [s].
    """
    return min(cutoff, 0.5 / knot_spacing)


class FitReport(NamedTuple):
    """Quality of a spline's fit to its poses; times are from the first pose on."""

    poses: int
    """Number of poses that were used."""
    repeated: int
    """Number of poses that occurred twice in the file and were used once."""
    duration: float
    """Time from the first pose to the last one [s]."""
    rms_position: float
    """RMS distance of the spline from the poses [m]."""
    max_position: float
    """Largest distance of the spline from a pose [m]."""
    max_position_at: float
    """Time of the largest distance [s]."""
    rms_angle: float
    """RMS angle between the spline's attitudes and those of the poses [rad]."""
    max_angle: float
    """Largest such angle [rad]."""
    largest_gap: float
    """Longest time between two poses [s]."""
    largest_gap_at: float
    """Time of the start of this gap [s]."""
    peak_speed: float
    """Largest speed of the spline [m/s]."""
    peak_acceleration: float
    """Largest acceleration of the spline [m/s^2]."""
    peak_acceleration_at: float
    """Time of the largest acceleration [s]."""
    peak_rate: float
    """Largest angular rate of the spline [rad/s]."""
    peak_rate_at: float
    """Time of the largest angular rate [s]."""
    knot_spacing: float
    """Time between two knots [s]."""
    cutoff: float
    """Frequency above which the poses are smoothed [Hz]."""

    @property
    def highest_frequency(self) -> float:
        """Highest frequency that the spline follows [Hz]."""
        return _highest_frequency(self.cutoff, self.knot_spacing)

    def lines(self) -> list[str]:
        """Return the report as text."""
        mm, deg = 1e3, 180.0 / np.pi
        dropped = f", {self.repeated} duplicates left out" if self.repeated else ""
        return [
            f"{self.poses} poses over {self.duration:.2f} s{dropped}; "
            f"largest gap {self.largest_gap:.3f} s at {self.largest_gap_at:.2f} s",
            f"spline: knots every {self.knot_spacing:.3f} s; motion above "
            f"{self.highest_frequency:.3g} Hz is not in the readings; "
            f"position {self.rms_position * mm:.3f} mm RMS, {self.max_position * mm:.2f} mm at "
            f"most (at {self.max_position_at:.2f} s); angle {self.rms_angle * deg:.4f} deg RMS, "
            f"{self.max_angle * deg:.3f} deg at most",
            f"peaks: {self.peak_speed:.2f} m/s, {self.peak_acceleration:.2f} m/s^2, "
            f"{self.peak_rate:.2f} rad/s ({self.peak_rate * deg:.0f} deg/s)",
        ]


_REPAIRS: Final = {
    "poses_outlying": "left out",
    "poses_jump": "all later poses were moved to continue the motion",
    "poses_held": "the first of each was kept",
    "poses_arrival": "even times were used",
}
"""Repairs of the poses, by the kind of finding."""


class RecordedMotion:
    """A body that moves as recorded; time 0 is the first pose."""

    def __init__(self, poses: States, parameters: PosesParameters) -> None:
        """Fit the spline.

        :raises InputError: for poses that are too few or too far apart in time.
        """
        poses = sort_poses(poses)
        _check(poses, parameters)
        spacing = _knot_spacing(poses, parameters)
        self.t0_ns = int(poses.t_ns[0])
        """Stamp of the first pose [ns]."""
        t = timebase.seconds_since(poses.t_ns, self.t0_ns)
        self.repairs: list[str] = []
        """Texts of the repairs."""
        self._recorded = poses
        if parameters.robust:
            repaired = repair_poses(poses)
            findings = [*disturbance_findings(poses, repaired.disturbances), *pose_findings(poses)]
            self.repairs = [
                f"{parameters.file}: {finding.evidence}; {_REPAIRS[finding.kind]} [{finding.kind}]"
                for finding in findings
                if finding.kind in _REPAIRS
            ]
            if repaired.disturbances:
                t = repaired.t
                t_ns = self.t0_ns + np.round(t * 1e9).astype(np.int64)
                poses = replace(repaired.poses, t_ns=t_ns).in_order()
        self._parameters, self._t, self._poses = parameters, t, poses
        self._knots = UniformKnots(float(t[-1]), spacing)
        cutoff, outliers = parameters.cutoff, parameters.outlier_distance
        self._spline = fit(t, poses.position, poses.q_wb, self._knots, cutoff, outliers)

    @cached_property
    def report(self) -> FitReport:
        """Quality of the spline's fit."""
        return _report(self._t, self._poses, self._spline, self._knots, self._parameters.cutoff)

    @cached_property
    def warnings(self) -> list[str]:
        """Texts about suspicious poses."""
        poses, report, file = self._recorded, self.report, self._parameters.file
        findings = pose_findings(poses)
        if self._parameters.robust:
            findings = [finding for finding in findings if finding.kind not in _REPAIRS]
        else:
            findings = [*disturbance_findings(poses, repair_poses(poses).disturbances), *findings]
        texts = [
            f"{file}: {finding.evidence}; {finding.remedy} [{finding.kind}]"
            for finding in findings
            if RECORDED_MOTION.action(finding.kind)
        ]
        texts += impossible_motion_lines(
            file,
            report.peak_acceleration,
            report.peak_acceleration_at,
            report.peak_rate,
            report.peak_rate_at,
        )
        return texts

    @property
    def duration(self) -> float:
        """Time from the first to the last pose [s]."""
        return self._spline.duration

    @property
    def highest_frequency(self) -> float:
        """Highest frequency that the spline follows [Hz]."""
        return _highest_frequency(self._parameters.cutoff, self._knots.spacing)

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        return self._spline.sample(t)


def find_recorded_motion(trajectory: Trajectory) -> RecordedMotion | None:
    """Return the recorded motion in a trajectory, if there is one."""
    inner: object = trajectory
    while inner is not None:
        if isinstance(inner, RecordedMotion):
            return inner
        inner = getattr(inner, "inner", None)
    return None


def _check(poses: States, parameters: PosesParameters) -> None:
    """Refuse poses that are too few, or too far from each other."""
    count = len(poses.t_ns)
    if count < _LEAST_POSES:
        raise InputError(
            f"{parameters.file}: holds {count} poses; a spline needs {_LEAST_POSES} or more"
        )
    steps_ns = np.diff(poses.t_ns)
    gaps = np.flatnonzero(steps_ns > longest_step_ns(parameters.max_gap))
    if len(gaps):
        steps = timebase.seconds_since(steps_ns, 0)
        start = timebase.seconds_since(poses.t_ns[gaps], int(poses.t_ns[0]))
        raise InputError(
            f"{parameters.file}: a gap of {steps[k]:.3g} s at {gap_start:.3f} s after the first "
            "pose: "
            f"longer than trajectory.max_gap, {parameters.max_gap:g} s"
            for k, gap_start in zip(gaps, start, strict=True)
        )


def _knot_spacing(poses: States, parameters: PosesParameters) -> float:
    """Return the time between knots [s]: the given one, or one suited to data and cut-off."""
    steps = timebase.seconds_since(np.diff(poses.t_ns), 0)
    usual = usual_step(poses.t_ns) * 1e-9
    spacing = parameters.knot_spacing or max(_LEAST_SPACING, usual, _KNOTS / parameters.cutoff)
    if np.max(steps) > _MAX_BRIDGED * spacing:
        raise InputError(
            f"{parameters.file}: a gap of {np.max(steps):.3g} s is too many knots long: "
            f"trajectory.knot_spacing must be at least {np.max(steps) / _MAX_BRIDGED:.3g} s"
        )
    return spacing


def _report(
    t: Array, poses: States, spline: PoseSpline, knots: UniformKnots, cutoff: float
) -> FitReport:
    """Return how well the spline fits the poses."""
    fitted = spline.sample(t)
    distance = np.linalg.norm(fitted.position - poses.position, axis=-1)
    turn = rotation.multiply(rotation.conjugate(fitted.q_wb), poses.q_wb)
    angle = np.linalg.norm(rotation.log(turn), axis=-1)
    steps = np.diff(t)
    widest = int(np.argmax(steps))
    times = np.linspace(0.0, spline.duration, _PEAK_SAMPLES * knots.segments + 1)
    dense = spline.sample(times)
    acceleration, rate = (
        int(np.argmax(np.linalg.norm(values, axis=-1)))
        for values in (dense.acceleration, dense.angular_velocity)
    )
    return FitReport(
        poses=len(t),
        repeated=poses.repeated,
        duration=spline.duration,
        rms_position=_rms(distance),
        max_position=float(np.max(distance)),
        max_position_at=float(t[np.argmax(distance)]),
        rms_angle=_rms(angle),
        max_angle=float(np.max(angle)),
        largest_gap=float(steps[widest]),
        largest_gap_at=float(t[widest]),
        peak_speed=_peak(dense.velocity),
        peak_acceleration=_peak(dense.acceleration),
        peak_acceleration_at=float(times[acceleration]),
        peak_rate=_peak(dense.angular_velocity),
        peak_rate_at=float(times[rate]),
        knot_spacing=knots.spacing,
        cutoff=cutoff,
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _peak(vectors: Array) -> float:
    """Return the largest length of vectors (n, 3)."""
    return float(np.max(np.linalg.norm(vectors, axis=-1)))
