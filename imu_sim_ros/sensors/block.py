# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Samples: blocks of what a simulated IMU and the sensors with it report; what was recorded."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from numpy.typing import NDArray

from imu_sim_ros import arguments
from imu_sim_ros.errors import InputError
from imu_sim_ros.timebase import span
from imu_sim_ros.trajectory.motion import Motion
from imu_sim_ros.types import Array, Times

if TYPE_CHECKING:
    from imu_sim_ros.inputs.tables import Table


class ImuBlock(NamedTuple):
    """n consecutive samples of one IMU; all arrays but ``delivered`` have n rows.

    Samples of the board's auxiliary sensors in the same window of time are with them on request.
    """

    first: int
    """Index of the first sample."""
    true_t_ns: Times
    """(n,) true times of the samples [ns]."""
    t_ns: Times
    """(n,) the stamps of the messages, with the errors of the sensor's clock [ns]."""
    release_t_ns: Times
    """(n,) when a message leaves the driver: true time and transport latency [ns]."""
    delivered: Times
    """(m,) rows that are delivered, in order: dropped ones are missing, duplicates occur twice."""
    gyro: Array
    """(n, 3) reading of the gyroscope [rad/s]."""
    accel: Array
    """(n, 3) reading of the accelerometer [m/s^2]."""
    temperature: Array
    """(n,) temperature of the sensor [degC]."""
    ideal_gyro: Array
    """(n, 3) angular rate of the IMU in its own frame, without any error [rad/s]."""
    ideal_accel: Array
    """(n, 3) specific force at the IMU in its own frame, without any error [m/s^2]."""
    gyro_bias: Array
    """(n, 3) sum of all bias terms of the gyroscope [rad/s]."""
    accel_bias: Array
    """(n, 3) sum of all bias terms of the accelerometer [m/s^2]."""
    gyro_scale: Array
    """(n, 3) scale factor of the gyroscope from turn-on and temperature; 1 without error."""
    accel_scale: Array
    """(n, 3) scale factor of the accelerometer from turn-on and temperature; 1 without error."""
    motion: Motion
    """The body's motion at ``true_t_ns``."""
    auxiliary: Mapping[str, Any] = MappingProxyType({})
    """Samples of the board's auxiliary sensors by what they measure, on request."""


class SensorBlock(NamedTuple):
    """n samples of another sensor in the window of an IMU's block.

    ``block.NAME`` is ``block.values["NAME"]``.
    """

    true_t_ns: Times
    """(n,) true times [ns]."""
    t_ns: Times
    """(n,) the stamps of the messages, with the errors of its clock [ns]."""
    release_t_ns: Times
    """(n,) when a message leaves the driver [ns]."""
    delivered: Times
    """(m,) rows that are delivered, in order."""
    values: Mapping[str, NDArray[Any]]
    """(n,) or (n, m) by name: readings and their truth."""

    def __getattr__(self, name: str) -> Any:
        """Return one of the values."""
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(f"no {name} was measured") from None


@dataclass(frozen=True, repr=False)
class Samples:
    """The n samples of a recorded sensor."""

    t_ns: Times
    """(n,) stamps [ns]."""
    values: Array
    """(n, 3) magnetic field [T], (n,) pressure [Pa], or (n, 4) orientation q_wi (w, x, y, z)."""
    covariance: Array
    """(n, 3, 3), of a pressure (n,): of each sample, as its message states it; 0: unknown."""
    name: str = "samples"

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        return f"<Samples {self.name}: {span(self.t_ns)}>"


def read_samples(table: "Table", path: str | Path, topic: str | None) -> Samples:
    """Return the samples of a sensor.

    :param table: of the sensor.
    :param path: the file or folder.
    :param topic: None: the sensor's own, or the only one of its type.
    :raises InputError: for a file that cannot be read, or has no such samples.
    """
    from imu_sim_ros.bags.read import open_bag
    from imu_sim_ros.bags.sensor_tables import read_table
    from imu_sim_ros.bags.text.reader import is_text

    path = arguments.path("path", path, arguments.BAG_OR_FILE)
    topic = arguments.topic("topic", topic)
    if topic is None and not is_text(path):
        with open_bag(path) as bag:
            names = (one.name for one in bag.topics if one.name.strip("/") == table.topic)
            topic = next(names, None)
    found = read_table(path, table, topic)
    if not len(found.t_ns):
        raise InputError(f"{path}: contains no {table.name}")
    return Samples(found.t_ns, found.values, found.covariance, arguments.name_of(path))
