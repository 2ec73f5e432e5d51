# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""VINS-Mono and VINS-Fusion: the IMU's part of their configuration (parameters.cpp)."""

import math

from imu_sim_ros.bags.text import decimal
from imu_sim_ros.consumers.values import ImuValues, comment, remarks


def config(values: ImuValues, *, fusion: bool) -> str:
    """Return the IMU's keys of a configuration of VINS-Mono, or of VINS-Fusion.

    Its covariance is ``F P F^T + V Q V^T`` with ``Q = diag(acc_n^2, ...)`` and V proportional to dt
    (integration_base.h): a sample's standard deviation, density * sqrt(rate). VINS-Fusion reads
    topic and noise of the IMU only where ``imu`` is 1.
    """
    root = math.sqrt(values.rate)
    name = "VINS-Fusion" if fusion else "VINS-Mono"
    head = comment(
        [
            f"{name}, fragment: the IMU's keys, to be pasted into a configuration with cameras.",
            "Values per sample at this rate, not densities: noise and walk are multiplied by the "
            f"square root of the rate, sqrt({values.rate:g} Hz) (integration_base.h).",
            *remarks(values),
        ]
    )
    numbers = "".join(
        f"{key}: {decimal(values.one(f'{triad}_{term}') * root)}\n"
        for key, triad, term in (
            ("acc_n", "accelerometer", "noise_density"),
            ("gyr_n", "gyroscope", "noise_density"),
            ("acc_w", "accelerometer", "random_walk"),
            ("gyr_w", "gyroscope", "random_walk"),
        )
    )
    switch = "imu: 1\n" if fusion else ""
    return (
        f'%YAML:1.0\n{head}{switch}imu_topic: "{values.topic}"\n'
        f"{numbers}g_norm: {decimal(values.gravity)}\n"
    )
