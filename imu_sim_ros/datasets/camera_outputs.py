# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Datasets and bags with cameras in addition to readings and truth."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from imu_sim_ros.bags.text import writer
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.conventions import TRUTH_TOPIC
from imu_sim_ros.datasets.topics import DatasetTarget, Read
from imu_sim_ros.errors import InputError
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.simulation.sensors import imus_in

if TYPE_CHECKING:
    from imu_sim_ros.sensors.camera.rig import Rig

Warn = Callable[[str], None]
"""Receives a warning."""
CAMERA_FORMATS: Final = ("tracks", "tum_vi", "vio_data_simulation")
"""Datasets that need a camera."""
IMAGE_FORMATS: Final = ("euroc", "csv")
"""Datasets that take images."""
FORMATS: Final = (*writer.FORMATS, *CAMERA_FORMATS)
"""Datasets that generate writes."""


def check_form(form: str | None, path: Path, cameras: "Rig | None", imus: int) -> None:
    """Refuse cameras and IMUs if a form has no place for them, and a form that needs some.

    :param imus: how many there are.
    :raises InputError: with what to give.
    """
    if form in ("tum_vi", "vio_data_simulation") and imus > 1:
        raise InputError(f"format {form}: has room for one IMU, not {imus}")
    forms = (*CAMERA_FORMATS, *IMAGE_FORMATS)
    if cameras is not None and form is not None and (form not in forms or path.suffix == ".csv"):
        raise InputError(f"cameras: need a bag, or a folder and --format {', '.join(forms)}")
    if cameras is None and form in CAMERA_FORMATS:
        raise InputError(f"format {form}: needs a camera; --camera names one")
    if form == "vio_data_simulation" and cameras is not None and len(cameras.views) > 1:
        raise InputError(f"format {form}: has room for one camera, not {len(cameras.views)}")


class CameraTarget(DatasetTarget):
    """A folder of readings, truth, and what cameras see: tracks or images."""

    block_size: Final = 512
    """Samples in a block at most: frames take far longer, and the progress bar should move."""

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
        """Write the rows of a window, and those of the frames taken until its last pose."""
        super().write(read)
        if len(t_ns := read[POSE].true_t_ns):
            self.seen.until(int(t_ns[-1]) + 1)


@contextmanager
def opened(
    form: str,
    output: Path,
    cameras: "Rig",
    names: dict[str, str],
    sensors: Mapping[str, Mounted],
    jobs: int,
    warn: Warn,
) -> Iterator[Any]:
    """Open a dataset with cameras; it is complete when the block ends without an error.

    :param names: of the topics that are written.
    :param sensors: of the body.
    :param jobs: threads that render images.
    """
    from imu_sim_ros.datasets.tracks import TrackFiles
    from imu_sim_ros.datasets.tum_vi import TumVi
    from imu_sim_ros.datasets.vio_data_simulation import VioDataSimulation

    imus = imus_in(sensors)
    if form == "tum_vi":
        with TumVi(output, cameras, sensors[imus[0]].own, jobs) as sequence:
            yield sequence
        return
    if form == "vio_data_simulation":
        with VioDataSimulation(output, cameras, cameras.trajectory) as target:
            yield target
        for line in target.warnings():
            warn(line)
        return
    with (
        Dataset(output, "csv", TRUTH_TOPIC in names, len(imus)) as dataset,
        TrackFiles(output, cameras) as tracks,
    ):
        combined = CameraTarget(dataset, tracks, sensors)
        yield combined
    for line in tracks.warnings():
        warn(line)
    combined.files = dataset.files
