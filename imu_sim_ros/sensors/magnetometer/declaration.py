# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The magnetometer as the rest of the package sees it: samples, topics, table, readings."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.conventions import (
    IDEAL_MAGNETIC_FIELD_TOPIC,
    MAGNETIC_FIELD_TOPIC,
    MAGNETOMETER_BIAS_TOPIC,
)
from imu_sim_ros.sensors.declaration import (
    AuxiliaryReadings,
    Model,
    Payloads,
    Sensor,
    Table,
    Topic,
)
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.noise import field_variance_discrete
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.magnetometer.parameters import MagnetometerParameters
from imu_sim_ros.types import Array, Times


class MagneticBlock(NamedTuple):
    """n samples of a magnetometer, in the window of time of the IMU's block."""

    true_t_ns: NDArray[np.int64]
    """(n,) true times [ns]."""
    t_ns: NDArray[np.int64]
    """(n,) the stamps of the messages, with the errors of the board's clock [ns]."""
    release_t_ns: NDArray[np.int64]
    """(n,) when a message leaves the driver [ns]."""
    delivered: NDArray[np.int64]
    """(m,) rows that are delivered, in order."""
    field: Array
    """(n, 3) reading [T]."""
    ideal_field: Array
    """(n, 3) field at the IMU in its own frame, without any error [T]."""
    bias: Array
    """(n, 3) what in the reading does not depend on the field, without white noise [T]."""


@dataclass(frozen=True, repr=False)
class MagneticReadings(AuxiliaryReadings):
    """The n readings of a magnetometer that are delivered, and the truth of each."""

    t_ns: Times
    """(n,) stamps [ns], with the errors of the board's clock."""
    field: Array
    """(n, 3) as read [T]."""
    true_t_ns: Times
    """(n,) when the sample was taken [ns]."""
    ideal_field: Array
    """(n, 3) the field at the IMU in its own frame, without any error [T]."""
    bias: Array
    """(n, 3) what is added to the field times the sensor's response [T]."""


def _readings(frame: str, encoding: str) -> Payloads:
    from imu_sim_ros.bags.messages.encode import MagneticFieldEncoder

    fields = MagneticFieldEncoder(frame, encoding)
    return lambda read, rows, _, now: fields.pattern(
        read.t_ns[rows], read.field[rows], field_variance_discrete(now.imu)
    )


def _ideal(frame: str, encoding: str) -> Payloads:
    from imu_sim_ros.bags.messages.encode import MagneticFieldEncoder

    fields = MagneticFieldEncoder(frame, encoding)
    return lambda read, *_: fields.pattern(read.true_t_ns, read.ideal_field)


def _bias(frame: str, encoding: str) -> Payloads:
    from imu_sim_ros.bags.messages.encode import Vector3StampedEncoder

    vectors = Vector3StampedEncoder(frame, encoding)
    return lambda read, *_: vectors.pattern(read.true_t_ns, read.bias)


def _model(
    imu: ImuParameters, environment: EnvironmentParameters, t0_ns: int, _: Mapping[str, Model]
) -> Model:
    from imu_sim_ros.sensors.magnetometer.model import Magnetometer  # most boards have none

    return Magnetometer(imu, environment, t0_ns)


def _realised(parameters: MagnetometerParameters, seed: int) -> Any:
    if parameters == MagnetometerParameters():
        return parameters
    from imu_sim_ros.sensors.magnetometer.model import realised_magnetometer

    return realised_magnetometer(parameters, seed)


SENSOR = Sensor(
    name="magnetometer",
    quantity="magnetic_field",
    model=_model,
    topics=(
        Topic(
            MAGNETIC_FIELD_TOPIC, "sensor_msgs/msg/MagneticField", ("magnetic_field",), _readings
        ),
        Topic(
            *(
                IDEAL_MAGNETIC_FIELD_TOPIC,
                "sensor_msgs/msg/MagneticField",
                ("ground_truth_magnetic_field",),
            ),
            *(_ideal, True),
        ),
        Topic(
            *(
                MAGNETOMETER_BIAS_TOPIC,
                "geometry_msgs/msg/Vector3Stamped",
                ("biases", "magnetic_field"),
            ),
            *(_bias, True),
        ),
    ),
    table=Table("mag", lambda read: read.field),
    readings=MagneticReadings,
    realised=_realised,
)
