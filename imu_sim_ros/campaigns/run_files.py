# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a program reads: the dataset and the configuration of one run."""

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.threads import threads
from imu_sim_ros.bags.write import open_writer
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.conventions import IMU_TOPIC
from imu_sim_ros.datasets.consumers.folder import write_all
from imu_sim_ros.datasets.consumers.rig import RigValues
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.datasets.topics import (
    BagTarget,
    DatasetTarget,
    Read,
    in_tables,
    resolved,
    usual_topics,
)
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.errors.realised import realised_imu
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import SimulationParameters, values_of
from imu_sim_ros.simulation.sensors import mounted
from imu_sim_ros.simulation.topics import offered

_BAGS: Final = {"rosbag2": "dataset", "ros1": "dataset.bag", "mcap": "dataset.mcap"}
Windows = Iterator[Read]


def write_dataset(cell: SimulatedCell, form: str, seed: int, folder: Path) -> Path:
    """Write the readings, the truth, and what the cameras see, if there are any.

    :param form: euroc, tracks, rosbag2, ros1 or mcap.
    :param folder: of the run.
    :returns: the dataset.
    """
    with threads(1) as pool:
        return _written(cell, cell.simulation(seed, pool), form, folder)


def _written(cell: SimulatedCell, body: Body, form: str, folder: Path) -> Path:
    path, sensors = folder / "dataset", mounted(cell.parameters)
    windows = body.windows(cell.total)
    if form in _BAGS:
        return _bag(folder / _BAGS[form], sensors, windows)
    if form == "tracks":
        return _tracks(path, sensors, body, windows)
    path.mkdir()
    names = usual_topics(sensors, "euroc", path, imu_only=False)
    tables = in_tables(names, "euroc", sensors)
    with Dataset(path / "mav0", "euroc", True, tables=tables) as dataset:
        if not cell.parameters.cameras:
            _write(DatasetTarget(dataset, sensors), windows)
            return path
        from imu_sim_ros.datasets.camera_outputs import CameraTarget
        from imu_sim_ros.datasets.images import ImageFolders

        comment = f"simulated by imu_sim_ros, seed {body.parameters.seed}"
        with ImageFolders(path / "mav0", sensors, body.world, "euroc", 1, comment) as images:
            _write(CameraTarget(dataset, images, sensors), windows)
    return path


def write_config(cell: SimulatedCell, seed: int, folder: Path) -> Path:
    """Write ``simulation.yaml`` and every stack's files for the sensor of this seed.

    With cameras the files hold the whole rig, as those of ``generate --with-configs`` do.
    """
    parameters = dataclasses.replace(cell.parameters, seed=seed)
    path = folder / "config"
    values = ImuValues(
        realised_imu(parameters.imu, parameters.seed),
        parameters.rate,
        float(np.linalg.norm(parameters.gravity)),
        resolved(IMU_TOPIC),
        cell.total / parameters.rate,
    )
    rig = _rig_values(values, parameters) if parameters.cameras else None
    write_all(path, values, rig, parameters)
    every = values_of(parameters)
    files.write(every, path / "simulation.yaml", comment="All parameters of this run.")
    return path


def _rig_values(values: ImuValues, parameters: SimulationParameters) -> RigValues:
    """Return the cameras next to an IMU."""
    from imu_sim_ros.datasets.configurations import image_topic

    names = {topic: topic for topic in offered(mounted(parameters))}
    rig = parameters.rig
    topics = {camera: image_topic(camera, names) for camera in rig.cameras}
    return RigValues(values, rig.each(), topics, rig.scene)


def _tracks(path: Path, sensors: Mapping[str, Mounted], body: Body, windows: Windows) -> Path:
    if not body.parameters.cameras:
        raise ConfigurationError("dataset tracks: there is no camera")
    from imu_sim_ros.datasets.camera_outputs import CameraTarget
    from imu_sim_ros.datasets.tracks import TrackFiles

    with Dataset(path, "csv", True) as dataset, TrackFiles(path, sensors, body.world) as tracks:
        _write(CameraTarget(dataset, tracks, sensors), windows)
    return path


def _write(target: Any, windows: Windows) -> None:
    for read in windows:
        target.write(read)


def _bag(path: Path, sensors: Mapping[str, Mounted], windows: Windows) -> Path:
    known = offered(sensors)
    # No program reads the truth of all that is seen, which is twice as large as what is seen.
    topics = {
        name: name
        for name in usual_topics(sensors, None, path, imu_only=False)
        if not (known[name].topic.truth and known[name].mounted.sensor.sees)
    }
    with open_writer(path) as writer, BagTarget(writer, sensors, topics) as bag:
        _write(bag, windows)
    return path
