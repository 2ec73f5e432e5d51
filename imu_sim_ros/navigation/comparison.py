# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The comparison of an estimate with its truth; every error is estimate minus truth."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from imu_sim_ros.core.arguments import choice, number
from imu_sim_ros.core.blocks import squared_vector_lengths
from imu_sim_ros.core.records import States
from imu_sim_ros.core.rotation import rotate_inverse
from imu_sim_ros.core.timebase import seconds_since
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.navigation.association import (
    Alignment,
    align,
    common_rows,
    poses_at,
)
from imu_sim_ros.navigation.coverage import ALLOWANCE, Coverage, coverage
from imu_sim_ros.navigation.evaluation import (
    DELTA_UNITS,
    PoseNees,
    RelativeErrors,
    absolute_errors,
    distances,
    pairs,
    pose_nees,
    relative_errors,
)


@dataclass(frozen=True, repr=False, eq=False)
class Comparison:
    """The errors of an estimate, estimate minus truth, at the m times that both cover.

    It stays next to :class:`imu_sim_ros.core.records.States`, since its columns are errors, not
    states.
    """

    t_ns: Times
    """(m,) common times [ns]."""
    position: Array
    """(m, 3) position errors in the world [m]."""
    attitude: Array
    """(m, 3) attitude errors, rotation vectors ``Log(q_estimate q_truth^-1)`` about the world's
    axes [rad]."""
    velocity: Array | None
    """(m, 3) velocity errors in the world [m/s]; None if estimate or truth has no velocity."""
    distance: float
    """Length of the true path [m]."""
    estimate: States
    """(m,) aligned estimate."""
    truth: States
    """(m,) truth, interpolated to the times of the estimate."""
    alignment: Alignment
    """Alignment of the estimate with the truth."""
    kind: str
    """Kind of the alignment: none, yaw, se3 or sim3."""
    without_truth: int
    """Number of poses of the estimate at whose times there is no truth."""
    coverage: Coverage
    """Share of the truth's time that is estimated, which errors cannot show."""
    unaligned: States = field(kw_only=True)
    """(m,) estimate before the alignment."""

    @property
    def t(self) -> Array:
        """(m,) times after the first common time [s]."""
        return seconds_since(self.t_ns, int(self.t_ns[0]))

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

    @property
    def final_velocity(self) -> float | None:
        """Length of the last velocity error [m/s]."""
        return None if self.velocity is None else float(np.linalg.norm(self.velocity[-1]))

    @cached_property
    def consistency(self) -> tuple[PoseNees | None, str | None]:
        """NEES of position, attitude and velocity, and why one of the first two has none."""
        velocity_b = linear = None
        if self.estimate.velocity is not None and self.truth.velocity is not None:
            estimate, truth = self.estimate, self.truth
            velocity_b = rotate_inverse(estimate.q_wb, estimate.velocities())
            velocity_b = velocity_b - rotate_inverse(truth.q_wb, truth.velocities())
        if self.unaligned.twist_covariance is not None:
            linear = self.unaligned.twist_covariance[:, :3, :3]
        pose = self.unaligned.covariance
        return pose_nees(pose, self.unaligned, self.truth, self.kind, velocity_b, linear)

    def relative(self, delta: float, unit: str = "s") -> RelativeErrors:
        """Return the relative pose errors (RPE).

        :param delta: time or distance between the poses of a pair, > 0.
        :param unit: s, m (along the truth's path) or frames.
        :raises ConfigurationError: for another delta or unit.
        :raises InputError: if the trajectory is shorter than delta.
        """
        number("delta", delta, f"above 0 {unit}", 0.0, exclusive=True)
        choice("unit", unit, DELTA_UNITS)
        return relative_errors(self.estimate, self.truth, pairs(self.truth, delta, unit))


def compare(
    estimate: States,
    truth: States,
    align_by: str = "none",
    max_gap: float = 0.0,
    allowance: float = ALLOWANCE,
) -> Comparison:
    """Compare an estimate with the truth, interpolated to the times of the estimate.

    :param estimate: states whose stamps increase.
    :param truth: states whose stamps increase.
    :param align_by: alignment of the estimate with the truth: none, yaw, se3 or sim3.
    :param max_gap: the truth is not interpolated across longer gaps [s]; 0: as in
        :func:`coverage`.
    :param allowance: time before the first pose that does not count against the coverage [s].
    :raises InputError: if both do not overlap in time, or cannot be aligned.
    """
    rows = common_rows(estimate.t_ns, truth.t_ns, max_gap)
    unaligned = estimate if len(rows) == len(estimate) else estimate.rows(rows)
    true = poses_at(truth, unaligned.t_ns)
    alignment = align(unaligned.position, true.position, align_by)
    aligned = unaligned if align_by == "none" else alignment.apply(unaligned)
    position, attitude = absolute_errors(aligned, true)
    velocity = None
    if aligned.velocity is not None and true.velocity is not None:
        velocity = aligned.velocity - true.velocity
    return Comparison(
        t_ns=unaligned.t_ns,
        position=position,
        attitude=attitude,
        velocity=velocity,
        distance=float(distances(true.position)[-1]),
        estimate=aligned,
        truth=true,
        alignment=alignment,
        kind=align_by,
        without_truth=len(estimate) - len(rows),
        coverage=coverage(estimate.t_ns, truth.t_ns, max_gap, allowance),
        unaligned=unaligned,
    )


def _rms(errors: Array) -> float:
    """Return the root mean square length of errors (n, 3)."""
    return float(np.sqrt(np.mean(squared_vector_lengths(errors))))
