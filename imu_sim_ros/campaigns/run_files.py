# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a program reads: the dataset and the configuration of one run."""

import dataclasses
from pathlib import Path
from typing import Final

from imu_sim_ros.bags.threads import threads
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.conventions import IMU_TOPIC
from imu_sim_ros.datasets.configurations import imu_values, rig_values
from imu_sim_ros.datasets.consumers.folder import write_all
from imu_sim_ros.datasets.forms import chosen_topics, opened
from imu_sim_ros.parameters import files
from imu_sim_ros.simulation.parameters import values_of
from imu_sim_ros.simulation.sensors import mounted
from imu_sim_ros.simulation.topics import offered, resolved

_BAGS: Final = {"rosbag2": "dataset", "ros1": "dataset.bag", "mcap": "dataset.mcap"}


def write_dataset(cell: SimulatedCell, form: str, seed: int, folder: Path) -> Path:
    """Write the readings, the truth, and what the cameras see, if there are any.

    :param form: euroc, tracks, rosbag2, ros1 or mcap.
    :param folder: of the run.
    :returns: the dataset.
    """
    sensors, name = mounted(cell.parameters), _BAGS.get(form, "dataset")
    path, dataset = folder / name, None if form in _BAGS else form
    names = chosen_topics(sensors, dataset, path)
    if dataset is None:
        # No program reads the truth of all that is seen, which is twice as large as what is seen.
        known = offered(sensors)
        seen = [n for n in names if known[n].topic.truth and known[n].mounted.sensor.sees]
        names = {name: names[name] for name in names if name not in seen}
    output = path / "mav0" if form == "euroc" else path
    with threads(1) as pool:
        body = cell.simulation(seed, pool)
        with opened(dataset, output, names, sensors, body.world) as target:
            for read in body.windows(cell.total):
                target.write(read)
    return path


def write_config(cell: SimulatedCell, seed: int, folder: Path) -> Path:
    """Write ``simulation.yaml`` and every stack's files for the sensor of this seed.

    With cameras the files hold the whole rig, as those of ``generate --with-configs`` do.
    """
    parameters = dataclasses.replace(cell.parameters, seed=seed)
    path = folder / "config"
    values = imu_values(parameters, resolved(IMU_TOPIC), cell.total / parameters.rate)
    names = {topic: topic for topic in offered(mounted(parameters))}
    write_all(path, values, rig_values(values, parameters, names), parameters)
    every = values_of(parameters)
    files.write(every, path / "simulation.yaml", comment="All parameters of this run.")
    return path
