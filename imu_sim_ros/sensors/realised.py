# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The board of one run: the constants drawn from its seed, in place of the parameters."""

import dataclasses
from typing import Any

from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.sensors import auxiliary_sensors
from imu_sim_ros.sensors.errors.realised import realised_triad
from imu_sim_ros.sensors.imu.parameters import ImuParameters


def realised_imu(imu: ImuParameters, seed: int) -> ImuParameters:
    """Return the IMU of this seed with nothing left to draw but the noise.

    Constants that differ from unit to unit are drawn. A turn-on bias is added to the constant one.
    A turn-on scale s, drawn per axis, multiplies the whole response of its axis,
    ``(1 + s + c) (S x + q x^2 + G f + H f^2)`` with the parts c of temperature and age: which
    parameters it multiplies and which it divides, their declarations say (``turn_on_scale``).
    Readings of the result differ from those of the seed by rounding only.
    """
    realised: dict[str, Any] = {
        **{name: realised_triad(imu.triad(name), name, seed) for name in TRIADS},
        **{one.name: one.realised(getattr(imu, one.name), seed) for one in auxiliary_sensors()},
    }
    return dataclasses.replace(imu, **realised)
