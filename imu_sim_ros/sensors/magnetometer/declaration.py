# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Declaration of the magnetometer: samples, topics, table, readings."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.core.conventions import Vector
from imu_sim_ros.core.gate import FIELD
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.tables import Encode, Table
from imu_sim_ros.sensors.declaration import Sensor, SensorReadings, WithImu, import_on_call, topic
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.magnetometer.parameters import MagnetometerParameters, MagnetometerSwitches
from imu_sim_ros.sensors.recorded import RecordedSamples, read_samples

TYPE: Final = "sensor_msgs/msg/MagneticField"
BIAS_TYPE: Final = "geometry_msgs/msg/Vector3Stamped"
TOPIC: Final = "imu/mag"
IDEAL_TOPIC: Final = "ground_truth/mag"
BIAS_TOPIC: Final = "ground_truth/magnetometer_bias"
_STRONGEST: Final = 0.01
"""Largest field in tesla [T]: 200 times the Earth's, and a fiftieth of it in gauss."""


@dataclass(frozen=True, repr=False)
class MagneticReadings(SensorReadings):
    """n delivered readings of a magnetometer, with the truth of each."""

    field: Array
    """(n, 3) measured field [T]."""
    ideal_field: Array
    """(n, 3) field at the IMU in its frame, without errors [T]."""
    bias: Array
    """(n, 3) error added to the field times the sensor's response [T]."""


def variance_discrete(imu: ImuParameters) -> Vector:
    """Return the variance of one sample of the magnetometer per axis [T^2]."""
    p = imu.magnetometer
    density, step = np.asarray(p.noise_density), np.asarray(p.resolution)
    x, y, z = (density * density * p.rate + step * step / 12.0).tolist()
    return (x, y, z)


def _table_encoder(frame: str, encoding: str) -> Encode:
    """Return the encoder of rows of a table: MagneticField."""
    from imu_sim_ros.bags.messages.encode import MagneticFieldEncoder

    return MagneticFieldEncoder(frame, encoding).encode


def _realise(parameters: MagnetometerParameters, seed: int, _: str) -> MagnetometerParameters:
    """Return the parameters with the errors drawn for this unit."""
    if parameters == MagnetometerParameters():
        return parameters
    from imu_sim_ros.sensors.magnetometer.model import realise_magnetometer

    return realise_magnetometer(parameters, seed)


def _unit_hint(field: Array) -> str:
    """Return a hint for fields that are not in tesla; empty: they may be."""
    size = float(np.linalg.norm(field))
    if size <= _STRONGEST:
        return ""
    return (
        f"the first one is {size:.3g} T long; are the values in microtesla or gauss? They must be "
        "in tesla"
    )


TABLE: Final = Table(
    name="mag",
    title="Magnetometer",
    quantity=FIELD,
    headers={
        "euroc": "#timestamp [ns],b_RS_S_x [T],b_RS_S_y [T],b_RS_S_z [T]",
        "csv": "timestamp,field_x,field_y,field_z",
    },
    type=TYPE,
    topic=TOPIC,
    fields=("magnetic_field", "magnetic_field_covariance"),
    encoder=_table_encoder,
    truths=(IDEAL_TOPIC, BIAS_TOPIC),
    bias_type=BIAS_TYPE,
)

SENSOR: Final[Sensor[ImuParameters]] = Sensor(
    name="magnetometer",
    quantity="magnetic_field",
    section=MagnetometerParameters,
    with_imu=WithImu(MagnetometerSwitches, _unit_hint),
    model=import_on_call("imu_sim_ros.sensors.magnetometer.model", "Magnetometer"),
    topics=(
        topic(
            *(TOPIC, TYPE, "MagneticFieldEncoder"),
            lambda samples, rows, environment: (
                samples.field[rows],
                variance_discrete(environment.imu),
            ),
            "magnetic_field",
        ),
        topic(
            *(IDEAL_TOPIC, TYPE, "MagneticFieldEncoder"),
            lambda samples, rows, _: (samples.ideal_field[rows],),
            "ground_truth_magnetic_field",
            truth=True,
        ),
        topic(
            *(BIAS_TOPIC, BIAS_TYPE, "Vector3StampedEncoder"),
            lambda samples, rows, _: (samples.bias[rows],),
            *("biases", "magnetic_field"),
            truth=True,
        ),
    ),
    table=TABLE,
    values=lambda samples: samples.field,
    readings=MagneticReadings,
    realised=_realise,
)


def read_magnetometer(path: str | Path, topic: str | None = None) -> RecordedSamples:
    """Return the magnetic field in a bag or a EuRoC folder.

    :param path: the file or folder.
    :param topic: topic of type sensor_msgs/MagneticField; None: ``imu/mag``, or the only one.
    :returns: stamps, fields (n, 3) [T] in the sensor's frame, and their covariances [T^2].
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read, or has no magnetic field.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="mpu9250", duration=2, sensors=["magnetic_field"])
    >>> _ = flight.save(folder / "field.mcap", topics=["imu/data_raw", "imu/mag"])
    >>> ims.read_magnetometer(folder / "field.mcap").values.shape
    (200, 3)
    """
    return read_samples(TABLE, path, topic)
