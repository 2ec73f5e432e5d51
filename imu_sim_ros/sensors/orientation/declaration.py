# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Declaration of an IMU's orientation: samples, topic, table, readings."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from imu_sim_ros.core import gate
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.sensors.declaration import (
    Mounted,
    Payloads,
    Sensor,
    SensorReadings,
    Topic,
    WithImu,
    import_on_call,
)
from imu_sim_ros.sensors.imu.declaration import readings
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.orientation.parameters import OrientationParameters, OrientationSwitches
from imu_sim_ros.sensors.recorded import RecordedSamples, read_samples

TYPE: Final = "sensor_msgs/msg/Imu"
TOPIC: Final = "imu/data"
"""Topic of readings with an orientation (REP-145)."""


@dataclass(frozen=True, repr=False)
class Orientations(SensorReadings):
    """n orientations delivered by an IMU, with the truth of each."""

    q_wi: Array
    """(n, 4) measured orientation of the IMU in the world: unit quaternions (w, x, y, z)."""
    variance: Array
    """(n, 3) stated variance of the error about the world's axes [rad^2]; 0: unknown."""
    ideal_q_wi: Array
    """(n, 4) true orientation."""


def _readings(mounted: Mounted[ImuParameters], encoding: str) -> Payloads:
    """Return the encoder of Imu messages with orientation."""
    return readings(mounted, encoding, "q_wi", "variance")


def _needs(imu: ImuParameters) -> tuple[str, ...]:
    """Return the other sensors whose readings the orientation needs."""
    return ("magnetic_field",) if imu.orientation.source == "filter" else ()


TABLE: Final = Table(
    name="orientation",
    title="Orientation of the sensor in the world",
    quantity=gate.ORIENTATION,
    headers={
        "euroc": "#timestamp [ns],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []",
        "csv": "timestamp,q_w,q_x,q_y,q_z",
    },
    type=TYPE,
    topic=TOPIC,
    fields=("orientation", "orientation_covariance"),
    of_readings=True,
)

SENSOR: Final[Sensor[ImuParameters]] = Sensor(
    name="orientation",
    quantity="orientation",
    section=OrientationParameters,
    with_imu=WithImu(OrientationSwitches),
    model=import_on_call("imu_sim_ros.sensors.orientation.model", "Orientation"),
    topics=(Topic(TOPIC, TYPE, ("orientation",), _readings),),
    table=TABLE,
    values=lambda samples: samples.q_wi,
    readings=Orientations,
    needs=_needs,
    faulty_parts=(),
)


def read_orientation(path: str | Path, topic: str | None = None) -> RecordedSamples:
    """Return the orientation that an IMU reports, from a bag or a EuRoC folder.

    :param path: the file or folder.
    :param topic: topic of type sensor_msgs/Imu; None: ``imu/data``, or the only one.
    :returns: stamps, quaternions q_wi (n, 4) (w, x, y, z), and covariances (n, 3, 3) [rad^2] of the
        error about the world's axes. Messages without an orientation are skipped.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read, or has no orientation.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="mti3", duration=2, sensors=["orientation"])
    >>> _ = flight.save(folder / "orientation.mcap", topics=["imu/data"])
    >>> ims.read_orientation(folder / "orientation.mcap").values.shape
    (400, 4)
    """
    return read_samples(TABLE, path, topic)
