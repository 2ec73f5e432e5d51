# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a simulation: what the simulator node and the command generate have in common."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, make_dataclass
from functools import cache
from typing import Any, Final

import numpy as np

from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.names import nearest
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.files import build_layered
from imu_sim_ros.parameters.included import names
from imu_sim_ros.parameters.kinds import texts, upward_gravity
from imu_sim_ros.parameters.sections import parameters, section, variant
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.presets import barometer_layer, sensor_layer
from imu_sim_ros.sensors.orientation.parameters import MODEL_ERRORS
from imu_sim_ros.sensors.parameters import LARGEST_JITTER_SIGMA
from imu_sim_ros.sensors.registry import find_sensor, is_known, sections, sees, sensor_kinds
from imu_sim_ros.timebase import exact_rate
from imu_sim_ros.trajectory.parameters import (
    TYPES,
    TrajectoryParameters,
    find_trajectory,
    names_a_file,
    trajectory_layer,
)

DEFAULT_IMU = "lecture"
DEFAULT_TRAJECTORY = "lecture"

SENSORS: Final = (
    "names of further sensors of the body, each the prefix of its own parameters (NAME.rate, ...); "
    "none: only those on the boards of the IMUs"
)
_LOWEST_CUTOFF = 1e-6
"""Lowest cut-off as a fraction of half the rate; lower ones lose all digits."""


class SampledParameters(EnvironmentParameters):
    """An environment and the IMU in it, whose readings are sampled at the rate."""

    imu: ImuParameters

    def problems(self, prefix: str) -> Iterator[str]:
        """Say which parameters do not fit the rate or each other, a line each."""
        ratio = self.imu.internal_ratio(self.rate)
        if ratio.denominator != 1 or (self.imu.sampling == "oversampled" and ratio < 2):
            yield (
                f"{prefix}imu.internal_rate = {self.imu.internal_rate:g}: must be an integer "
                f"multiple of the rate, {self.rate:g} Hz, at least twice the rate"
            )
        nyquist = 0.5 * self.rate * float(ratio)
        for triad in TRIADS:
            cutoffs = self.imu.triad(triad).bandwidth
            least = min((one for one in cutoffs if one), default=nyquist)
            if least < _LOWEST_CUTOFF * nyquist:
                yield (
                    f"{prefix}imu.{triad}_bandwidth = {least:g}: must be 0 or at least "
                    f"{_LOWEST_CUTOFF * nyquist:g} Hz at this rate"
                )
            acting = self.imu.low_pass(triad, self.rate)
            if self.imu.sampling == "oversampled" and cutoffs != acting:
                yield (
                    f"{prefix}imu.{triad}_bandwidth = {max(cutoffs):g}: must be below half the "
                    f"internal rate, {nyquist:g} Hz; it is the filter before decimation"
                )
        if self.imu.jitter * self.rate > LARGEST_JITTER_SIGMA:
            yield (
                f"{prefix}imu.jitter = {self.imu.jitter:g}: must be at most a quarter of the "
                f"interval, {LARGEST_JITTER_SIGMA / self.rate:g} s"
            )
        yield from super().problems(prefix)
        of_orientation = self.imu.orientation.rate
        if of_orientation and (exact_rate(self.rate) / exact_rate(of_orientation)).denominator != 1:
            yield (
                f"{prefix}imu.orientation_rate = {of_orientation:g}: must divide the rate, "
                f"{self.rate:g} Hz"
            )

    def warnings(self) -> list[str]:
        """Return a line for each allowed value that looks like a mistake."""
        return [
            *upward_gravity(self.gravity),
            *self.imu.warnings("imu.", math.hypot(*self.gravity)),
            *self._low_passes_without_effect(),
        ]

    def _low_passes_without_effect(self) -> Iterator[str]:
        """Say which low-passes are too wide for the rate, except those of the preset itself."""
        for triad in TRIADS:
            name, cutoffs = f"imu.{triad}_bandwidth", self.imu.triad(triad).bandwidth
            if cutoffs == self.imu.low_pass(triad, self.rate):
                continue
            stated = sensor_layer(self.imu.preset).get(name, 0.0)
            if not np.array_equal(np.broadcast_to(np.asarray(stated), 3), cutoffs):
                yield (
                    f"{name} = {max(cutoffs):g}: without effect, since it is not below half the "
                    f"rate, {0.5 * self.rate:g} Hz; white noise keeps its density"
                )


@dataclass(frozen=True)
class SimulationParameters(SampledParameters):
    """Everything that decides the samples."""

    trajectory: TrajectoryParameters = variant("type", "static", find_trajectory, TYPES)
    imu: ImuParameters = section(ImuParameters)

    @staticmethod
    def elsewhere(name: str) -> str | None:
        """Return where a parameter belongs whose section does not exist; None: that is not known.

        The section may be that of a sensor or a camera that was not switched on. A camera's
        parameter may be written as if ``cameras``, or the camera, were its section.
        """
        section, _, rest = name.partition(".")
        if is_known(section):
            return f"those of a sensor need its name in sensors, as in sensors: [{section}]"
        if rest.startswith("camera."):
            return f"there is no camera {section}; name it in cameras"
        if section == "cameras":
            camera, _, last = rest.replace(".camera.", ".").rpartition(".")
            return _of_camera(camera, last)
        return _of_camera(section, rest) if section.startswith("cam") else None


def _of_camera(camera: str, name: str) -> str | None:
    """Return a hint at the full name of a camera's parameter; None: none is alike.

    :param camera: whose it is; empty: that of all cameras.
    """
    from imu_sim_ros.sensors.camera.parameters import CameraParameters  # most runs have none

    near = nearest(name, parameters(CameraParameters))
    if near is None:
        return None
    own = f"{camera}.camera.{near}, or " if camera else ""
    return f"did you mean {own}camera.{near}{' for all cameras' if camera else ''}?"


def sensor_fields(kinds: Mapping[str, str]) -> list[Any]:
    """Return the fields of a section that has the parameters of sensors.

    :param kinds: of the sensors by name.
    :raises ConfigurationError: with a line for each kind that does not exist.
    """
    own = sections(kinds)
    fields: list[Any] = [
        ("sensors", tuple[str, ...], texts(tuple(kinds), SENSORS)),
        *((name, cls, section(cls)) for name, cls in own.items()),
    ]
    if sees(kinds.values()):
        from imu_sim_ros.sensors.camera.rig_parameters import DEFAULT_SCENE
        from imu_sim_ros.sensors.camera.scene_parameters import TYPES as SCENES
        from imu_sim_ros.sensors.camera.scene_parameters import SceneParameters, find_scene

        scene = variant("type", DEFAULT_SCENE, find_scene, SCENES)
        fields.append(("scene", SceneParameters, scene))
    return fields


def simulation_section(kinds: Mapping[str, str]) -> type[SimulationParameters]:
    """Return the section of a simulation with sensors.

    :param kinds: of the sensors by name.
    :raises ConfigurationError: with a line for each kind that does not exist.
    """
    # By their sections, too: a sensor of this kind may have been registered anew.
    every = tuple(sections(kinds).values())
    return _section_of(tuple(kinds.items()), every) if kinds else SimulationParameters


@cache
def _section_of(
    kinds: tuple[tuple[str, str], ...], _: tuple[type, ...]
) -> type[SimulationParameters]:
    fields, bases = sensor_fields(dict(kinds)), (SimulationParameters,)
    return make_dataclass("SimulationParameters", fields, bases=bases, frozen=True)


def named_sensors(parameters: object) -> dict[str, Any]:
    """Return the parameters of the sensors that ``sensors`` names, by name."""
    return {name: getattr(parameters, name) for name in getattr(parameters, "sensors", ())}


def imus(parameters: SampledParameters) -> dict[str, Any]:
    """Return the parameters of each IMU with the world around it, by its name.

    That of a single one is empty, and its parameters are all there are.
    """
    names = getattr(parameters, "imus", ())
    if not names:
        return {"": parameters}
    shared = {field.name: getattr(parameters, field.name) for field in fields(SimulationParameters)}
    result = {}
    for name in names:
        own = getattr(parameters, name)
        of_its_own = {field.name: getattr(own, field.name) for field in fields(own)}
        result[name] = SimulationParameters(**{**shared, **of_its_own})
    return result


def load_simulation(*layers: Mapping[str, object], node: str = "simulator") -> SimulationParameters:
    """Return the simulation that layers of parameters describe, later ones above earlier ones.

    :raises ConfigurationError: with a line for each problem.
    """
    given: dict[str, object] = {}
    for values in layers:
        given.update(values)
    kinds = sensor_kinds(given)
    if not kinds:
        given.pop("sensors", None)
    return build_layered(
        simulation_section(kinds), lambda values: layer_simulation([values], node), given
    )


def layer_simulation(layers: Iterable[Mapping[str, object]], node: str) -> dict[str, object]:
    """Return the layers as one, above the IMU preset and the trajectory file that they name.

    What an included preset says, and the choices of a user leave no place for, is left out; a
    file of one's own is taken at its word.
    """
    layers = list(layers)
    given = {name for values in layers for name in values}
    result = _layered(layers, node)
    if result.get("imu.preset", DEFAULT_IMU) not in names("imus"):
        return result
    without_place = set(_errors_of_no_model(result)) - given
    return {name: value for name, value in result.items() if name not in without_place}


def _errors_of_no_model(values: Mapping[str, object]) -> list[str]:
    """Return the errors of a modelled orientation, if a filter makes it."""
    if values.get("imu.orientation_source") != "filter":
        return []
    return [f"imu.orientation_{name}" for name in MODEL_ERRORS]


def _layered(layers: Iterable[Mapping[str, object]], node: str) -> dict[str, object]:
    """Return several layers as one, later ones above earlier ones.

    Below them all lie the files that ``imu.preset`` and ``trajectory.type`` name.
    """
    given: dict[str, object] = {}
    for values in layers:
        given.update(values)
    given.setdefault("imu.preset", DEFAULT_IMU)
    sensor = sensor_layer(str(given["imu.preset"]), node)
    given["imu.preset"] = sensor.pop("imu.preset", given["imu.preset"])
    # A sensor's file may be one of all parameters: its motion counts if no other is named.
    motion = {name: sensor.pop(name) for name in list(sensor) if name.startswith("trajectory.")}
    if "trajectory.type" not in given:
        given = {"trajectory.type": DEFAULT_TRAJECTORY, **motion, **given}
    if names_a_file(str(given["trajectory.type"])):
        sensor.update(trajectory_layer(str(given.pop("trajectory.type")), node))
    of_sensors = barometer_layer(given, node) | _sensor_layers(given, node)
    if sees(sensor_kinds(given).values()):
        from imu_sim_ros.sensors.camera.rig_parameters import layered_scene

        own = {key: value for key, value in given.items() if not key.startswith("scene.")}
        given = own | layered_scene(given, node)
    return {**sensor, **of_sensors, **given}


def _sensor_layers(given: Mapping[str, object], node: str) -> dict[str, object]:
    """Return what ``NAME.preset`` of sensors of the body stand for."""
    result: dict[str, object] = {}
    for name, kind in sensor_kinds(given).items():
        preset = given.get(f"{name}.preset")
        if preset and preset != "none":
            values = files.load(files.find(find_sensor(kind).presets or kind, str(preset)), node)
            for key, value in values.items():
                own = key.removeprefix(f"{kind}.")
                result[key if own == key else f"{name}.{own}"] = value
    return result
