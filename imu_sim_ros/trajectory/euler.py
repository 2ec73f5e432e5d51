# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attitude, body rates and body accelerations from Euler angles and their time derivatives."""

import numpy as np

from imu_sim_ros.trajectory.motion import Array
from imu_sim_ros.trajectory.profile import Derivatives


def attitude(
    roll: Derivatives, pitch: Derivatives, yaw: Derivatives, n: int
) -> tuple[Array, Array, Array]:
    """Return q_wb (n, 4), omega_b (n, 3) and its time derivative alpha_b (n, 3).

    ``omega_b = E(roll, pitch) d/dt (roll, pitch, yaw)`` is the lecture's eq. 37; alpha_b is that
    equation differentiated once more in closed form.

    :param roll: angle [rad] and its first and second time derivatives, arrays (n,) or floats.
    :param pitch: likewise.
    :param yaw: likewise.
    :param n: number of times.
    """
    sr_half, cr_half = np.sin(0.5 * roll.value), np.cos(0.5 * roll.value)
    sp_half, cp_half = np.sin(0.5 * pitch.value), np.cos(0.5 * pitch.value)
    q_wb = _quaternion(sr_half, cr_half, sp_half, cp_half, yaw.value, n)
    # Full angles from half angles: four products instead of four more sines.
    sr, cr = 2.0 * sr_half * cr_half, 1.0 - 2.0 * sr_half * sr_half
    sp, cp = 2.0 * sp_half * cp_half, 1.0 - 2.0 * sp_half * sp_half

    sr_cp, cr_cp = sr * cp, cr * cp
    omega, alpha = np.empty((n, 3)), np.empty((n, 3))
    omega_y = pitch.first * cr + yaw.first * sr_cp
    omega_z = yaw.first * cr_cp - pitch.first * sr
    omega[:, 0] = roll.first - yaw.first * sp
    omega[:, 1] = omega_y
    omega[:, 2] = omega_z
    turn = yaw.first * pitch.first
    alpha[:, 0] = roll.second - yaw.second * sp - turn * cp
    turn = turn * sp
    alpha[:, 1] = pitch.second * cr + yaw.second * sr_cp + roll.first * omega_z - turn * sr
    alpha[:, 2] = yaw.second * cr_cp - pitch.second * sr - roll.first * omega_y - turn * cr
    return q_wb, omega, alpha


def _quaternion(
    sr: Array | float,
    cr: Array | float,
    sp: Array | float,
    cp: Array | float,
    yaw: Array | float,
    n: int,
) -> Array:
    """Return q_wb (n, 4) from the sines and cosines of half the roll and half the pitch."""
    sy, cy = np.sin(0.5 * yaw), np.cos(0.5 * yaw)
    cc, ss, sc, cs = cr * cp, sr * sp, sr * cp, cr * sp
    q_wb = np.empty((n, 4))
    q_wb[:, 0] = cc * cy + ss * sy
    q_wb[:, 1] = sc * cy - cs * sy
    q_wb[:, 2] = cs * cy + sc * sy
    q_wb[:, 3] = cc * sy - ss * cy
    return q_wb
