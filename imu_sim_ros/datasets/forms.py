# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The forms in which the samples of a body are written: bags, and datasets of text and images."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any, Final

from imu_sim_ros.bags.text import writer
from imu_sim_ros.bags.writer import open_writer
from imu_sim_ros.conventions import TRUTH_TOPIC
from imu_sim_ros.datasets.topics import BagTarget, DatasetTarget, in_tables
from imu_sim_ros.errors import InputError
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.sensors import imus_in

Warn = Callable[[str], object]
"""Receives a warning."""
OF_WHAT_IS_SEEN: Final = ("tracks", "tum_vi", "vio_data_simulation")
"""Datasets that need a camera."""
FORMATS: Final = (*writer.FORMATS, *OF_WHAT_IS_SEEN)
"""All datasets."""


def check_form(form: str | None, path: Path, sensors: Mapping[str, Mounted]) -> None:
    """Refuse cameras and IMUs if a form has no place for them, and a form that needs some.

    :raises InputError: with what to give.
    """
    imus = len(imus_in(sensors))
    seeing = [o.sensor for o in sensors.values() if o.sensor.sees and o.sensor.datasets]
    if form in ("tum_vi", "vio_data_simulation") and imus > 1:
        raise InputError(f"format {form}: has room for one IMU, not {imus}")
    if form is not None and seeing:
        forms = seeing[0].datasets
        if form not in forms or path.suffix == ".csv":
            raise InputError(f"cameras: need a bag, or a folder and --format {', '.join(forms)}")
    if not seeing and form in OF_WHAT_IS_SEEN:
        raise InputError(f"format {form}: needs a camera; --camera names one")
    if form == "vio_data_simulation" and len(seeing) > 1:
        raise InputError(f"format {form}: has room for one camera, not {len(seeing)}")


@contextmanager
def opened(
    form: str | None,
    output: Path,
    names: Mapping[str, str],
    sensors: Mapping[str, Mounted],
    world: World | None = None,
    jobs: int = 1,
    warn: Warn = lambda line: None,
    **of_bag: Any,
) -> Iterator[Any]:
    """Open an output for windows of samples; it is complete when the block ends without an error.

    :param form: of a dataset; None: a bag.
    :param names: for each topic of the sensors that is written its name in a bag.
    :param sensors: of the body.
    :param world: that sensors see, with threads that make images; None: none sees.
    :param jobs: number of these threads.
    :param of_bag: arguments of :func:`~imu_sim_ros.bags.writer.open_writer`.
    """
    if form is None:
        with open_writer(output, **of_bag) as bag, BagTarget(bag, sensors, names) as messages:
            yield messages
    elif form == "tum_vi":
        from imu_sim_ros.datasets.configurations import write_tum_vi_calibration
        from imu_sim_ros.datasets.tum_vi import TumVi

        assert world is not None
        with TumVi(output, sensors, world, jobs) as sequence:
            yield sequence
        write_tum_vi_calibration(output / "dso", world.environment)
    elif form == "vio_data_simulation":
        from imu_sim_ros.datasets.vio_data_simulation import VioDataSimulation

        assert world is not None
        with VioDataSimulation(output, sensors, world, warn) as folder:
            yield folder
    else:
        states, imus = TRUTH_TOPIC in names, len(imus_in(sensors))
        tables = [] if form == "tracks" else in_tables(names, form, sensors)
        text = "csv" if form == "tracks" else form
        with (
            writer.Dataset(output, text, states, imus, tables) as dataset,
            _seen(form, output, sensors, world, jobs, warn) as seen,
        ):
            target = DatasetTarget(dataset, sensors, seen)
            yield target
            if form == "euroc":
                from imu_sim_ros.datasets.configurations import describe

                describe(output, states, tables, sensors)
        target.files = dataset.files


def _seen(
    form: str,
    folder: Path,
    sensors: Mapping[str, Mounted],
    world: World | None,
    jobs: int,
    warn: Warn,
) -> AbstractContextManager[Any]:
    """Return the files of what sensors see in a folder of tables; None if it has none."""
    if not any(one.sensor.sees and form in one.sensor.datasets for one in sensors.values()):
        return nullcontext()
    assert world is not None
    if form == "tracks":
        from imu_sim_ros.datasets.tracks import TrackFiles

        return TrackFiles(folder, sensors, world, warn)
    from imu_sim_ros.datasets.images import ImageFolders

    return ImageFolders(folder, sensors, world, form, jobs)
