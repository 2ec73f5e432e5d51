# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recorded samples of a sensor other than the IMU, from any file."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from imu_sim_ros.core import arguments
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.timebase import describe_span
from imu_sim_ros.core.types import Array, Times

if TYPE_CHECKING:
    from imu_sim_ros.inputs.tables import Table


@dataclass(frozen=True, repr=False)
class RecordedSamples:
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
        return f"<RecordedSamples {self.name}: {describe_span(self.t_ns)}>"


def read_samples(table: "Table", path: str | Path, topic: str | None) -> RecordedSamples:
    """Return the samples of a sensor.

    :param table: table of the sensor.
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
            names = (
                candidate.name
                for candidate in bag.topics
                if candidate.name.strip("/") == table.topic
            )
            topic = next(names, None)
    table_rows = read_table(path, table, topic)
    if not len(table_rows.t_ns):
        raise InputError(f"{path}: contains no {table.name}")
    return RecordedSamples(
        table_rows.t_ns, table_rows.values, table_rows.covariance, arguments.name_of(path)
    )
