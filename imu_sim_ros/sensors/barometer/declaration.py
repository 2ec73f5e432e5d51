# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The barometer as the rest of the package sees it: samples, topics, table, readings."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.conventions import BAROMETER_BIAS_TOPIC, IDEAL_PRESSURE_TOPIC, PRESSURE_TOPIC
from imu_sim_ros.sensors.barometer.parameters import BarometerParameters
from imu_sim_ros.sensors.declaration import (
    AuxiliaryReadings,
    Model,
    Payloads,
    Sensor,
    Table,
    Topic,
)
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.noise import pressure_variance_discrete
from imu_sim_ros.sensors.errors.realised import realised_triad
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.types import Array, Times


class PressureBlock(NamedTuple):
    """n samples of a barometer, in the window of time of the IMU's block."""

    true_t_ns: NDArray[np.int64]
    """(n,) true times [ns]."""
    t_ns: NDArray[np.int64]
    """(n,) the stamps of the messages, with the errors of the board's clock [ns]."""
    release_t_ns: NDArray[np.int64]
    """(n,) when a message leaves the driver [ns]."""
    delivered: NDArray[np.int64]
    """(m,) rows that are delivered, in order."""
    pressure: Array
    """(n,) reading [Pa]."""
    ideal_pressure: Array
    """(n,) of the still air at the IMU's height [Pa]."""
    bias: Array
    """(n,) what is added to it, without white noise and rounding [Pa]."""


@dataclass(frozen=True, repr=False)
class PressureReadings(AuxiliaryReadings):
    """The n readings of a barometer that are delivered, and the truth of each."""

    t_ns: Times
    """(n,) stamps [ns], with the errors of the board's clock."""
    pressure: Array
    """(n,) as read [Pa]."""
    true_t_ns: Times
    """(n,) when the sample was taken [ns]."""
    ideal_pressure: Array
    """(n,) of the still air at the IMU's height [Pa]."""
    bias: Array
    """(n,) what is added to it, without white noise and rounding [Pa]."""


def _readings(frame: str, encoding: str) -> Payloads:
    from imu_sim_ros.bags.messages.encode import FluidPressureEncoder

    pressures = FluidPressureEncoder(frame, encoding)
    return lambda read, rows, _, now: pressures.pattern(
        read.t_ns[rows], read.pressure[rows], pressure_variance_discrete(now.imu)
    )


def _ideal(frame: str, encoding: str) -> Payloads:
    from imu_sim_ros.bags.messages.encode import FluidPressureEncoder

    pressures = FluidPressureEncoder(frame, encoding)
    return lambda read, *_: pressures.pattern(read.true_t_ns, read.ideal_pressure)


def _bias(frame: str, encoding: str) -> Payloads:
    from imu_sim_ros.bags.messages.encode import FluidPressureEncoder

    # Of all messages for one number with a stamp, the one in pascal.
    pressures = FluidPressureEncoder(frame, encoding)
    return lambda read, *_: pressures.pattern(read.true_t_ns, read.bias)


def _model(
    imu: ImuParameters, environment: EnvironmentParameters, t0_ns: int, _: Mapping[str, Model]
) -> Model:
    from imu_sim_ros.sensors.barometer.model import Barometer  # most boards have none

    return Barometer(imu, environment, t0_ns)


def _realised(own: BarometerParameters, seed: int) -> BarometerParameters:
    """Return the barometer of a seed, whose errors are those of a triad's first axis."""
    p = realised_triad(own.as_triad(), "barometer", seed)
    return dataclasses.replace(
        own,
        bias=p.bias[0],
        turn_on_bias_sigma=0.0,
        temperature_bias=p.temperature_bias[::3],
        temperature_bias_sigma=0.0,
    )


SENSOR = Sensor(
    name="barometer",
    quantity="pressure",
    model=_model,
    topics=(
        Topic(PRESSURE_TOPIC, "sensor_msgs/msg/FluidPressure", ("pressure",), _readings),
        Topic(
            IDEAL_PRESSURE_TOPIC,
            "sensor_msgs/msg/FluidPressure",
            ("ground_truth_pressure",),
            _ideal,
            True,
        ),
        Topic(
            BAROMETER_BIAS_TOPIC,
            "sensor_msgs/msg/FluidPressure",
            ("biases", "pressure"),
            _bias,
            True,
        ),
    ),
    table=Table("pressure", lambda read: read.pressure[:, None]),
    readings=PressureReadings,
    realised=_realised,
)
