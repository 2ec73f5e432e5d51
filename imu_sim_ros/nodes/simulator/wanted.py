# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which topics of a simulation are published."""

from imu_sim_ros import conventions
from imu_sim_ros.config import BODY, PublishParameters


def is_wanted(topic: str, imu: str, publish: PublishParameters) -> bool:
    """Return whether a topic is published for an IMU (``BODY``: for the body of several)."""
    if topic == conventions.TRUTH_TOPIC:
        return publish.ground_truth and imu in ("", BODY)
    return (
        imu != BODY
        and {
            conventions.IMU_TOPIC: True,
            conventions.IDEAL_IMU_TOPIC: publish.ground_truth_imu,
            conventions.GYROSCOPE_BIAS_TOPIC: publish.biases,
            conventions.ACCELEROMETER_BIAS_TOPIC: publish.biases,
            conventions.TEMPERATURE_TOPIC: publish.temperature,
            conventions.DELTA_ANGLE_TOPIC: publish.increments,
            conventions.DELTA_VELOCITY_TOPIC: publish.increments,
            conventions.IDEAL_DELTA_ANGLE_TOPIC: publish.ground_truth_increments,
            conventions.IDEAL_DELTA_VELOCITY_TOPIC: publish.ground_truth_increments,
        }[topic]
    )
