# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The IMU as the rest of the package sees it: topics of its readings and of their truth."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from imu_sim_ros.core.conventions import (
    DELTA_ANGLE_TOPIC,
    DELTA_VELOCITY_TOPIC,
    ERROR_TOPICS,
    IDEAL_DELTA_ANGLE_TOPIC,
    IDEAL_DELTA_VELOCITY_TOPIC,
    IDEAL_IMU_TOPIC,
    IMU_TOPIC,
    TEMPERATURE_TOPIC,
    TRIADS,
)
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.records import Readings, column
from imu_sim_ros.core.types import Times
from imu_sim_ros.sensors.declaration import (
    Mounted,
    Payloads,
    Sensor,
    Topic,
    WithImu,
    import_on_call,
    topic,
)
from imu_sim_ros.sensors.errors.triad import variance_discrete
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.samples import Rows, Samples

if TYPE_CHECKING:
    from imu_sim_ros.bags.messages.blocks import RowTemplate
    from imu_sim_ros.bags.messages.encode import ImuEncoder

NAME: Final = "imu"
TYPE: Final = "sensor_msgs/msg/Imu"
_VECTOR: Final = ("geometry_msgs/msg/Vector3Stamped", "Vector3StampedEncoder")


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class ImuReadings(Readings):
    """The n readings of an IMU that are delivered."""

    true_t_ns: Times = field(metadata=column((), None))
    """(n,) true times of the samples [ns]."""


def reading_encoder(frame_id: str, valid: Any, encoding: str = "cdr") -> "ImuEncoder":
    """Return the encoder of messages with the variances that valid parameters give a reading."""
    from imu_sim_ros.bags.messages.encode import ImuEncoder

    variances = (variance_discrete(valid.imu, triad, valid.rate) for triad in TRIADS)
    return ImuEncoder(frame_id, encoding, *variances)


def readings(mounted: Mounted[ImuParameters], encoding: str, *orientation: str) -> Payloads:
    """Return the encoder of readings with the valid variances.

    :param orientation: names of the samples' orientation and its variance, if there is one.
    """
    cached: Any = None
    messages: ImuEncoder

    def payloads(samples: Samples, rows: Rows, valid: Any) -> "RowTemplate":
        nonlocal cached, messages
        if valid is not cached:
            cached, messages = valid, reading_encoder(mounted.frame, valid, encoding)
        columns = (samples.values[name][rows] for name in ("gyro", "accel", *orientation))
        return messages.pattern(samples.t_ns[rows], *columns)

    return payloads


def _increments(name: str, means: str, flag: str, truth: bool = False) -> Topic:
    """Return a topic of increments: mean readings times the nominal interval."""

    def make(mounted: Mounted[ImuParameters], encoding: str) -> Payloads:
        from imu_sim_ros.bags.messages.encode import Vector3StampedEncoder

        sampling, interval = mounted.parameters.sampling, 1.0 / mounted.environment.rate
        if sampling != "averaged":
            raise ConfigurationError(f"topic {name}: needs imu.sampling averaged; it is {sampling}")
        messages = Vector3StampedEncoder(mounted.frame, encoding)

        def payloads(samples: Samples, rows: Rows, _: object) -> "RowTemplate":
            t_ns = samples.true_t_ns if truth else samples.t_ns
            return messages.pattern(t_ns[rows], samples.values[means][rows] * interval)

        return payloads

    return Topic(name=name, type=_VECTOR[0], flags=(flag,), payloads=make, truth=truth)


def _error(name: str, column: str) -> Topic:
    """Return the topic of a true error."""
    flag = "biases" if column.endswith("_bias") else "errors"
    return topic(
        name, *_VECTOR, lambda samples, rows, _: (samples.values[column][rows],), flag, truth=True
    )


SENSOR: Final[Sensor[ImuParameters]] = Sensor(
    name=NAME,
    quantity=NAME,
    section=ImuParameters,
    with_imu=WithImu(),
    model=import_on_call("imu_sim_ros.sensors.imu.model", "Imu"),
    topics=(
        Topic(IMU_TOPIC, TYPE, (), readings),
        topic(
            *(IDEAL_IMU_TOPIC, TYPE, "ImuEncoder"),
            lambda samples, rows, _: (samples.ideal_gyro[rows], samples.ideal_accel[rows]),
            "ground_truth_imu",
            truth=True,
        ),
        *(_error(name, column) for name, column in ERROR_TOPICS.items()),
        topic(
            *(TEMPERATURE_TOPIC, "sensor_msgs/msg/Temperature", "TemperatureEncoder"),
            lambda samples, rows, _: (samples.temperature[rows],),
            "temperature",
            truth=True,
        ),
        _increments(DELTA_ANGLE_TOPIC, "gyro", "increments"),
        _increments(DELTA_VELOCITY_TOPIC, "accel", "increments"),
        _increments(IDEAL_DELTA_ANGLE_TOPIC, "ideal_gyro", "ground_truth_increments", True),
        _increments(IDEAL_DELTA_VELOCITY_TOPIC, "ideal_accel", "ground_truth_increments", True),
    ),
    readings=ImuReadings,
    faulty_parts=TRIADS,
    text="gyroscope and accelerometer",
    warnings=import_on_call("imu_sim_ros.sensors.imu.model", "range_warnings"),
)
