# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Unit quaternions and SO(3), in the three layouts that the package needs.

The functions exported here take arrays with time first, (n, 4) and (n, 3). :mod:`components` has
the same for components first, (4, n) and (3, n), for records processed in bulk;
:mod:`scalars` for tuples of floats, for single steps of a node. One set of properties is tested
for all of them. Imports nothing of the package.
"""

from imu_sim_ros.rotation import components, scalars
from imu_sim_ros.rotation.arrays import (
    IDENTITY,
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
    rate_and_acceleration,
    right_jacobian,
    right_jacobian_inverse,
    rotate,
    rotate_inverse,
    skew,
    to_euler,
    to_matrix,
)
from imu_sim_ros.types import Array

__all__ = [
    "IDENTITY",
    "Array",
    "body_rates_to_euler_rates",
    "canonical",
    "components",
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
    "rate_and_acceleration",
    "right_jacobian",
    "right_jacobian_inverse",
    "rotate",
    "rotate_inverse",
    "scalars",
    "skew",
    "to_euler",
    "to_matrix",
]
