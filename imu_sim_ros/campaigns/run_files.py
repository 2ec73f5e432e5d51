# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a program reads: the dataset and the configuration of one run."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.write import open_writer
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.datasets.consumers.folder import write_all
from imu_sim_ros.datasets.consumers.rig import RigValues
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.datasets.topics import (
    BagTarget,
    DatasetTarget,
    in_tables,
    resolved,
    usual_topics,
)
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.errors.realised import realised_imu
from imu_sim_ros.simulation.engine import Simulation
from imu_sim_ros.simulation.parameters import carried

if TYPE_CHECKING:
    from imu_sim_ros.sensors.camera.rig import Rig
    from imu_sim_ros.sensors.camera.rig_parameters import RigParameters

_BAGS: Final = {"rosbag2": "dataset", "ros1": "dataset.bag", "mcap": "dataset.mcap"}
_BLOCK: Final = 512
"""Samples in a block if there are cameras: the images of a block lie in memory."""


def write_dataset(cell: SimulatedCell, form: str, seed: int, block: ImuBlock, place: Path) -> Path:
    """Write the readings, the truth, and what the cameras see, if there are any.

    :param form: euroc, tracks, rosbag2, ros1 or mcap.
    :param block: all samples of the run.
    :param place: folder of the run.
    :returns: the dataset.
    """
    simulation = cell.simulation(seed)
    rig = _rig(cell, simulation)
    blocks = iter([block]) if rig is None else _blocks(simulation, cell.total)
    if form in _BAGS:
        return _bag(cell, place / _BAGS[form], rig, blocks)
    if form == "tracks":
        return _tracks(place / "dataset", rig, blocks)
    path, further = place / "dataset", tuple(carried(cell.parameters))
    path.mkdir()
    names = usual_topics(further, "euroc", path, imu_only=False)
    tables = in_tables(names, "euroc", further=further)
    with Dataset(path / "mav0", "euroc", True, tables=tables) as dataset:
        target = DatasetTarget(dataset, further=further)
        if rig is None:
            _write(target, None, blocks)
        else:
            from imu_sim_ros.datasets.images import ImageFolders

            comment = f"simulated by imu_sim_ros, seed {seed}"
            with ImageFolders(path / "mav0", rig, "euroc", 1, comment) as images:
                _write(target, images, blocks)
    return path


def write_config(cell: SimulatedCell, seed: int, place: Path) -> Path:
    """Write ``simulation.yaml`` and every stack's files for the sensor of this seed.

    With cameras the files hold the whole rig, as those of ``generate --with-configs`` do.
    """
    parameters = dataclasses.replace(cell.parameters, seed=seed)
    path = place / "config"
    values = ImuValues(
        realised_imu(parameters.imu, parameters.seed),
        parameters.rate,
        float(np.linalg.norm(parameters.gravity)),
        resolved(IMU_TOPIC),
        cell.total / parameters.rate,
    )
    rig = None if cell.rig is None else _rig_values(values, cell.rig)
    write_all(path, values, rig, parameters)
    seen = {} if cell.rig is None else flatten(cell.rig)
    all_values: dict[str, Any] = {**flatten(parameters), **seen}
    files.write(all_values, path / "simulation.yaml", comment="All parameters of this run.")
    return path


def _rig_values(values: ImuValues, rig: "RigParameters") -> RigValues | None:
    """Return the cameras next to an IMU; None if there are none."""
    if not rig.cameras:
        return None
    from imu_sim_ros.datasets.features import camera_topics, image_topic

    names = {topic: topic for topic in camera_topics(rig)}
    topics = {camera: image_topic(camera, names) for camera in rig.cameras}
    return RigValues(values, rig.each(), topics, rig.scene)


def _rig(cell: SimulatedCell, simulation: Simulation) -> "Rig | None":
    if cell.rig is None:
        return None
    from imu_sim_ros.sensors.camera.rig import Rig

    seconds = cell.total / cell.parameters.rate
    seed = simulation.parameters.seed
    return Rig(cell.rig, simulation.trajectory, simulation.t0_ns, seconds, seed)


def _blocks(simulation: Simulation, total: int) -> Iterator[ImuBlock]:
    """Yield all samples in blocks small enough for their images to lie in memory."""
    for first in range(0, total, _BLOCK):
        yield simulation.next_block(min(_BLOCK, total - first))


def _write(target: Any, seen: Any, blocks: Iterator[ImuBlock]) -> None:
    """Write the rows of all blocks, and the frames taken until the end of each."""
    for block in blocks:
        target.write({"": block})
        if seen is not None:
            seen.until(int(block.true_t_ns[-1]) + 1)


def _tracks(path: Path, rig: "Rig | None", blocks: Iterator[ImuBlock]) -> Path:
    if rig is None:
        raise ConfigurationError("dataset tracks: there is no camera")
    from imu_sim_ros.datasets.tracks import TrackFiles

    with Dataset(path, "csv", True) as dataset, TrackFiles(path, rig) as tracks:
        _write(DatasetTarget(dataset), tracks, blocks)
    return path


def _bag(cell: SimulatedCell, path: Path, rig: "Rig | None", blocks: Iterator[ImuBlock]) -> Path:
    of_body = usual_topics(carried(cell.parameters), None, path, imu_only=False)
    topics = {name: name for name in (IMU_TOPIC, TRUTH_TOPIC, *of_body)}
    with open_writer(path) as writer:
        target = BagTarget(writer, {"": cell.parameters}, topics)
        if rig is None:
            _write(target, None, blocks)
            return path
        from imu_sim_ros.datasets.camera_bag import CameraBag
        from imu_sim_ros.datasets.features import camera_topics

        names = {name: name for name in camera_topics(rig.parameters)}
        with CameraBag(target, rig, names, 1) as bag:
            _write(bag, None, blocks)
    return path
