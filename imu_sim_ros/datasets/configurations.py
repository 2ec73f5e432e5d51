# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The configuration of each stack for what ``generate`` wrote, and kalibr's files of a sequence."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.bags.outputs import make_folder
from imu_sim_ros.bags.text import writer as text_writer
from imu_sim_ros.conventions import IMAGE_TOPIC, IMU_TOPIC
from imu_sim_ros.datasets.consumers import kalibr
from imu_sim_ros.datasets.consumers.folder import write_all
from imu_sim_ros.datasets.consumers.rig import InitialMotion, RigValues, start_warnings
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.datasets.topics import resolved
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.errors.realised import realised_imu
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import SimulationParameters, imus

if TYPE_CHECKING:
    from imu_sim_ros.sensors.camera.rig_parameters import RigParameters

_START: Final = 60.0
"""Length of the start of a flight that is searched for an initialisation [s]."""
_EVERY: Final = 0.01
"""[s]"""


def write_configs(
    folder: Path,
    body: Body,
    names: Mapping[str, str],
    rig: "RigParameters | None",
) -> list[str]:
    """Write the files of all stacks; several IMUs have a folder each, of their names.

    Returns why stacks will initialise badly from these cameras and IMUs, a line each.

    :param names: of the topics that are written, by their own names.
    :param rig: the cameras, if there are some.
    """
    warnings = []
    every = imus(body.parameters)
    if "" not in every:
        make_folder(folder)
    for name, parameters in every.items():
        own = f"{name}/{IMU_TOPIC}".lstrip("/")
        seconds = body.taken(parameters.rate) / parameters.rate
        values = _values(parameters, resolved(names.get(own, own)), seconds)
        seen = None
        if rig is not None and rig.cameras:
            from imu_sim_ros.datasets.features import image_topic

            topics = {camera: image_topic(camera, names) for camera in rig.cameras}
            lines = tuple(start_warnings(values, _start(body)))
            warnings += [f"{name}: {line}" if name else line for line in lines]
            seen = RigValues(values, rig.each(), topics, rig.scene, lines)
        write_all(folder / name, values, seen, parameters)
    return warnings


def _start(body: Body) -> InitialMotion:
    """Return the true motion at the start of a flight, every 10 ms."""
    length = min(body.position / body.rate, _START)
    t = np.arange(0.0, max(length, 2.0 * _EVERY), _EVERY)
    motion = body.trajectory.sample(np.minimum(t, body.trajectory.duration))
    force = motion.acceleration - np.asarray(body.parameters.gravity)
    speed = np.linalg.norm(motion.velocity, axis=1)
    return InitialMotion(t, rotation.rotate_inverse(motion.q_wb, force), speed)


def bagcreater_topics(imus: Iterable[str]) -> dict[str, str]:
    """Return the topics that kalibr_bagcreater makes from a folder's files, by our names.

    It names them after the files: imu0.csv becomes /imu0. Those of cameras have our names.
    """
    return {f"{imu}/{IMU_TOPIC}".lstrip("/"): f"imu{k}" for k, imu in enumerate(imus)}


def write_tum_vi_calibration(
    folder: Path, parameters: SimulationParameters, rig: "RigParameters | None"
) -> None:
    """Write camchain.yaml and imu_config.yaml of a TUM VI sequence, in kalibr's form."""
    if rig is None or not rig.cameras:
        return
    values = _values(parameters, "/imu0")
    topics = {camera: f"/{camera}/{IMAGE_TOPIC}" for camera in rig.cameras}
    chain = kalibr.camchain(RigValues(values, rig.each(), topics, rig.scene))
    (folder / "camchain.yaml").write_text(chain, encoding="utf-8")
    (folder / "imu_config.yaml").write_text(kalibr.imu_yaml(values), encoding="utf-8")


def describe(
    folder: Path,
    index: int,
    of_imu: Mounted,
    states: bool,
    tables: Iterable[Table],
    sensors: Mapping[str, Mounted],
) -> None:
    """Write the sensor.yaml files of an IMU of a EuRoC folder.

    :param index: of the IMU.
    :param states: whether the folder has its truth.
    :param tables: the further tables of this IMU.
    :param sensors: all of the body.
    """
    imu, parameters = of_imu.own, of_imu.environment
    mounting, lever_arm = np.reshape(imu.mounting, (3, 3)), np.asarray(imu.lever_arm)
    comment = f"simulated by imu_sim_ros, preset {imu.preset}, seed {parameters.seed}"
    places = {}
    for one in sensors.values():
        if one.sensor.table is None:
            continue
        if one.own is imu:
            rate = getattr(imu, one.sensor.name).rate or parameters.rate
            places[one.sensor.table.name] = (rate, mounting, lever_arm)
        elif not one.on_board:
            at = (one.own.rate, np.eye(3), np.asarray(one.own.lever_arm))
            places[one.sensor.table.name] = at
    for table in tables:
        text_writer.write_euroc_table(folder, table, index, *places[table.name], comment)
    text_writer.write_euroc_descriptions(
        folder,
        parameters.rate,
        _values(parameters, f"/imu{index}").densities(),
        mounting,
        lever_arm,
        comment,
        states,
        index,
    )


def _values(parameters: SimulationParameters, topic: str, duration: float = 0.0) -> ImuValues:
    return ImuValues(
        realised_imu(parameters.imu, parameters.seed),
        parameters.rate,
        float(np.linalg.norm(parameters.gravity)),
        topic,
        duration,
    )
