# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Declaration of the barometer: samples, topics, table, readings."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from imu_sim_ros.core.gate import PRESSURE
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.tables import Encode, Table
from imu_sim_ros.sensors.barometer.parameters import BarometerParameters, BarometerSwitches
from imu_sim_ros.sensors.declaration import Sensor, SensorReadings, WithImu, import_on_call, topic
from imu_sim_ros.sensors.errors.realised import realise_triad
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import to_triad
from imu_sim_ros.sensors.recorded import RecordedSamples, read_samples

TYPE: Final = "sensor_msgs/msg/FluidPressure"
_ENCODER: Final = "FluidPressureEncoder"
TOPIC: Final = "imu/pressure"
IDEAL_TOPIC: Final = "ground_truth/pressure"
BIAS_TOPIC: Final = "ground_truth/barometer_bias"
_LOWEST: Final = 5000.0
"""Pressure of the standard atmosphere at 20 km [Pa]; in hPa, readings are at most 1100."""


@dataclass(frozen=True, repr=False)
class PressureReadings(SensorReadings):
    """n delivered readings of a barometer, with the truth of each."""

    pressure: Array
    """(n,) measured pressure [Pa]."""
    ideal_pressure: Array
    """(n,) pressure of the still air at the IMU's height [Pa]."""
    bias: Array
    """(n,) error without white noise and rounding [Pa]."""


def variance_discrete(imu: ImuParameters) -> float:
    """Return the variance of one sample of the barometer [Pa^2]."""
    p = imu.barometer
    return p.noise_density**2 * p.rate + p.resolution**2 / 12.0


def _table_encoder(frame: str, encoding: str) -> Encode:
    """Return the encoder of rows of a table: FluidPressure."""
    from imu_sim_ros.bags.messages.encode import FluidPressureEncoder

    pressures = FluidPressureEncoder(frame, encoding)
    return lambda t_ns, values: pressures.encode(t_ns, values[:, 0])


def _realise(parameters: BarometerParameters, seed: int, name: str) -> BarometerParameters:
    """Return the barometer of a seed, whose errors are those of a triad's first axis."""
    p = realise_triad(to_triad(parameters), name, seed)
    return dataclasses.replace(
        parameters,
        bias=p.bias[0],
        turn_on_bias_sigma=0.0,
        temperature_bias=p.temperature_bias[::3],
        temperature_bias_sigma=0.0,
    )


def _unit_hint(pressure: Array) -> str:
    """Return a hint for pressures that are not in pascal; empty: they may be."""
    if pressure >= _LOWEST:
        return ""
    return (
        f"the first one is {float(pressure):.5g} Pa; are the values in hectopascal, or heights? "
        "They must be in pascal"
    )


TABLE: Final = Table(
    name="pressure",
    title="Barometer",
    quantity=PRESSURE,
    headers={"euroc": "#timestamp [ns],p [Pa]", "csv": "timestamp,pressure"},
    type=TYPE,
    topic=TOPIC,
    fields=("fluid_pressure", "variance"),
    encoder=_table_encoder,
    truths=(IDEAL_TOPIC, BIAS_TOPIC),
    bias_type=TYPE,
)

SENSOR: Final[Sensor[ImuParameters]] = Sensor(
    name="barometer",
    quantity="pressure",
    section=BarometerParameters,
    with_imu=WithImu(BarometerSwitches, _unit_hint),
    model=import_on_call("imu_sim_ros.sensors.barometer.model", "Barometer"),
    topics=(
        topic(
            *(TOPIC, TYPE, _ENCODER),
            lambda samples, rows, environment: (
                samples.pressure[rows],
                variance_discrete(environment.imu),
            ),
            "pressure",
        ),
        topic(
            *(IDEAL_TOPIC, TYPE, _ENCODER),
            lambda samples, rows, _: (samples.ideal_pressure[rows],),
            "ground_truth_pressure",
            truth=True,
        ),
        # Of all messages of one number with a stamp, this one is in pascal.
        topic(
            *(BIAS_TOPIC, TYPE, _ENCODER),
            lambda samples, rows, _: (samples.bias[rows],),
            *("biases", "pressure"),
            truth=True,
        ),
    ),
    table=TABLE,
    values=lambda samples: samples.pressure[:, None],
    readings=PressureReadings,
    realised=_realise,
)


def read_pressure(path: str | Path, topic: str | None = None) -> RecordedSamples:
    """Return the pressure in a bag or a EuRoC folder.

    :param path: the file or folder.
    :param topic: topic of type sensor_msgs/FluidPressure; None: ``imu/pressure``, or the only one.
    :returns: stamps, pressures (n,) [Pa] and their variances (n,) [Pa^2].
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read, or has no pressure.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(duration=2, sensors=["pressure"], seed=1)
    >>> _ = flight.save(folder / "pressure.mcap", topics=["imu/data_raw", "imu/pressure"])
    >>> ims.read_pressure(folder / "pressure.mcap").values.shape
    (200,)
    """
    recorded = read_samples(TABLE, path, topic)
    flat = recorded.values.reshape(-1), recorded.covariance.reshape(-1)
    return RecordedSamples(recorded.t_ns, *flat, recorded.name)
