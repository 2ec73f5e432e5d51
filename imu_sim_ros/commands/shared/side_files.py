# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What ``generate`` puts beside its output: the realised truth, and each stack's configuration.

``OUTPUT_configs`` is a folder. ``NAME_truth.yaml`` has the output's name without ``.bag``,
``.mcap`` or ``.csv``; of several IMUs each has its own, ``NAME_truth_LEFT.yaml``. It tells of a
sensor, not of a file: two outputs of one name that hold the same unit (``flight.bag``,
``flight.mcap``) share it. Where they do not, the second is refused, for one file cannot be true of
both.
"""

import dataclasses
import glob
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from imu_sim_ros import consumers, rotation
from imu_sim_ros.bags import make_folder
from imu_sim_ros.bags.text import writer as text_writer
from imu_sim_ros.commands.shared.output_arguments import named
from imu_sim_ros.config import SimulationParameters, files, flatten, load_simulation
from imu_sim_ros.conventions import IMAGE_TOPIC, IMU_TOPIC
from imu_sim_ros.datasets import imus_of, resolved
from imu_sim_ros.errors import InputError
from imu_sim_ros.sensor import realised_imu
from imu_sim_ros.simulation import Simulation

if TYPE_CHECKING:
    from imu_sim_ros.config.cameras import RigParameters

_START: Final = 60.0
"""How much of a flight is searched for where stacks can initialise [s]."""
_EVERY: Final = 0.01
"""[s]"""
_SUFFIXES: Final = (".bag", ".mcap", ".csv")
"""What is not part of the name of the truth; folders have none of them."""


def configs(output: Path) -> Path:
    """Return the folder of the configurations that belong to an output."""
    return output.parent / f"{output.name}_configs"


_WORLD: Final = (
    "gravity",
    "gravity_model",
    "latitude_deg",
    "height",
    "earth_rotation",
    "curved_earth",
)
"""What the readings depend on besides sensor and motion; ``dead_reckon`` takes it from there."""


def world_of(bag: Path) -> SimulationParameters | None:
    """Return what was simulated, as the realised truth beside a bag tells; None without one.

    :raises ConfigurationError: for a file that is not what ``generate`` wrote.
    """
    bag = named(bag)
    path = _truth(bag, "")
    if not path.is_file():
        path = next(iter(sorted(bag.parent.glob(f"{glob.escape(_stem(bag))}_truth_*.yaml"))), path)
    if not path.is_file():
        return None
    values = files.load(path)
    return load_simulation({name: values[name] for name in _WORLD if name in values})


def new_truths(output: Path, simulated: Mapping[str, SimulationParameters]) -> dict[Path, str]:
    """Return the files of the realised truth that are to be written, each with its text.

    One that stands already there with the same text is left out: the outputs share it.

    :raises InputError: where another output of this name has another sensor.
    """
    result, problems = {}, []
    for name in imus_of(simulated):
        path, text = _truth(output, name), _truth_text(simulated[name])
        there = _read(path)
        if there == text:
            continue
        result[path] = text
        other = next(_siblings(output), None)
        if there is not None and other is not None:
            problems.append(
                f"{path}: is the truth of {other}, which has a different sensor or seed; "
                "give this output another name"
            )
    if problems:
        raise InputError(problems)
    return result


def _truth(output: Path, imu: str) -> Path:
    own = f"_{imu}" if imu else ""
    return output.parent / f"{_stem(output)}_truth{own}.yaml"


def _stem(output: Path) -> str:
    return output.stem if output.suffix.lower() in _SUFFIXES else output.name


def _siblings(output: Path) -> Iterator[Path]:
    """Yield the other outputs whose realised truth has the same name."""
    stem = _stem(output)
    for name in (stem, *(f"{stem}{part}{suffix}" for suffix in _SUFFIXES for part in ("", "_0"))):
        path = output.parent / name
        of_this = name in (output.name, f"{stem}_0{output.suffix}")
        if not of_this and path.exists():
            yield path


def _read(path: Path) -> str | None:
    """Return the text of a file; an empty one where it is none, None where nothing is there."""
    if not path.exists():
        return None
    try:
        return path.read_text(encoding="utf-8") if path.is_file() else ""
    except (OSError, UnicodeDecodeError):
        return ""


def _truth_text(parameters: SimulationParameters) -> str:
    """Return the sensor of this run: every constant that its seed drew, in its parameter's place.

    ``calibrate --truth`` and ``allan --truth`` take it, and ``--imu`` for the same unit again.
    """
    imu = dataclasses.replace(realised_imu(parameters.imu, parameters.seed), preset="perfect")
    world = {
        name: getattr(parameters, name)
        for name in _WORLD
        if getattr(parameters, name) != getattr(SimulationParameters, name)
    }
    return files.text(
        {"rate": parameters.rate, **world, **{f"imu.{k}": v for k, v in flatten(imu).items()}},
        comment=f"The sensor of this run: preset {parameters.imu.preset}, with the turn-on "
        f"biases and scales\nthat seed {parameters.seed} drew in the places of the parameters. "
        "For calibrate --truth and allan --truth;\ngenerate --imu FILE simulates the same unit.",
    )


def write_configs(
    folder: Path,
    imus: Mapping[str, Simulation],
    names: Mapping[str, str],
    rig: "RigParameters | None",
) -> list[str]:
    """Write the files of all stacks; several IMUs have a folder each, of their names.

    Returns why stacks will initialise badly from these cameras and IMUs, a line each.

    :param names: of the topics that are written, by their own names.
    :param rig: the cameras, where there are some.
    """
    warnings = []
    if "" not in imus:
        make_folder(folder)
    for name, simulation in imus.items():
        own = f"{name}/{IMU_TOPIC}".lstrip("/")
        duration = simulation.position / simulation.parameters.rate
        values = _values(simulation.parameters, resolved(names.get(own, own)), duration)
        seen = None
        if rig is not None and rig.cameras:
            from imu_sim_ros.datasets import image_topic

            topics = {camera: image_topic(camera, names) for camera in rig.cameras}
            lines = tuple(consumers.start_warnings(values, _start(simulation)))
            warnings += [f"{name}: {line}" if name else line for line in lines]
            seen = consumers.RigValues(values, rig.each(), topics, rig.scene, lines)
        consumers.write_all(folder / name, values, seen)
    return warnings


def _start(simulation: Simulation) -> "consumers.Start":
    """Return the true motion at the start of a flight, every 10 ms."""
    length = min(simulation.position / simulation.parameters.rate, _START)
    t = np.arange(0.0, max(length, 2.0 * _EVERY), _EVERY)
    motion = simulation.trajectory.sample(np.minimum(t, simulation.trajectory.duration))
    force = motion.acceleration - np.asarray(simulation.parameters.gravity)
    speed = np.linalg.norm(motion.velocity, axis=1)
    return consumers.Start(t, rotation.rotate_inverse(motion.q_wb, force), speed)


def bagcreater_topics(imus: Iterable[str]) -> dict[str, str]:
    """Return the topics that kalibr_bagcreater makes of a folder's files, by our names of them.

    It names them after the files: imu0.csv becomes /imu0. Those of cameras have our names.
    """
    return {f"{imu}/{IMU_TOPIC}".lstrip("/"): f"imu{k}" for k, imu in enumerate(imus)}


def write_tum_vi_calibration(
    folder: Path, parameters: SimulationParameters, rig: "RigParameters | None"
) -> None:
    """Write camchain.yaml and imu_config.yaml of a TUM VI sequence, in kalibr's form."""
    if rig is None:
        return
    values = _values(parameters, "/imu0")
    topics = {camera: f"/{camera}/{IMAGE_TOPIC}" for camera in rig.cameras}
    chain = consumers.kalibr.camchain(consumers.RigValues(values, rig.each(), topics, rig.scene))
    (folder / "camchain.yaml").write_text(chain, encoding="utf-8")
    (folder / "imu_config.yaml").write_text(consumers.kalibr.imu_yaml(values), encoding="utf-8")


def describe(
    folder: Path,
    index: int,
    parameters: SimulationParameters,
    states: bool,
    beside: Iterable[str] = (),
) -> None:
    """Write the sensor.yaml files of an IMU of a EuRoC folder.

    :param index: of the IMU.
    :param states: whether the folder has its truth.
    :param beside: the further tables of this IMU.
    """
    imu = parameters.imu
    mounting, lever_arm = np.reshape(imu.mounting, (3, 3)), np.asarray(imu.lever_arm)
    comment = f"simulated by imu_sim_ros, preset {imu.preset}, seed {parameters.seed}"
    rates = {
        "mag": imu.magnetometer.rate,
        "pressure": imu.barometer.rate,
        "orientation": imu.orientation.rate or parameters.rate,
    }
    for name in beside:
        text_writer.write_euroc_beside(
            folder, name, index, rates[name], mounting, lever_arm, comment
        )
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


def _values(
    parameters: SimulationParameters, topic: str, duration: float = 0.0
) -> "consumers.ImuValues":
    return consumers.ImuValues(
        realised_imu(parameters.imu, parameters.seed),
        parameters.rate,
        float(np.linalg.norm(parameters.gravity)),
        topic,
        duration,
    )
