# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Next to an output of a simulation: its realised truth, and the folder of configurations."""

import contextlib
import dataclasses
import glob
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from imu_sim_ros.bags.outputs import named
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.rows import is_present
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import Value
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.errors.realised import realised_imu
from imu_sim_ros.sensors.imu.parameters import MOUNT
from imu_sim_ros.simulation.parameters import (
    SimulationParameters,
    imus,
    load_simulation,
)
from imu_sim_ros.simulation.sensors import mounted

_SUFFIXES: Final = (".bag", ".mcap", ".csv")
"""Endings that are not part of the name of the truth; folders have none."""


def configs(output: Path) -> Path:
    """Return the folder of the configurations that belong to an output."""
    return output.parent / f"{output.name}_configs"


def companions(output: Path, sensors: Mapping[str, Mounted]) -> dict[str, list[Path]]:
    """Return the files that the sensors of a body have next to an output, by sensor."""
    found = {}
    for name, one in sensors.items():
        wanted = one.sensor.companions
        suffixes = wanted.suffixes(one.own) if wanted else ()
        if suffixes:
            stem = f"{_stem(output)}_{name}" if one.space else _stem(output)
            found[name] = [output.parent / f"{stem}{suffix}" for suffix in suffixes]
    return found


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

    :param imu_topic: of one IMU of several.
    :raises ConfigurationError: for a file that is not what ``generate`` wrote.
    :raises InputError: for IMUs of different mounts without a topic that names one.
    """
    bag = named(bag)
    paths = [_truth(bag, "")]
    if not is_present(paths[0]):
        paths = sorted(bag.parent.glob(f"{glob.escape(_stem(bag))}_truth_*.yaml"))
    if not paths:
        return None
    found = {path: files.load(path) for path in paths}
    of_imus = {path: values for path, values in found.items() if MOUNT[0] in values}
    own = _truth(bag, (imu_topic or "").strip("/").split("/")[0])
    values = found.get(own, next(iter((of_imus or found).values())))
    if own not in found and len({str([v[n] for n in MOUNT]) for v in of_imus.values()}) > 1:
        raise InputError(
            f"{bag}: IMUs of different mounts, {', '.join(p.name for p in of_imus)}: no file has "
            f"the name of the topic {imu_topic or 'of the readings'}; give imu.lever_arm and "
            "imu.mounting"
        )
    return load_simulation({n: values[n] for n in (*_WORLD, *MOUNT) if n in values})


def new_truths(output: Path, parameters: SimulationParameters) -> dict[Path, str]:
    """Return the files of the realised truth that are to be written, each with its text.

    An existing file with the same text is left out, because the outputs share it.

    :raises InputError: if another output of this name has another sensor.
    """
    world = {
        name: getattr(parameters, name)
        for name in _WORLD
        if getattr(parameters, name) != getattr(SimulationParameters, name)
    }
    texts = {name: _imu_text(one, world) for name, one in imus(parameters).items()}
    sensors = mounted(parameters)
    texts |= {name: _sensor_text(sensors[name], world) for name in parameters.each_sensor}
    result, problems = {}, []
    for name, text in texts.items():
        path = _truth(output, name)
        with contextlib.suppress(OSError):
            if path.is_file() and path.read_bytes() == text.encode():
                continue
        result[path] = text
        other = next(_siblings(output), None)
        if path.exists() and other is not None:
            problems.append(
                f"{path}: is the truth of {other}, which has a different sensor or seed; "
                "give this output another name"
            )
    if problems:
        raise InputError(problems)
    return result


def _truth(output: Path, name: str) -> Path:
    own = f"_{name}" if name else ""
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


def _sensor_text(one: Mounted, world: Mapping[str, Value]) -> str:
    """Return a sensor of this run, as ``--params-file`` takes it.

    :param world: parameters that differ from those of the usual world.
    """
    name, seed = one.name, one.environment.seed
    own = flatten(one.sensor.realised(one.own, seed, name))
    if own.get("frame"):
        own["frame"] = one.frame
    return files.text(
        {**world, "sensors": (name,), **{f"{name}.{key}": value for key, value in own.items()}},
        comment=f"The sensor {name} of this run, with the values that seed {seed} has "
        "drawn.\ngenerate --params-file FILE simulates the same unit.",
    )


def _imu_text(parameters: SimulationParameters, world: Mapping[str, Value]) -> str:
    """Return the IMU of this run: every constant that its seed drew, in its parameter's place.

    ``calibrate --truth`` and ``allan --truth`` take it, and ``--imu`` for the same unit again.
    """
    imu = dataclasses.replace(realised_imu(parameters.imu, parameters.seed), preset="perfect")
    own = {f"imu.{key}": value for key, value in flatten(imu).items()}
    return files.text(
        {"rate": parameters.rate, **world, **own},
        comment=f"The sensor of this run: preset {parameters.imu.preset}, with the turn-on "
        f"biases and scales\nthat seed {parameters.seed} drew in the places of the parameters. "
        "For calibrate --truth and allan --truth;\ngenerate --imu FILE simulates the same unit.",
    )
