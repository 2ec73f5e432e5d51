# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configuration of each stack for an output of ``generate``, and kalibr's files of a sequence."""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.outputs import make_folder
from imu_sim_ros.bags.text import writer as text_writer
from imu_sim_ros.core import rotation
from imu_sim_ros.core.conventions import COMPRESSED_TOPIC, IMAGE_TOPIC, IMU_TOPIC
from imu_sim_ros.datasets.consumers import kalibr
from imu_sim_ros.datasets.consumers.folder import write_all
from imu_sim_ros.datasets.consumers.rig import BadStart, InitialMotion, RigValues, bad_starts
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.realised import realise_imu
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.parameters import MountedParameters, RatedParameters
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import SimulationParameters, imus
from imu_sim_ros.simulation.sensors import all_tables, imus_in
from imu_sim_ros.simulation.topics import resolve_topic

_START: Final = 60.0
"""Length of the start of a flight that is searched for an initialisation [s]."""
_STEP: Final = 0.01
"""Step of that search [s]."""


def write_configs(
    folder: Path,
    body: Body,
    names: Mapping[str, str],
) -> list[str]:
    """Write the files of all stacks; several IMUs have a folder each, named after them.

    Returns a line for each stack that will initialise badly from these cameras and IMUs.

    :param names: names in the output of the written topics.
    """
    warnings = []
    imus_by_name = imus(body.parameters)
    if "" not in imus_by_name:
        make_folder(folder)
    for name, parameters in imus_by_name.items():
        topic = f"{name}/{IMU_TOPIC}".lstrip("/")
        seconds = body.taken(parameters.rate) / parameters.rate
        values = imu_values(parameters, resolve_topic(names.get(topic, topic)), seconds)
        bad: tuple[BadStart, ...] = ()
        if body.parameters.cameras:
            bad = tuple(bad_starts(values, _start(body)))
        warnings += [f"{name}: {start.line}" if name else start.line for start in bad]
        rig = rig_values(values, body.parameters, names, bad)
        write_all(folder / name, values, rig, parameters)
    return warnings


def imu_values(parameters: SimulationParameters, topic: str, duration: float = 0.0) -> ImuValues:
    """Return an IMU as its consumers see it.

    :param topic: topic of its readings.
    :param duration: duration of the readings [s].
    """
    return ImuValues(
        realise_imu(parameters.imu, parameters.seed),
        parameters.rate,
        float(np.linalg.norm(parameters.gravity)),
        topic,
        duration,
    )


def rig_values(
    values: ImuValues,
    parameters: SimulationParameters,
    names: Mapping[str, str],
    bad: tuple[BadStart, ...] = (),
) -> RigValues | None:
    """Return an IMU with the cameras next to it as their consumers see them; None without cameras.

    :param names: names in the output of the written topics.
    :param bad: stacks that will initialise badly.
    """
    if not parameters.cameras:
        return None
    rig = parameters.rig
    assert rig is not None
    topics = {camera: _image_topic(camera, names) for camera in rig.cameras}
    return RigValues(values, rig.camera_parameters(), topics, rig.scene, bad)


def _start(body: Body) -> InitialMotion:
    """Return the true motion at the start of a flight, every 10 ms."""
    length = min(body.taken(body.rate) / body.rate, _START)
    t = np.arange(0.0, max(length, 2.0 * _STEP), _STEP)
    motion = body.trajectory.sample(np.minimum(t, body.trajectory.duration))
    force = motion.acceleration - np.asarray(body.parameters.gravity)
    speed = np.linalg.norm(motion.velocity, axis=1)
    return InitialMotion(t, rotation.rotate_inverse(motion.q_wb, force), speed)


def _image_topic(camera: str, names: Mapping[str, str]) -> str:
    """Return the name of a camera's image topic: of the raw images, unless only others are written.

    :param names: names in the output of the written topics.
    """
    raw, compressed = (f"{camera}/{topic}" for topic in (IMAGE_TOPIC, COMPRESSED_TOPIC))
    key = compressed if compressed in names and raw not in names else raw
    return resolve_topic(names.get(key, key))


def bagcreater_topics(imus: Iterable[str]) -> dict[str, str]:
    """Return kalibr_bagcreater's topics for the files of a folder, by topic of this package.

    It names them after the files: imu0.csv becomes /imu0. Topics of cameras have the same names.
    """
    return {f"{imu}/{IMU_TOPIC}".lstrip("/"): f"imu{k}" for k, imu in enumerate(imus)}


def write_tum_vi_calibration(folder: Path, parameters: EnvironmentParameters) -> None:
    """Write camchain.yaml and imu_config.yaml of a TUM VI sequence, in kalibr's form.

    :param parameters: parameters of the simulation.
    """
    assert isinstance(parameters, SimulationParameters)
    values = imu_values(parameters, "/imu0")
    rig = rig_values(values, parameters, {})
    assert rig is not None
    (folder / "camchain.yaml").write_text(kalibr.camchain(rig), encoding="utf-8")
    (folder / "imu_config.yaml").write_text(kalibr.imu_yaml(values, True), encoding="utf-8")


def describe(
    folder: Path,
    states: bool,
    tables: Collection[tuple[Table, int]],
    sensors: Mapping[str, Mounted[MountedParameters]],
) -> None:
    """Write the sensor.yaml files of a EuRoC folder.

    :param states: True if the folder has the truth of its IMUs.
    :param tables: tables of other sensors, each with its number.
    :param sensors: all sensors of the body.
    """
    comments = {}
    for index, name in enumerate(imus_in(sensors)):
        imu = sensors[name]
        parameters, pose = imu.environment, imu.parameters.mount()
        assert isinstance(parameters, SimulationParameters)
        assert isinstance(imu.parameters, ImuParameters)
        comment = (
            f"simulated by imu_sim_ros, preset {imu.parameters.preset}, seed {parameters.seed}"
        )
        comments[imu.space] = comment
        text_writer.write_euroc_descriptions(
            folder,
            parameters.rate,
            imu_values(parameters, f"/imu{index}").densities(),
            pose[:3, :3],
            pose[:3, 3],
            comment,
            states,
            index,
        )
    for table, number, _, sensor in all_tables(sensors):
        if (table, number) not in tables:
            continue
        own, pose = sensor.parameters, sensor.parameters.mount()
        section = own.sensors[sensor.name] if isinstance(own, ImuParameters) else own
        assert isinstance(section, RatedParameters)
        rate = section.rate or sensor.environment.rate
        comment = comments.get(sensor.space, next(iter(comments.values())))
        text_writer.write_euroc_table(
            folder, table, number, rate, pose[:3, :3], pose[:3, 3], comment
        )
