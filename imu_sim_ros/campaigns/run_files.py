# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Input files of a program: the dataset and the configuration of one run."""

import dataclasses
from pathlib import Path
from typing import Final

from imu_sim_ros.bags.threads import thread_pool
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.core.conventions import IMU_TOPIC
from imu_sim_ros.datasets.configurations import imu_values, rig_values
from imu_sim_ros.datasets.consumers.folder import write_all
from imu_sim_ros.datasets.forms import open_output, topics_to_write
from imu_sim_ros.parameters import files
from imu_sim_ros.simulation.parameters import values_of
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.simulation.topics import resolve_topic, sensor_topics

_BAGS: Final = {"rosbag2": "dataset", "ros1": "dataset.bag", "mcap": "dataset.mcap"}


def write_dataset(cell: SimulatedCell, form: str, seed: int, folder: Path) -> Path:
    """Write the readings, the truth, and the data of the cameras, if there are any.

    :param form: euroc, tracks, rosbag2, ros1 or mcap.
    :param folder: folder of the run.
    :returns: the path of the dataset.
    """
    sensors, name = mount_sensors(cell.parameters), _BAGS.get(form, "dataset")
    path, dataset = folder / name, None if form in _BAGS else form
    names = topics_to_write(sensors, dataset, path)
    if dataset is None:
        # The truth of the scene is twice as large as what the cameras see, and no program reads it.
        topics = sensor_topics(sensors)
        scene_truth = [n for n in names if topics[n].topic.truth and topics[n].mounted.sensor.sees]
        names = {name: names[name] for name in names if name not in scene_truth}
    output = path / "mav0" if form == "euroc" else path
    with thread_pool(1) as pool:
        body = cell.simulation(seed, pool)
        with open_output(dataset, output, names, sensors, body.world) as target:
            for window in body.windows(cell.total):
                target.write(window)
    return path


def write_config(cell: SimulatedCell, seed: int, folder: Path) -> Path:
    """Write ``simulation.yaml`` and every stack's files for the sensor of this seed.

    With cameras the files hold the whole rig, as those of ``generate --with-configs`` do.
    """
    parameters = dataclasses.replace(cell.parameters, seed=seed)
    path = folder / "config"
    values = imu_values(parameters, resolve_topic(IMU_TOPIC), cell.total / parameters.rate)
    names = {topic: topic for topic in sensor_topics(mount_sensors(parameters))}
    write_all(path, values, rig_values(values, parameters, names), parameters)
    all_values = values_of(parameters)
    files.write(all_values, path / "simulation.yaml", comment="All parameters of this run.")
    return path
