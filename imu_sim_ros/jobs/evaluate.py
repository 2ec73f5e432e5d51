# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A trajectory, or attitudes alone, against a truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, overload

import numpy as np

from imu_sim_ros.arguments import array, number, one_of, refuse
from imu_sim_ros.arguments import path as checked_path
from imu_sim_ros.arguments import topic as checked_topic
from imu_sim_ros.jobs import tracks
from imu_sim_ros.jobs.attitude import AttitudeEvaluation, evaluate_attitude, has_attitude_alone
from imu_sim_ros.jobs.readings import (
    BAG_OR_FILE,
    HasPoses,
    checked_poses,
)
from imu_sim_ros.navigation.association import (
    ALIGNMENTS,
    common_rows,
    interpolate_poses,
    interpolate_vectors,
)
from imu_sim_ros.navigation.association import align as laid_on
from imu_sim_ros.navigation.evaluation import (
    DELTA_UNITS,
    AbsoluteErrors,
    RelativeErrors,
    absolute_errors,
    distances,
    pairs,
    relative_errors,
    stated_nees,
    why_no_nees,
)
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.types import Array, Times

if TYPE_CHECKING:
    from imu_sim_ros.plots.style import Figure


@dataclass(frozen=True, repr=False)
class Evaluation:
    """The errors of an estimate, truth minus estimate, at the m times that both have."""

    t_ns: Times
    """(m,) [ns]."""
    position: Array
    """(m, 3) in the world [m]."""
    attitude: Array
    """(m, 3) rotation vectors about the world's axes [rad]."""
    velocity: Array | None
    """(m, 3) in the world [m/s]; None if either has no velocity."""
    distance: float
    """Length of the true path [m]."""
    estimate: PoseSequence
    """The aligned estimate."""
    truth: PoseSequence
    """The truth at the same times."""
    nees: dict[str, Any] | None = None
    """``position`` and ``attitude``, each with ``mean``, ``final`` and ``inside_band``, as the
    command has them; None if the estimate states no covariance that allows it, see `no_nees`."""
    no_nees: str | None = None
    """Why there is no NEES."""

    def __repr__(self) -> str:
        return (
            f"<Evaluation of {len(self.t_ns)} poses, {self.distance:.4g} m: "
            f"position {self.rms_position:.4g} m rms, attitude {self.rms_attitude:.4g} rad rms>"
        )

    @property
    def rms_position(self) -> float:
        """Root mean square of the position errors [m]: the absolute trajectory error, ATE."""
        return _rms(self.position)

    @property
    def rms_attitude(self) -> float:
        """Root mean square of the attitude errors [rad]."""
        return _rms(self.attitude)

    @property
    def rms_velocity(self) -> float | None:
        """Root mean square of the velocity errors [m/s]."""
        return None if self.velocity is None else _rms(self.velocity)

    @property
    def final_position(self) -> float:
        """Length of the last position error [m]."""
        return float(np.linalg.norm(self.position[-1]))

    @property
    def final_attitude(self) -> float:
        """Length of the last attitude error [rad]."""
        return float(np.linalg.norm(self.attitude[-1]))

    def relative(self, delta: float, unit: str = "s") -> RelativeErrors:
        """Return the relative pose errors (RPE).

        :param delta: > 0.
        :param unit: s, m (along the truth's path) or frames.
        :raises InputError: if the trajectory is shorter than delta.
        """
        number("delta", delta, f"above 0 {unit}", 0.0, above=True)
        one_of("unit", unit, DELTA_UNITS)
        return relative_errors(self.estimate, self.truth, *pairs(self.truth, delta, unit))

    def plot(self) -> Figure:
        """Return a matplotlib figure: both paths, and the errors per axis over time."""
        from imu_sim_ros.plots import navigation as pictures

        t = (self.t_ns - self.t_ns[0]) * 1e-9
        title = f"Estimate against the truth: {self.distance:.4g} m, ATE {self.rms_position:.4g} m"
        positions = (self.estimate.position, self.truth.position, self.position)
        return pictures.evaluation(t, *positions, self.attitude, title)


class HasAttitude(Protocol):
    """Anything with attitudes in time: orientations of a board, or an object with ``q_wb``."""

    @property
    def t_ns(self) -> Times:
        """(n,) [ns]."""


@overload
def evaluate(  # type: ignore[overload-overlap]  # what has positions is compared as a path
    estimate: HasPoses | str | Path,
    truth: HasPoses | str | Path,
    *,
    align: str = ...,
    max_gap: float = ...,
    estimate_topic: str | None = ...,
    truth_topic: str | None = ...,
) -> Evaluation: ...


@overload
def evaluate(
    estimate: HasAttitude,
    truth: HasPoses | str | Path,
    *,
    align: str = ...,
    max_gap: float = ...,
    estimate_topic: str | None = ...,
    truth_topic: str | None = ...,
) -> AttitudeEvaluation: ...


def evaluate(
    estimate: Any,
    truth: HasPoses | str | Path,
    *,
    align: str = "none",
    max_gap: float = 0.5,
    estimate_topic: str | None = None,
    truth_topic: str | None = None,
) -> Evaluation | AttitudeEvaluation:
    """Compare a trajectory, or attitudes alone, with the truth at the estimate's times.

    :param estimate: a track, odometry, or anything with ``t_ns``, ``position`` and ``q_wb``; a
        ``covariance`` (n, 6, 6) of position and attitude in the world's axes gives the NEES. Or the
        path of a TUM or EuRoC file or of a bag. Without positions (``q_wb``, ``q_wi`` or ``values``
        (n, 4), in the frame of the truth's body) attitudes are compared.
    :param truth: a path, or an object with ``t_ns``, ``position`` and ``q_wb``.
    :param align: align the estimate with the truth first: none, yaw, se3 or sim3.
    :param max_gap: the truth is not interpolated across longer gaps [s].
    :param estimate_topic: of a bag with several trajectories.
    :param truth_topic: likewise; None: ``ground_truth/odom`` if the bag has it.
    :returns: an :class:`Evaluation`, for attitudes alone an :class:`AttitudeEvaluation`.
    :raises InputError: if they do not overlap in time, or a path cannot be read.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="navigation", trajectory="circle", duration=30, seed=1)
    >>> ims.evaluate(ims.dead_reckon(flight), flight.truth)
    <Evaluation of 6000 poses, 74.99 m: position 0.1208 m rms, attitude 3.995e-05 rad rms>
    >>> board = ims.simulate(imu="mti3", duration=10, sensors=["orientation"], seed=1)
    >>> ims.evaluate(board.orientation, board.truth)
    <AttitudeEvaluation of 2000 attitudes: tilt 0.02025 rad rms, heading 0.03832 rad rms>
    """
    number("max_gap", max_gap, "a number of seconds above 0", 0.0, above=True)
    one_of("align", align, ALIGNMENTS)
    truth = _recorded("truth", truth, truth_topic)
    if has_attitude_alone(estimate):
        if align != "none":
            refuse("align", align, "none: attitudes alone are not aligned")
        return evaluate_attitude(estimate, checked_poses("truth", truth), max_gap)
    return _compared(_recorded("estimate", estimate, estimate_topic), truth, align, max_gap)


def _compared(estimate: HasPoses, truth: HasPoses, align: str, max_gap: float) -> Evaluation:
    own, known = checked_poses("estimate", estimate), checked_poses("truth", truth)
    rows = common_rows(own.t_ns, known.t_ns, max_gap)
    t_ns = own.t_ns[rows]
    true = interpolate_poses(known, t_ns)
    given = PoseSequence(t_ns, own.position[rows], own.q_wb[rows])
    alignment = laid_on(given.position, true.position, align)
    poses = alignment.apply(given)
    errors: AbsoluteErrors = absolute_errors(poses, true)
    velocity, own_speed, true_speed = None, _speed("estimate", estimate), _speed("truth", truth)
    if own_speed is not None and true_speed is not None:
        aligned = alignment.scale * own_speed[rows] @ alignment.r.T
        velocity = interpolate_vectors(known.t_ns, true_speed, t_ns) - aligned
    length = float(distances(true.position)[-1])
    stated = getattr(estimate, "covariance", None)
    if stated is not None:
        stated = array("estimate.covariance", stated, (len(own.t_ns), 6, 6))[rows]
    found, why = None, why_no_nees(align, stated)
    if why is None and stated is not None:
        found = stated_nees(stated, given, true, align)
        why = "the estimate's covariances are singular" if found is None else None
    both = (errors.position, errors.attitude)
    return Evaluation(t_ns, *both, velocity, length, poses, true, found, why)


class _Recorded(NamedTuple):
    """A trajectory of a file, as :func:`evaluate` takes objects."""

    t_ns: Times
    position: Array
    q_wb: Array
    velocity: Array | None
    covariance: Array | None


def _recorded(name: str, given: Any, topic: str | None) -> HasPoses:
    """Return what a path leads to, or what is no path as it is."""
    of_a_file = isinstance(given, str | Path)
    topic = checked_topic(f"{name}_topic", topic, of_a_file)
    if not of_a_file:
        return given  # checked_poses looks at it
    place = checked_path(name, given, BAG_OR_FILE)
    chosen = tracks.truth_topic(place, topic) if name == "truth" else topic
    track = tracks.read_track(place, chosen, covariance=name == "estimate")
    poses = track.poses
    stated = track.pose_covariance
    return _Recorded(poses.t_ns, poses.position, poses.q_wb, track.velocity, stated)


def _speed(name: str, given: HasPoses) -> Array | None:
    speed = getattr(given, "velocity", None)
    return None if speed is None else array(f"{name}.velocity", speed, (len(given.t_ns), 3))


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(errors), axis=1))))
