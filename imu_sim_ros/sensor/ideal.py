"""The ideal reading: specific force and angular rate of a perfect IMU."""

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.trajectory.motion import Motion

Array = NDArray[np.float64]


def specific_force(motion: Motion, gravity: Array) -> Array:
    """Return ``f_b = R_wb.T (a_w - g_w)`` (n, 3) (lecture eq. 22)."""
    return rotation.rotate_inverse(motion.q_wb, motion.acceleration - gravity)
