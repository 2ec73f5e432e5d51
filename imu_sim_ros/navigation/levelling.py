# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roll, pitch and the gyroscope's bias from readings at rest."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.errors import InputError

Array = NDArray[np.float64]

_GRAVITY_TOLERANCE: Final = 0.05
"""Of gravity, by which the mean force may differ from it at least."""
_SIGMAS: Final = 4.0


class Level(NamedTuple):
    """What a rest reveals about a body."""

    q_wb: Array
    """(4,) attitude with the given yaw."""
    gyroscope_bias: Array
    """(3,) [rad/s]."""


def level(
    gyro: Array,
    accel: Array,
    gravity: Sequence[float],
    yaw: float = 0.0,
    uncertainty: float = 0.0,
) -> Level:
    """Return the attitude of a body at rest, and its gyroscope's bias.

    The mean specific force points against gravity: ``f = -R^T g`` (Groves, section 5.6.2), which
    gives roll and pitch but no yaw; the mean rate of a body at rest is the bias.

    :param gyro: (n, 3) readings at rest [rad/s].
    :param accel: (n, 3) readings at rest [m/s^2].
    :param gravity: (3,) along the world's z axis [m/s^2].
    :param yaw: heading, which rest does not reveal [rad].
    :param uncertainty: standard deviation of the mean force's length by the sensor's own errors
        [m/s^2]; gravity may be missed by four of it, or by 5 %, whichever is more.
    :raises InputError: where the readings cannot be those of a body at rest, or gravity is not
        along z.
    """
    if not len(accel):
        raise InputError("no readings to level with")
    if gravity[0] != 0.0 or gravity[1] != 0.0:
        raise InputError(f"gravity {list(gravity)}: to level a body it must be along z")
    force = accel.mean(axis=0)
    strength = float(np.linalg.norm(gravity))
    measured = float(np.linalg.norm(force))
    tolerance = max(_GRAVITY_TOLERANCE * strength, _SIGMAS * uncertainty)
    if strength == 0.0 or abs(measured - strength) > tolerance:
        raise InputError(
            f"the mean specific force is {measured:.4g} m/s^2 and gravity {strength:.4g} m/s^2: "
            "the body is not at rest and cannot be levelled"
        )
    x, y, z = force * -np.sign(gravity[2])
    roll = np.arctan2(y, z)
    pitch = np.arctan2(-x, np.hypot(y, z))
    return Level(rotation.from_euler([roll, pitch, yaw]), gyro.mean(axis=0))
