# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where landmarks would be seen from given poses, against where they were seen."""

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.camera.model import CameraModel
from imu_sim_ros.config.cameras import CameraParameters

Array = NDArray[np.float64]


def reprojection_errors(
    camera: CameraParameters, position: Array, q_wb: Array, landmarks: Array, uv: Array
) -> Array:
    """Return ``uv - project(T_bc^-1 T_wb^-1 p_w)`` (n, 2) [px].

    Not a number where a landmark would be behind the camera or outside its model.

    :param position: (n, 3) p_wb [m] of the body when each feature was seen.
    :param q_wb: (n, 4).
    :param landmarks: (n, 3) p_w [m] of what was seen.
    :param uv: (n, 2) where it was seen.
    """
    r_bc, p_bc = camera.pose()
    in_body = rotation.rotate_inverse(q_wb, landmarks - position)
    pixels, valid = CameraModel(camera).project((in_body - p_bc) @ r_bc)
    errors: Array = np.where(valid[:, None], uv - pixels, np.nan)
    return errors
