# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An estimated attitude, without positions, against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from imu_sim_ros.arguments import array, refuse, stamps
from imu_sim_ros.navigation.association import common_rows, interpolate_poses
from imu_sim_ros.navigation.evaluation import attitude_errors, tilt_and_heading
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.rotation import normalise
from imu_sim_ros.types import Array, Times

_NAMES = ("q_wb", "q_wi", "values")
"""Attributes with the quaternions of paths, simulated and recorded orientations."""


@dataclass(frozen=True, repr=False)
class AttitudeEvaluation:
    """The errors of an estimated attitude, at the m times that it shares with the truth."""

    t_ns: Times
    """(m,) [ns]."""
    attitude: Array
    """(m, 3) rotation vectors about the world's axes [rad]."""
    tilt: Array
    """(m,) angles between the estimated and the true vertical [rad]."""
    heading: Array
    """(m,) errors of the heading [rad]."""

    def __repr__(self) -> str:
        return (
            f"<AttitudeEvaluation of {len(self.t_ns)} attitudes: tilt {self.rms_tilt:.4g} rad rms, "
            f"heading {self.rms_heading:.4g} rad rms>"
        )

    @property
    def rms_attitude(self) -> float:
        """Root mean square of the attitude errors [rad]."""
        return float(np.sqrt(np.mean(np.sum(np.square(self.attitude), axis=1))))

    @property
    def rms_tilt(self) -> float:
        """Root mean square of the tilt errors [rad]."""
        return float(np.sqrt(np.mean(np.square(self.tilt))))

    @property
    def rms_heading(self) -> float:
        """Root mean square of the heading errors [rad]."""
        return float(np.sqrt(np.mean(np.square(self.heading))))


def has_attitude_alone(estimate: object) -> bool:
    """Return whether an object has attitudes in time and no positions."""
    if not hasattr(estimate, "t_ns") or hasattr(estimate, "position"):
        return False
    return any(hasattr(estimate, name) for name in _NAMES)


def evaluate_attitude(estimate: Any, truth: PoseSequence, max_gap: float) -> AttitudeEvaluation:
    """Compare attitudes with the truth; arguments as for ``evaluate``.

    :raises ConfigurationError: for arrays of another shape.
    :raises InputError: if both do not overlap in time.
    """
    name = next(name for name in _NAMES if hasattr(estimate, name))
    t_ns = stamps("estimate.t_ns", estimate.t_ns)
    if (t_ns[1:] <= t_ns[:-1]).any():
        refuse("estimate.t_ns", estimate.t_ns, "strictly increasing")
    given = array(f"estimate.{name}", getattr(estimate, name), (len(t_ns), 4))
    if (np.linalg.norm(given, axis=1) < 0.5).any():
        refuse(f"estimate.{name}", getattr(estimate, name), "unit quaternions (w, x, y, z)")
    rows = common_rows(t_ns, truth.t_ns, max_gap)
    q, true = normalise(given[rows]), interpolate_poses(truth, t_ns[rows]).q_wb
    return AttitudeEvaluation(t_ns[rows], attitude_errors(q, true), *tilt_and_heading(q, true))
