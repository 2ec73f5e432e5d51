# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a simulation: what the simulator node and the command generate have in common."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Final, overload

import numpy as np

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import ConfigurationError, Problems
from imu_sim_ros.core.names import nearest
from imu_sim_ros.core.timebase import exact_rate
from imu_sim_ros.core.types import field_values
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.files import build_from_layers
from imu_sim_ros.parameters.kinds import Value, copy_parameter, gravity_warnings, text, texts
from imu_sim_ros.parameters.sections import (
    flatten,
    names_in_parameter,
    optional_section,
    parameters,
    section,
    sections_by_name,
    variant,
)
from imu_sim_ros.sensors import CAMERAS, find_sensor, is_sensor, kind_of
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.presets import layer_imu, sensor_layer
from imu_sim_ros.sensors.parameters import LARGEST_JITTER_SIGMA
from imu_sim_ros.trajectory.parameters import (
    TYPES,
    PosesParameters,
    TrajectoryParameters,
    find_trajectory,
    names_a_file,
    trajectory_layer,
)

if TYPE_CHECKING:
    from imu_sim_ros.sensors.camera.rig_parameters import RigParameters
    from imu_sim_ros.sensors.parameters import SensorParameters

DEFAULT_TRAJECTORY = "lecture"

NODE: Final = "simulator"

IMUS: Final = (
    "names of several IMUs on the body, each the namespace of its topics and the prefix of its "
    "own parameters (left.rate, left.imu.lever_arm, left.segment, ...); none: one IMU"
)
SENSORS: Final = (
    "names of sensors, each the prefix of its own parameters (NAME.rate, ...); none: only the IMUs "
    "and what each has with it"
)
_MOST_LOST: Final = 0.9
"""Probability of a lost message from which a mistake is likely."""
_TAKEN: Final = ("camera", "scene", "features", "publish", "inject")
COARSEST_RATE: Final = 1.0
"""Step of a gyroscope's output above which most motions are rounded to 0 [rad/s]."""
_LOWEST_CUTOFF = 1e-6
"""Lowest cut-off as a fraction of half the rate; lower ones lose all digits."""


class SampledParameters(EnvironmentParameters):
    """An environment and the IMU in it, whose readings are sampled at the rate."""

    imu: ImuParameters

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each parameter that does not fit the rate or another one."""
        ratio = self.imu.internal_ratio(self.rate)
        if ratio.denominator != 1 or (self.imu.sampling == "oversampled" and ratio < 2):
            yield (
                f"{prefix}imu.internal_rate = {self.imu.internal_rate:g}: must be an integer "
                f"multiple of the rate, {self.rate:g} Hz, at least twice the rate"
            )
        nyquist = 0.5 * self.rate * float(ratio)
        for triad in TRIADS:
            cutoffs = self.imu.triad(triad).bandwidth
            lowest = min((cutoff for cutoff in cutoffs if cutoff), default=nyquist)
            if lowest < _LOWEST_CUTOFF * nyquist:
                yield (
                    f"{prefix}imu.{triad}_bandwidth = {lowest:g}: must be 0 or at least "
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
        if self.world_frame and self.world_frame == self.body_frame:
            yield (
                f"{prefix}world_frame = {self.world_frame}: must not be {prefix}body_frame, whose "
                "pose in it is the truth"
            )
        elif self.world_frame and self.world_frame == self.imu_frame:
            yield (
                f"{prefix}world_frame = {self.world_frame}: must not be {prefix}imu_frame, which "
                "moves with the body"
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
        lines, gravity = list(gravity_warnings(self.gravity)), math.hypot(*self.gravity)
        limits = [limit for limit in self.imu.accelerometer.range if limit > 0.0]
        if limits and min(limits) < gravity:
            lines.append(
                f"imu.accelerometer_range = {min(limits):g}: smaller than gravity "
                f"({gravity:g} m/s^2), so an IMU at rest saturates"
            )
        for triad in TRIADS:
            name, cutoffs = f"imu.{triad}_bandwidth", self.imu.triad(triad).bandwidth
            if cutoffs == self.imu.low_pass(triad, self.rate):
                continue
            stated = sensor_layer(self.imu.preset, NODE, self.rate).get(name, 0.0)
            if not np.array_equal(np.broadcast_to(np.asarray(stated), 3), cutoffs):
                lines.append(
                    f"{name} = {max(cutoffs):g}: without effect, since it is not below half the "
                    f"rate, {0.5 * self.rate:g} Hz; white noise keeps its density"
                )
        lines += self._coarse_steps(gravity)
        if self.imu.internal_rate and self.imu.sampling != "oversampled":
            lines.append(
                f"imu.internal_rate = {self.imu.internal_rate:g}: without effect, since "
                f"imu.sampling is {self.imu.sampling}; it needs oversampled"
            )
        lost = self.imu.dropout_probability
        if lost >= _MOST_LOST:
            share = "every message" if lost == 1.0 else f"{100.0 * lost:.4g} % of the messages"
            verb = "is" if lost == 1.0 else "are"
            lines.append(f"imu.dropout_probability = {lost:g}: {share} of the IMU {verb} lost")
        nyquist = 0.5 * self.rate * float(self.imu.internal_ratio(self.rate))
        vibration = self.imu.vibration
        for name, frequencies in (
            ("line_frequency", vibration.line_frequency),
            ("band_low", vibration.band_low),
        ):
            aliased = [frequency for frequency in frequencies if frequency >= nyquist]
            if aliased:
                lines.append(
                    f"imu.vibration.{name} = {', '.join(f'{value:g}' for value in aliased)}: left "
                    f"out, since it is not below half the rate, {nyquist:g} Hz"
                )
        return lines

    def _coarse_steps(self, gravity: float) -> Iterator[str]:
        """Yield a line for each digital step that is too coarse for its input.

        :param gravity: magnitude [m/s^2].
        """
        for triad in TRIADS:
            errors = self.imu.triad(triad)
            limits = list(zip(errors.resolution, errors.range, strict=True))
            name = f"imu.{triad}_resolution"
            if any(step > limit > 0.0 for step, limit in limits):
                step, limit = next((s, r) for s, r in limits if s > r > 0.0)
                yield (
                    f"{name} = {step:g}: larger than imu.{triad}_range = {limit:g}, so that every "
                    "reading is 0"
                )
            elif triad == "accelerometer" and 0.0 < 2.0 * gravity < max(errors.resolution):
                yield (
                    f"{name} = {max(errors.resolution):g}: more than twice gravity ({gravity:g} "
                    "m/s^2), so that an IMU at rest reads 0"
                )
            elif triad == "gyroscope" and max(errors.resolution) > COARSEST_RATE:
                yield (
                    f"{name} = {max(errors.resolution):g}: larger than the rates of most motions, "
                    "which it rounds to 0; is it in deg/s or in LSB per rad/s?"
                )


_OF_A_SINGLE_IMU: Final = parameters(EnvironmentParameters)


@dataclass(frozen=True)
class OneImuParameters:
    """Parameters of one IMU of several."""

    rate: float = copy_parameter(_OF_A_SINGLE_IMU["rate"])
    seed: int = copy_parameter(_OF_A_SINGLE_IMU["seed"])
    imu_frame: str = copy_parameter(_OF_A_SINGLE_IMU["imu_frame"])
    segment: str = text(
        "",
        "segment of the trajectory's file that carries the IMU, with lever_arm and mounting on it; "
        "empty: the body of the trajectory",
    )
    imu: ImuParameters = section(ImuParameters)


def _rig_parameters() -> "type[RigParameters]":
    """Return the class of the parameters that all cameras share."""
    from imu_sim_ros.sensors.camera.rig_parameters import RigParameters  # most runs need none

    return RigParameters


def has_scene(values: Mapping[str, object]) -> bool:
    """Return whether the parameters name a camera or another sensor that sees a scene."""
    if names_in_parameter("cameras", values):
        return True
    try:
        return any(
            find_sensor(kind_of(name, values)).sees
            for name in names_in_parameter("sensors", values)
        )
    except ConfigurationError:  # building the parameters reports it
        return False


@dataclass(frozen=True)
class SimulationParameters(SampledParameters):
    """All parameters on which the samples and the images of a run depend."""

    trajectory: TrajectoryParameters = variant("type", "static", find_trajectory, TYPES)
    imu: ImuParameters = section(ImuParameters)
    imus: tuple[str, ...] = texts((), IMUS)
    sensors: tuple[str, ...] = texts((), SENSORS)
    cameras: tuple[str, ...] = texts((), CAMERAS)
    each_imu: Mapping[str, OneImuParameters] = sections_by_name(
        "imus", lambda *_: OneImuParameters, _TAKEN
    )
    each_sensor: "Mapping[str, SensorParameters]" = sections_by_name(
        "sensors", lambda name, values: find_sensor(kind_of(name, values)).section, _TAKEN
    )
    rig: "RigParameters | None" = optional_section(_rig_parameters, has_scene)
    """Cameras and scene; None, if nothing sees one."""

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each parameter that does not fit another one."""
        yield from super().problems(prefix)
        for name, simulation in imus(self).items() if self.imus else ():
            yield from simulation.problems(f"{name}.")
        for name, segment in segments(self).items():
            if not isinstance(self.trajectory, PosesParameters):
                yield (
                    f"{name}.segment = {segment}: needs recorded poses with segments; "
                    f"{prefix}trajectory.type is {self.trajectory.type}"
                )
        if self.cameras:
            from imu_sim_ros.sensors.camera.rig_parameters import rig_problems

            assert self.rig is not None
            yield from rig_problems(self.rig, self)

    if not TYPE_CHECKING:  # in scripts: flight.parameters.gnss.rate

        def __getattr__(self, name: str) -> Any:
            """Return the section of a sensor, or of one IMU of several."""
            for sections in (self.__dict__.get(group, {}) for group in ("each_sensor", "each_imu")):
                if name in sections:
                    return sections[name]
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @staticmethod
    def elsewhere(name: str) -> str | None:
        """Return advice about a parameter whose section does not exist; None: there is none.

        The section may be that of a sensor or a camera that was not switched on. A camera's
        parameter may be written as if ``cameras``, or the camera, were its section.
        """
        section, _, rest = name.partition(".")
        if section in ("camera", "scene", "features"):
            return "there is no camera; name them in cameras"
        if is_sensor(section):
            return f"those of a sensor need its name in sensors, as in sensors: [{section}]"
        if rest.startswith("camera."):
            return f"there is no camera {section}; name it in cameras"
        if section == "cameras":
            camera, _, parameter = rest.replace(".camera.", ".").rpartition(".")
            return _camera_advice(camera, parameter)
        return _camera_advice(section, rest) if section.startswith("cam") else None


def _camera_advice(camera: str, name: str) -> str | None:
    """Return advice with the full name of a camera's parameter; None: no name is similar.

    :param camera: name of the camera; empty: all cameras.
    """
    from imu_sim_ros.sensors.camera.parameters import CameraParameters  # most runs have none

    suggestion = nearest(name, parameters(CameraParameters))
    if suggestion is None:
        return None
    single = f"{camera}.camera.{suggestion}, or " if camera else ""
    return f"did you mean {single}camera.{suggestion}{' for all cameras' if camera else ''}?"


@overload
def imus(parameters: SimulationParameters) -> dict[str, SimulationParameters]: ...


@overload
def imus(parameters: SampledParameters) -> dict[str, SampledParameters]: ...


def imus(
    parameters: SampledParameters,
) -> dict[str, SimulationParameters] | dict[str, SampledParameters]:
    """Return the parameters of each IMU with those of its environment, by the name of the IMU.

    A single IMU has the name "" and all parameters. The body frame of an IMU on a segment is the
    segment.
    """
    if not isinstance(parameters, SimulationParameters) or not parameters.imus:
        return {"": parameters}
    names, values = fields(SimulationParameters), field_values(parameters)
    shared = {field.name: values[field.name] for field in names}
    shared |= {"imus": (), "each_imu": {}, "cameras": (), "rig": None}
    result = {}
    for name, imu in parameters.each_imu.items():
        overrides = field_values(imu)
        segment = overrides.pop("segment")
        if segment:
            overrides["body_frame"] = segment
        result[name] = SimulationParameters(**{**shared, **overrides})
    return result


def segments(parameters: SampledParameters) -> dict[str, str]:
    """Return the segments that carry IMUs, by the name of the IMU; IMUs on the body have none."""
    if not isinstance(parameters, SimulationParameters):
        return {}
    return {name: imu.segment for name, imu in parameters.each_imu.items() if imu.segment}


def values_of(parameters: SimulationParameters) -> dict[str, Value]:
    """Return all parameters by dotted name, without lists of names that are empty."""
    lists = ("imus", "sensors", "cameras")
    return {n: value for n, value in flatten(parameters).items() if value or n not in lists}


def load_simulation(
    *layers: Mapping[str, object], problems: Problems | None = None
) -> SimulationParameters:
    """Return the simulation that layers of parameters describe, later ones above earlier ones.

    :param problems: problems of earlier checks, which are raised with those of this one.
    :raises ConfigurationError: with a line for each problem.
    """
    return build_from_layers(SimulationParameters, layer_files, *layers, problems=problems)


def layer_files(values: Mapping[str, object], problems: Problems) -> dict[str, object]:
    """Return values layered above those of the files that they name: presets, trajectory, scene.

    Scene and motion suit each other and the sensors that see; stated values stay as they are.

    :param problems: receives a line for each file that cannot be read.
    """
    has_views = has_scene(values)
    if has_views:
        from imu_sim_ros.sensors.camera.rig_parameters import axes, layer_rig
        from imu_sim_ros.simulation.scene_fit import fit_scene  # most runs have none

        values = fit_scene(values, lambda layer: load_simulation(layer).trajectory)
    common, imu_layers = _split_by_imu(values)
    files_below = layer_rig(common, problems) if has_views else common
    layers = {
        **_sensor_presets(files_below, problems),
        **_add_trajectory_file(layer_imu(files_below, NODE, problems), files_below, problems),
    }
    if has_views:
        layers.update(axes(values, layers.get("trajectory.type") == PosesParameters.type))
    for k, (name, imu_layer) in enumerate(imu_layers.items()):
        layers.update(_imu_values(name, k, imu_layer, common, problems))
    return layers


def _split_by_imu(
    values: Mapping[str, object],
) -> tuple[dict[str, object], dict[str, dict[str, object]]]:
    """Return the values that are common to all IMUs, and those of each IMU by its name."""
    imu_layers: dict[str, dict[str, object]] = {
        name: {} for name in names_in_parameter("imus", values)
    }
    common: dict[str, object] = {}
    for key, value in values.items():
        name, dot, parameter = key.partition(".")
        if dot and name in imu_layers:
            imu_layers[name][parameter] = value
        else:
            common[key] = value
    return common, imu_layers


def _sensor_presets(values: Mapping[str, object], problems: Problems) -> dict[str, object]:
    """Return the values of the presets of all sensors with a mount of their own."""
    presets: dict[str, object] = {}
    for name in names_in_parameter("sensors", values):
        kind = kind_of(name, values)
        preset = values.get(f"{name}.preset")
        if preset and preset != "none":
            with problems.collect():
                path = files.find(find_sensor(kind).presets or kind, str(preset))
                for key, value in files.load(path).items():
                    parameter = key.removeprefix(f"{kind}.")
                    presets[key if parameter == key else f"{name}.{parameter}"] = value
    return presets


def _add_trajectory_file(
    layers: dict[str, object], stated: Mapping[str, object], problems: Problems
) -> dict[str, object]:
    """Return values with those of the trajectory's file below them.

    :param layers: values above the preset of the IMU, whose motion counts if none is stated.
    :param stated: values without the preset.
    """
    if "trajectory.type" in stated:
        layers = {
            key: value
            for key, value in layers.items()
            if key in stated or not key.startswith("trajectory.")
        }
    motion = str(layers.setdefault("trajectory.type", DEFAULT_TRAJECTORY))
    if names_a_file(motion):
        del layers["trajectory.type"]
        with problems.collect(hanging="trajectory."):
            layers = {**trajectory_layer(motion), **layers}
    return layers


def _imu_values(
    name: str,
    place: int,
    imu_layer: Mapping[str, object],
    common: Mapping[str, object],
    problems: Problems,
) -> dict[str, object]:
    """Return the values of one of several IMUs, by dotted name, above its preset.

    It takes ``rate`` and ``imu.*`` from the common values unless it has its own. Its seed is the
    common one plus its place in ``imus``, so that no two IMUs have the same noise.
    """
    defaults = {key: common[key] for key in common if key == "rate" or key.startswith("imu.")}
    defaults["imu_frame"] = f"{name}_imu_link"
    seed = common.get("seed", 0)
    if isinstance(seed, int):
        defaults["seed"] = seed + place
    layers = layer_imu({**defaults, **imu_layer}, NODE, problems)
    return {
        f"{name}.{key}": value for key, value in layers.items() if not key.startswith("trajectory.")
    }


def name_sensors(kind: str, presets: Sequence[object]) -> dict[str, object]:
    """Return parameters that switch on sensors of a kind, one for each preset.

    Their names are KIND, KIND1, KIND2, ...

    :param kind: a name in ``sensors``, or ``camera``: cam0, cam1, ... in ``cameras``.
    :param presets: preset of each sensor; True: the default one.
    """
    if kind == "camera":
        names, group, parameter = (
            [f"cam{k}" for k in range(len(presets))],
            "cameras",
            "camera.preset",
        )
    else:
        names, group, parameter = (
            [f"{kind}{k or ''}" for k in range(len(presets))],
            "sensors",
            "preset",
        )
    result: dict[str, object] = {group: names} if names else {}
    if group == "sensors":
        result |= {f"{name}.type": kind for name in names[1:]}
    pairs = zip(names, presets, strict=True)
    return result | {f"{name}.{parameter}": preset for name, preset in pairs if preset is not True}


def join_layers(lower: Mapping[str, object], upper: Mapping[str, object]) -> dict[str, object]:
    """Return two layers of parameters by dotted name as one; values of ``upper`` count.

    The sensors of both layers are kept. Cameras that ``upper`` lists replace those of ``lower``,
    whose own parameters are left out.
    """
    cameras = names_in_parameter("cameras", upper)
    dropped = {*names_in_parameter("cameras", lower)} - {*cameras} if cameras else set()
    remaining = {
        name: value for name, value in lower.items() if name.partition(".")[0] not in dropped
    }
    sensors = names_in_parameter("sensors", lower)
    sensors += [name for name in names_in_parameter("sensors", upper) if name not in sensors]
    return {**remaining, **upper, **({"sensors": sensors} if sensors else {})}
