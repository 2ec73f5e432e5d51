# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files next to an output of a simulation: its realised truth, and the configurations."""

import contextlib
import dataclasses
import glob
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Final

from imu_sim_ros.bags.outputs import resolve_name
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import field_values
from imu_sim_ros.inputs.rows import is_present
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import Value
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.errors.realised import realise_imu
from imu_sim_ros.sensors.imu.parameters import MOUNT
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.simulation.parameters import (
    SimulationParameters,
    imus,
    load_simulation,
)
from imu_sim_ros.simulation.sensors import mount_sensors

_SUFFIXES: Final = (".bag", ".mcap", ".csv")
"""Suffixes that are not part of the name of the truth; folders have none."""


def configs(output: Path) -> Path:
    """Return the folder of the configurations that belong to an output."""
    return output.parent / f"{output.name}_configs"


def companion_files(
    output: Path, sensors: Mapping[str, Mounted[MountedParameters]]
) -> dict[str, list[Path]]:
    """Return the companion files of a body's sensors next to an output, by sensor."""
    paths = {}
    for name, mount in sensors.items():
        declared = mount.sensor.companions
        suffixes = declared.suffixes(mount.parameters) if declared else ()
        if suffixes:
            stem = f"{_stem(output)}_{name}" if mount.space else _stem(output)
            paths[name] = [output.parent / f"{stem}{suffix}" for suffix in suffixes]
    return paths


_WORLD: Final = (
    "gravity",
    "gravity_model",
    "latitude_deg",
    "height",
    "earth_rotation",
    "curved_earth",
)
"""Parameters of the world that the readings depend on; ``dead_reckon`` reads them."""


def simulation_of(bag: Path, imu_topic: str | None = None) -> SimulationParameters | None:
    """Return world and mount of the IMU from the realised truth next to a bag; None without one.

    :param imu_topic: topic of one IMU of several.
    :raises ConfigurationError: for a file that ``generate`` did not write.
    :raises InputError: for IMUs of different mounts without a topic that names one.
    """
    bag = resolve_name(bag)
    paths = [_truth(bag, "")]
    if not is_present(paths[0]):
        paths = sorted(bag.parent.glob(f"{glob.escape(_stem(bag))}_truth_*.yaml"))
    if not paths:
        return None
    values_by_path = {path: files.load(path) for path in paths}
    imu_values = {path: values for path, values in values_by_path.items() if MOUNT[0] in values}
    truth_path = _truth(bag, (imu_topic or "").strip("/").split("/")[0])
    values = values_by_path.get(truth_path, next(iter((imu_values or values_by_path).values())))
    if (
        truth_path not in values_by_path
        and len({str([v[n] for n in MOUNT]) for v in imu_values.values()}) > 1
    ):
        raise InputError(
            f"{bag}: IMUs of different mounts, {', '.join(p.name for p in imu_values)}: no file "
            f"has the name of the topic {imu_topic or 'of the readings'}; give imu.lever_arm and "
            "imu.mounting"
        )
    return load_simulation({n: values[n] for n in (*_WORLD, *MOUNT) if n in values})


def new_truth_files(output: Path, parameters: SimulationParameters) -> dict[Path, str]:
    """Return the files of the realised truth that are to be written, each with its text.

    An existing file with the same text is left out: the outputs share it.

    :raises InputError: if another output of this name has another sensor.
    """
    values = field_values(parameters)
    defaults = {field.name: field.default for field in fields(SimulationParameters)}
    world = {name: values[name] for name in _WORLD if values[name] != defaults[name]}
    texts = {name: _imu_text(imu, world) for name, imu in imus(parameters).items()}
    sensors = mount_sensors(parameters)
    texts |= {name: _sensor_text(sensors[name], world) for name in parameters.each_sensor}
    new_texts, problems = {}, []
    for name, text in texts.items():
        path = _truth(output, name)
        with contextlib.suppress(OSError):
            if path.is_file() and path.read_bytes() == text.encode():
                continue
        new_texts[path] = text
        sibling = next(_siblings(output), None)
        if path.exists() and sibling is not None:
            problems.append(
                f"{path}: is the truth of {sibling}, which has a different sensor or seed; "
                "give this output another name"
            )
    if problems:
        raise InputError(problems)
    return new_texts


def _truth(output: Path, name: str) -> Path:
    """Return the name of a file of the truth next to an output."""
    suffix = f"_{name}" if name else ""
    return output.parent / f"{_stem(output)}_truth{suffix}.yaml"


def _stem(output: Path) -> str:
    """Return the name of an output without its ending."""
    return output.stem if output.suffix.lower() in _SUFFIXES else output.name


def _siblings(output: Path) -> Iterator[Path]:
    """Yield the other outputs whose realised truth has the same name."""
    stem = _stem(output)
    for name in (stem, *(f"{stem}{part}{suffix}" for suffix in _SUFFIXES for part in ("", "_0"))):
        path = output.parent / name
        is_same_output = name in (output.name, f"{stem}_0{output.suffix}")
        if not is_same_output and path.exists():
            yield path


def _sensor_text(mount: Mounted[MountedParameters], world: Mapping[str, Value]) -> str:
    """Return the parameters of a sensor of this run, as ``--params-file`` takes them.

    :param world: parameters that differ from the defaults.
    """
    name, seed = mount.name, mount.environment.seed
    values = flatten(mount.sensor.realised(mount.parameters, seed, name))
    if values.get("frame"):
        values["frame"] = mount.frame
    return files.text(
        {**world, "sensors": (name,), **{f"{name}.{key}": value for key, value in values.items()}},
        comment=f"The sensor {name} of this run, with the values that seed {seed} has "
        "drawn.\ngenerate --params-file FILE simulates the same unit.",
    )


def _imu_text(parameters: SimulationParameters, world: Mapping[str, Value]) -> str:
    """Return the parameters of this run's IMU, with the constants that its seed drew.

    ``calibrate --truth`` and ``allan --truth`` take it, and ``--imu`` for the same unit again.
    """
    imu = dataclasses.replace(realise_imu(parameters.imu, parameters.seed), preset="perfect")
    values = {f"imu.{key}": value for key, value in flatten(imu).items()}
    return files.text(
        {"rate": parameters.rate, **world, **values},
        comment=f"The sensor of this run: preset {parameters.imu.preset}, with the turn-on "
        f"biases and scales\nthat seed {parameters.seed} drew in the places of the parameters. "
        "For calibrate --truth and allan --truth;\ngenerate --imu FILE simulates the same unit.",
    )
