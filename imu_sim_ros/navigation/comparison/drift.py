# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far dead reckoning has drifted from the truth, at the end and along the way."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.navigation.comparison.association import (
    common_rows,
    interpolate_poses,
    interpolate_vectors,
)
from imu_sim_ros.navigation.comparison.evaluation import attitude_errors, distances
from imu_sim_ros.navigation.state import NavigationState, NavigationStates
from imu_sim_ros.poses import PoseSequence

Array = NDArray[np.float64]


class Truth(NamedTuple):
    """The true motion at n times."""

    poses: PoseSequence
    velocity: Array
    """(n, 3) in the world [m/s]."""

    def at(self, t_ns: int) -> NavigationState:
        """Return the state at one time within the stamps."""
        at_ns = np.array([t_ns])
        poses = interpolate_poses(self.poses, at_ns)
        velocity = interpolate_vectors(self.poses.t_ns, self.velocity, at_ns)
        return NavigationState(poses.position[0], velocity[0], poses.q_wb[0])


class Drift(NamedTuple):
    """Truth less estimate at the m times common to both; vectors in the world."""

    t_ns: NDArray[np.int64]
    position: Array
    """(m, 3) [m]."""
    velocity: Array
    """(m, 3) [m/s]."""
    attitude: Array
    """(m, 3) rotation vectors [rad]."""
    distance: float
    """Length of the true path over these times [m]."""

    def final(self, name: str) -> float:
        """Return the length of the last error of ``position``, ``velocity`` or ``attitude``."""
        return float(np.linalg.norm(getattr(self, name)[-1]))

    def rms(self, name: str) -> float:
        """Return the root mean square of the lengths of an error."""
        return float(np.sqrt(np.mean(np.sum(np.square(getattr(self, name)), axis=1))))


def drift_from(states: NavigationStates, truth: Truth) -> Drift:
    """Return the errors of states at all stamps at which the truth is known.

    :raises InputError: where both do not overlap in time.
    """
    rows = common_rows(states.t_ns, truth.poses.t_ns)
    t_ns = states.t_ns[rows]
    poses = interpolate_poses(truth.poses, t_ns)
    velocity = interpolate_vectors(truth.poses.t_ns, truth.velocity, t_ns)
    return Drift(
        t_ns,
        poses.position - states.position[rows],
        velocity - states.velocity[rows],
        attitude_errors(states.q_wb[rows], poses.q_wb),
        float(distances(poses.position)[-1]),
    )
