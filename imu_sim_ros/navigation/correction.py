# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Removal of the known, deterministic errors from readings.

The sensor reads ``omega_m = S_g omega + G f + b_g`` and ``f_m = S_a f + b_a`` (lecture eq. 7 and
25); a calibration gives S, G and b, and the correction solves for ``omega`` and ``f``.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import (
    IDENTITY_MATRIX,
    ZERO_MATRIX,
    ZERO_VECTOR,
    IntegratorParameters,
    Matrix,
    Vector,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Correction:
    """Known errors of an IMU; the defaults correct nothing."""

    gyroscope_bias: Vector = ZERO_VECTOR
    accelerometer_bias: Vector = ZERO_VECTOR
    gyroscope_scale_misalignment: Matrix = IDENTITY_MATRIX
    accelerometer_scale_misalignment: Matrix = IDENTITY_MATRIX
    gyroscope_g_sensitivity: Matrix = ZERO_MATRIX

    @property
    def gyroscope_inverse(self) -> Array:
        """(3, 3) the inverse of S of the gyroscope."""
        return np.linalg.inv(np.reshape(self.gyroscope_scale_misalignment, (3, 3)))

    @property
    def accelerometer_inverse(self) -> Array:
        """(3, 3) the inverse of S of the accelerometer."""
        return np.linalg.inv(np.reshape(self.accelerometer_scale_misalignment, (3, 3)))

    def apply(self, gyro: Array, accel: Array, dt: Array | float = 1.0) -> tuple[Array, Array]:
        """Return angular rate and specific force, without the known errors.

        :param gyro: (n, 3) readings [rad/s], or their integrals over dt [rad].
        :param accel: (n, 3) readings [m/s^2], or their integrals over dt [m/s].
        :param dt: (n, 1) lengths of the intervals [s] where the readings are integrals.
        """
        force = accel
        if self.accelerometer_bias != ZERO_VECTOR:
            force = force - np.asarray(self.accelerometer_bias) * dt
        if self.accelerometer_scale_misalignment != IDENTITY_MATRIX:
            force = force @ self.accelerometer_inverse.T
        rate = gyro
        if self.gyroscope_bias != ZERO_VECTOR:
            rate = rate - np.asarray(self.gyroscope_bias) * dt
        if self.gyroscope_g_sensitivity != ZERO_MATRIX:
            rate = rate - force @ np.reshape(self.gyroscope_g_sensitivity, (3, 3)).T
        if self.gyroscope_scale_misalignment != IDENTITY_MATRIX:
            rate = rate @ self.gyroscope_inverse.T
        return rate, force


NO_CORRECTION = Correction()
_NAMES = tuple(field.name for field in fields(Correction))


def correction_of(parameters: IntegratorParameters) -> Correction:
    """Return the correction that the parameters of an integrator describe."""
    values: dict[str, Any] = {name: getattr(parameters, name) for name in _NAMES}
    return Correction(**values)
