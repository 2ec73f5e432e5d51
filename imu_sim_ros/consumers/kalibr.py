# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""kalibr: ``imu.yaml`` (kalibr_common/ConfigReader.py, class ImuParameters)."""

from imu_sim_ros.bags.text import decimal
from imu_sim_ros.consumers.values import ImuValues, comment, remarks


def imu_yaml(values: ImuValues) -> str:
    """Return kalibr's imu.yaml, whole; it refuses densities that are not above 0."""
    numbers = values.positive_densities().items()
    head = comment(
        [
            "kalibr imu.yaml, whole: continuous-time densities, as the simulation has them.",
            "rad/s/sqrt(Hz), rad/s^2/sqrt(Hz), m/s^2/sqrt(Hz), m/s^3/sqrt(Hz)",
            *remarks(values, above_zero=True),
        ]
    )
    lines = "".join(f"{name}: {decimal(value)}\n" for name, value in numbers)
    return f"{head}{lines}rostopic: {values.topic}\nupdate_rate: {decimal(values.rate)}\n"
