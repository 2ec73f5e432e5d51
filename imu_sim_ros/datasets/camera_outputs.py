# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Datasets and bags with cameras in addition to readings and truth."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from imu_sim_ros.bags.text import writer
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.conventions import TRUTH_TOPIC
from imu_sim_ros.datasets.topics import DatasetTarget, Read
from imu_sim_ros.errors import InputError
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.sensors import imus_in

Warn = Callable[[str], None]
"""Receives a warning."""
CAMERA_FORMATS: Final = ("tracks", "tum_vi", "vio_data_simulation")
"""Datasets that need a camera."""
IMAGE_FORMATS: Final = ("euroc", "csv")
"""Datasets that take images."""
FORMATS: Final = (*writer.FORMATS, *CAMERA_FORMATS)
"""Datasets that generate writes."""


def check_form(form: str | None, path: Path, sensors: Mapping[str, Mounted]) -> None:
    """Refuse cameras and IMUs if a form has no place for them, and a form that needs some.

    :raises InputError: with what to give.
    """
    imus, every = len(imus_in(sensors)), [one.sensor for one in sensors.values()]
    cameras = sum(sensor.sees and bool(sensor.datasets) for sensor in every)
    if form in ("tum_vi", "vio_data_simulation") and imus > 1:
        raise InputError(f"format {form}: has room for one IMU, not {imus}")
    forms = (*CAMERA_FORMATS, *IMAGE_FORMATS)
    if cameras and form is not None and (form not in forms or path.suffix == ".csv"):
        raise InputError(f"cameras: need a bag, or a folder and --format {', '.join(forms)}")
    if not cameras and form in CAMERA_FORMATS:
        raise InputError(f"format {form}: needs a camera; --camera names one")
    if form == "vio_data_simulation" and cameras > 1:
        raise InputError(f"format {form}: has room for one camera, not {cameras}")


class CameraTarget(DatasetTarget):
    """A folder of readings, truth, and what cameras see: tracks or images."""

    def __init__(self, dataset: Dataset, seen: Any, sensors: Mapping[str, Mounted]) -> None:
        super().__init__(dataset, sensors)
        self.seen = seen

    def described(self) -> str:
        """Return how much was written, of readings and of what each camera saw."""
        return f"{super().described()}, {self.seen.described()}"

    @property
    def counts(self) -> dict[str, int]:
        """Rows by table, images by camera."""
        return {**super().counts, **self.seen.counts}

    def write(self, read: Read) -> None:
        """Write the rows of a window, and its frames."""
        super().write(read)
        self.seen.write(read)


@contextmanager
def opened(
    form: str,
    output: Path,
    body: Body,
    names: dict[str, str],
    sensors: Mapping[str, Mounted],
    jobs: int,
    warn: Warn,
) -> Iterator[Any]:
    """Open a dataset with cameras; it is complete when the block ends without an error.

    :param names: of the topics that are written.
    :param sensors: of the body.
    :param jobs: number of threads that render images.
    """
    from imu_sim_ros.datasets.tracks import TrackFiles
    from imu_sim_ros.datasets.tum_vi import TumVi
    from imu_sim_ros.datasets.vio_data_simulation import VioDataSimulation

    imus = imus_in(sensors)
    if form == "tum_vi":
        with TumVi(output, sensors, body.world, jobs) as sequence:
            yield sequence
        return
    if form == "vio_data_simulation":
        with VioDataSimulation(output, sensors, body.world) as target:
            yield target
        for line in target.warnings():
            warn(line)
        return
    with (
        Dataset(output, "csv", TRUTH_TOPIC in names, len(imus)) as dataset,
        TrackFiles(output, sensors, body.world) as tracks,
    ):
        combined = CameraTarget(dataset, tracks, sensors)
        yield combined
    for line in tracks.warnings():
        warn(line)
    combined.files = dataset.files
