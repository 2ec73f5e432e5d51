# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which topics of a simulation are published, and which fault begins."""

from imu_sim_ros import conventions
from imu_sim_ros.config import BODY, InjectParameters, PublishParameters
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.sensor import Fault


def is_wanted(topic: str, imu: str, publish: PublishParameters) -> bool:
    """Return whether a topic is published for an IMU (``BODY``: for the body of several)."""
    if topic == conventions.TRUTH_TOPIC:
        return publish.ground_truth and imu in ("", BODY)
    if topic == conventions.TRUTH_FIX_TOPIC:
        return publish.ground_truth_fix and imu in ("", BODY)
    return (
        imu != BODY
        and {
            conventions.IMU_TOPIC: True,
            conventions.IDEAL_IMU_TOPIC: publish.ground_truth_imu,
            conventions.GYROSCOPE_BIAS_TOPIC: publish.biases,
            conventions.ACCELEROMETER_BIAS_TOPIC: publish.biases,
            conventions.MAGNETOMETER_BIAS_TOPIC: publish.biases and publish.magnetic_field,
            conventions.BAROMETER_BIAS_TOPIC: publish.biases and publish.pressure,
            conventions.TEMPERATURE_TOPIC: publish.temperature,
            conventions.MAGNETIC_FIELD_TOPIC: publish.magnetic_field,
            conventions.IDEAL_MAGNETIC_FIELD_TOPIC: publish.ground_truth_magnetic_field,
            conventions.ORIENTATION_TOPIC: publish.orientation,
            conventions.PRESSURE_TOPIC: publish.pressure,
            conventions.IDEAL_PRESSURE_TOPIC: publish.ground_truth_pressure,
            conventions.DELTA_ANGLE_TOPIC: publish.increments,
            conventions.DELTA_VELOCITY_TOPIC: publish.increments,
            conventions.IDEAL_DELTA_ANGLE_TOPIC: publish.ground_truth_increments,
            conventions.IDEAL_DELTA_VELOCITY_TOPIC: publish.ground_truth_increments,
        }[topic]
    )


def wanted_fault(wanted: InjectParameters, publish: PublishParameters) -> Fault:
    """Return the fault that is asked for.

    :raises ConfigurationError: for a fault that cannot be, and a sensor that is not published.
    """
    beside = conventions.AUXILIARY.get(wanted.triad)
    if beside is not None and not getattr(publish, beside):
        raise ConfigurationError(
            f"inject.triad = {wanted.triad}: needs publish.{beside}, which is false"
        )
    of_triad = wanted.kind in ("bias_jump", "saturation", "stuck")
    value = wanted.value if of_triad else wanted.value[0]
    triad = wanted.triad if of_triad or beside else ""
    return Fault(wanted.kind, wanted.duration, value, triad)
