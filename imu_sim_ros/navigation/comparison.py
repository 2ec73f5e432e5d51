# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The comparison of an estimate with its truth; every error is estimate minus truth."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from imu_sim_ros.core.arguments import choice, number
from imu_sim_ros.core.blocks import blocks, squared_vector_lengths
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
    attitude_errors,
    distances,
    pairs,
    pose_nees,
    relative_errors,
)

_ALL: Final = slice(None)
_LAST: Final = slice(-1, None)


@dataclass(frozen=True, repr=False, eq=False)
class Comparison:
    """The errors of an estimate, estimate minus truth, at the m times that both cover.

    Errors are computed when they are asked for; their sizes alone need no memory for each time.
    It stays next to :class:`imu_sim_ros.core.records.States`, since its columns are errors, not
    states.
    """

    t_ns: Times
    """(m,) common times [ns]."""
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

    @cached_property
    def position(self) -> Array:
        """(m, 3) position errors in the world [m]."""
        return self._position_errors()

    @cached_property
    def attitude(self) -> Array:
        """(m, 3) attitude errors ``Log(q_estimate q_truth^-1)`` about the world's axes [rad]."""
        return self._attitude_errors()

    @cached_property
    def velocity(self) -> Array | None:
        """(m, 3) velocity errors in the world [m/s]; None if estimate or truth has no velocity."""
        return self._velocity_errors() if self._has_velocity else None

    def _position_errors(self, rows: slice = _ALL) -> Array:
        """Return the position errors of some rows (k, 3)."""
        return self.estimate.position[rows] - self.truth.position[rows]

    def _attitude_errors(self, rows: slice = _ALL) -> Array:
        """Return the attitude errors of some rows (k, 3)."""
        return attitude_errors(self.estimate.q_wb[rows], self.truth.q_wb[rows])

    def _velocity_errors(self, rows: slice = _ALL) -> Array:
        """Return the velocity errors of some rows (k, 3)."""
        return self.estimate.velocities()[rows] - self.truth.velocities()[rows]

    @property
    def _has_velocity(self) -> bool:
        """True if estimate and truth have velocities."""
        return self.estimate.velocity is not None and self.truth.velocity is not None

    @cached_property
    def rms_position(self) -> float:
        """Root mean square of the position errors [m]: the absolute trajectory error, ATE."""
        return self._rms(self._position_errors)

    @cached_property
    def rms_attitude(self) -> float:
        """Root mean square of the attitude errors [rad]."""
        return self._rms(self._attitude_errors)

    @cached_property
    def rms_velocity(self) -> float | None:
        """Root mean square of the velocity errors [m/s]."""
        return self._rms(self._velocity_errors) if self._has_velocity else None

    def _rms(self, errors: Callable[[slice], Array]) -> float:
        """Return the root mean square length of errors.

        :param errors: errors (k, 3) of some rows; all rows at once would need memory.
        """
        squares = np.empty(len(self.t_ns))
        for rows in blocks(len(squares)):
            squares[rows] = squared_vector_lengths(errors(rows))
        return float(np.sqrt(np.mean(squares)))

    @property
    def final_position(self) -> float:
        """Length of the last position error [m]."""
        return float(np.linalg.norm(self._position_errors(_LAST)[0]))

    @property
    def final_attitude(self) -> float:
        """Length of the last attitude error [rad]."""
        return float(np.linalg.norm(self._attitude_errors(_LAST)[0]))

    @property
    def final_velocity(self) -> float | None:
        """Length of the last velocity error [m/s]."""
        if not self._has_velocity:
            return None
        return float(np.linalg.norm(self._velocity_errors(_LAST)[0]))

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
    return Comparison(
        t_ns=unaligned.t_ns,
        distance=float(distances(true.position)[-1]),
        estimate=aligned,
        truth=true,
        alignment=alignment,
        kind=align_by,
        without_truth=len(estimate) - len(rows),
        coverage=coverage(estimate.t_ns, truth.t_ns, max_gap, allowance),
        unaligned=unaligned,
    )
