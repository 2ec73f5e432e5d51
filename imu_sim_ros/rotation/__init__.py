# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Unit quaternions and SO(3): ``arrays`` with time first, ``components`` with components first."""

from imu_sim_ros.rotation.arrays import (
    IDENTITY,
    Array,
    body_rates_to_euler_rates,
    canonical,
    conjugate,
    continuous,
    cumulative_product,
    euler_rates_to_body_rates,
    exp,
    from_euler,
    from_matrix,
    log,
    multiply,
    normalise,
    right_jacobian,
    right_jacobian_inverse,
    rotate,
    rotate_inverse,
    skew,
    to_euler,
    to_matrix,
)

__all__ = [
    "IDENTITY",
    "Array",
    "body_rates_to_euler_rates",
    "canonical",
    "conjugate",
    "continuous",
    "cumulative_product",
    "euler_rates_to_body_rates",
    "exp",
    "from_euler",
    "from_matrix",
    "log",
    "multiply",
    "normalise",
    "right_jacobian",
    "right_jacobian_inverse",
    "rotate",
    "rotate_inverse",
    "skew",
    "to_euler",
    "to_matrix",
]
