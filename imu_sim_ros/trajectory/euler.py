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
    # Components first and in place: contiguous operands that stay in the processor's cache.
    omega, alpha, product = np.empty((3, n)), np.empty((3, n)), np.empty(n)
    np.subtract(roll.first, np.multiply(yaw.first, sp, out=product), out=omega[0])
    np.multiply(pitch.first, cr, out=omega[1])
    omega[1] += np.multiply(yaw.first, sr_cp, out=product)
    np.multiply(yaw.first, cr_cp, out=omega[2])
    omega[2] -= np.multiply(pitch.first, sr, out=product)
    turn = yaw.first * pitch.first
    np.subtract(roll.second, np.multiply(yaw.second, sp, out=product), out=alpha[0])
    alpha[0] -= np.multiply(turn, cp, out=product)
    turn = turn * sp
    np.multiply(pitch.second, cr, out=alpha[1])
    alpha[1] += np.multiply(yaw.second, sr_cp, out=product)
    alpha[1] += np.multiply(roll.first, omega[2], out=product)
    alpha[1] -= np.multiply(turn, sr, out=product)
    np.multiply(yaw.second, cr_cp, out=alpha[2])
    alpha[2] -= np.multiply(pitch.second, sr, out=product)
    alpha[2] -= np.multiply(roll.first, omega[1], out=product)
    alpha[2] -= np.multiply(turn, cr, out=product)
    return q_wb, omega.T, alpha.T


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
    q_wb, product = np.empty((4, n)), np.empty(n)
    np.multiply(cc, cy, out=q_wb[0])
    q_wb[0] += np.multiply(ss, sy, out=product)
    np.multiply(sc, cy, out=q_wb[1])
    q_wb[1] -= np.multiply(cs, sy, out=product)
    np.multiply(cs, cy, out=q_wb[2])
    q_wb[2] += np.multiply(sc, sy, out=product)
    np.multiply(cc, sy, out=q_wb[3])
    q_wb[3] -= np.multiply(ss, cy, out=product)
    result: Array = q_wb.T
    return result
