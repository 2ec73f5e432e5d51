# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The IMU that a model of Gazebo describes: SDF's ``<noise>``, Gazebo classic's plugin, RotorS'.

A plugin is known by its library: what a model does not write has the plugin's own default.

The XML is read without entities: a document type, with which they are declared, is refused.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.conventions import AXES, IMU_FRAME, TRIADS
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.rows import number_of, read_text, shortened
from imu_sim_ros.inputs.xml_text import Element, parsed
from imu_sim_ros.parameters.sections import bad_values, parameters
from imu_sim_ros.sensors.imu.parameters import ImuParameters

_QUANTITIES: Final = {"gyroscope": "angular_velocity", "accelerometer": "linear_acceleration"}
_OLD_QUANTITIES: Final = {"gyroscope": "rate", "accelerometer": "accel"}
_ROTORS: Final = {
    "NoiseDensity": "noise_density",
    "RandomWalk": "gauss_markov_density",
    "BiasCorrelationTime": "correlation_time",
    "TurnOnBiasSigma": "turn_on_bias_sigma",
}
_ROTORS_DEFAULTS: Final = {
    "gyroscopeNoiseDensity": 2.0 * 35.0 / 3600.0 / 180.0 * math.pi,
    "gyroscopeRandomWalk": 2.0 * 4.0 / 3600.0 / 180.0 * math.pi,
    "gyroscopeBiasCorrelationTime": 1000.0,
    "gyroscopeTurnOnBiasSigma": 0.5 / 180.0 * math.pi,
    "accelerometerNoiseDensity": 2.0 * 2.0e-3,
    "accelerometerRandomWalk": 2.0 * 3.0e-3,
    "accelerometerBiasCorrelationTime": 300.0,
    "accelerometerTurnOnBiasSigma": 20.0e-3 * 9.8,
}
"""The plugin's defaults, those of an ADIS16448 (rotors_gazebo_plugins/gazebo_imu_plugin.h, and the
same numbers in PX4-SITL_gazebo-classic/include/gazebo_imu_plugin.h)."""
_ROTORS_LIBRARIES: Final = ("rotors_gazebo_imu_plugin", "gazebo_imu_plugin")
_CLASSIC_LIBRARIES: Final = ("gazebo_ros_imu", "gazebo_ros_imu_sensor")
_NO_SENSOR: Final = "imu-system"
"""In the names of gz-sim's own plugins, which run the sensors that a model describes."""
_TEMPLATE: Final = ("{%", "{{", "{#")


class Described(NamedTuple):
    """An IMU of a model."""

    name: str
    """Name of its sensor or plugin."""
    parameters: dict[str, object]
    """By dotted name: ``imu.*``, of which ``imu.preset`` is ``FILE#NAME``, and ``rate`` and
    ``imu_frame`` if they are given."""


def read(path: str | Path, sensor: str | None = None) -> Described:
    """Return the IMU of a model.

    :param path: of the file, or ``FILE#SENSOR``.
    :param sensor: its name; None: the only one.
    :raises InputError: for a file that is none, one without an IMU, and one with several; the line
        lists them.
    """
    file, _, named = str(path).partition("#")
    sensor = sensor or named or None
    root = _parsed(file)
    found = list(_all_described(file, root))
    have = ", ".join(one.name for one in found) or "none"
    if sensor is not None:
        found = [one for one in found if one.name == sensor]
        if not found:
            raise InputError(f"{file}: has no IMU {shortened(sensor)}; it has {have}")
    if not found:
        _refuse_template(file)
        others = [one for one in root.every() if one.tag == "plugin" and "imu" in _library(one)]
        unknown = ", ".join(one.attributes["filename"] for one in others)
        why = f"; {unknown} is not known" if unknown else ""
        raise InputError(f"{file}: describes no IMU: no <sensor type='imu'>, no IMU plugin{why}")
    if len({one.name for one in found}) > 1:
        raise InputError(f"{file}: has several IMUs, name one of {have}: {file}#{found[0].name}")
    if len(found) > 1:
        raise InputError(f"{file}: has several IMUs named {found[0].name}; give them other names")
    taken = found[0]
    known = {f"imu.{name}": one for name, one in parameters(ImuParameters).items()}
    problems = bad_values(known, taken.parameters).values()
    if problems:
        raise InputError([f"{file}: {taken.name}: {line}" for line in problems])
    return taken._replace(parameters={**taken.parameters, "imu.preset": f"{file}#{taken.name}"})


def _parsed(file: str) -> Element:
    """Return the root of a file.

    :raises InputError: for one that is not XML, perhaps because it is a template of it.
    """
    try:
        return parsed(file)
    except InputError:
        _refuse_template(file)
        raise


def _refuse_template(file: str) -> None:
    """Say that a file is a template, if it is one.

    :raises InputError: if it is.
    """
    text = read_text(Path(file))
    if any(mark in text for mark in _TEMPLATE):
        raise InputError(
            f"{file}: is a Jinja template, not XML: render it first, and give the result"
        ) from None


def _library(plugin: Element) -> str:
    """Return the library of a plugin without ``lib`` and ``.so``; empty for gz-sim's own."""
    name = Path(plugin.attributes.get("filename", "")).name
    return "" if _NO_SENSOR in name else name.removeprefix("lib").removesuffix(".so")


def _all_described(path: str, root: Element) -> Iterator[Described]:
    """Yield the IMUs of a model; a plugin within a sensor is no other IMU."""
    inside: set[int] = set()
    for element in root.every():
        if element.tag == "sensor" and element.attributes.get("type") in ("imu", "imu_sensor"):
            inside |= {id(child) for child in element.children}
            yield _of_sensor(path, element)
        elif element.tag == "plugin" and id(element) not in inside:
            library = _library(element)
            if library in _ROTORS_LIBRARIES or any(map(element.child, _ROTORS_DEFAULTS)):
                yield _of_rotors(path, element)
            elif library in _CLASSIC_LIBRARIES or ("imu" in library and _has_noise(element)):
                yield _of_classic(path, element)


def _has_noise(plugin: Element) -> bool:
    return plugin.child("gaussianNoise") is not None


def _of_sensor(path: str, element: Element) -> Described:
    """Return an IMU of SDF."""
    name = element.attributes.get("name", "imu")
    where = f"{path}: sensor {shortened(name)}"
    rate = _number(where, element, "update_rate")
    own: dict[str, object] = {}
    for triad in TRIADS:
        old = element.child("imu", "noise", _OLD_QUANTITIES[triad])
        noises = [element.child("imu", _QUANTITIES[triad], axis, "noise") for axis in AXES]
        if old is not None:
            noises = [old, old, old]
        if any(noises):
            own |= _of_noise(where, f"imu.{triad}_", noises, rate)
    for plugin in element.children:
        if plugin.tag == "plugin" and "imu" in _library(plugin) and _has_noise(plugin):
            added = _of_classic(path, plugin, rate).parameters
            for key in (f"imu.{triad}_noise_density" for triad in TRIADS):
                before = np.broadcast_to(np.asarray(own.get(key, 0.0)), (3,))
                own[key] = np.hypot(before, np.asarray(added[key])).tolist()
    frame = element.child("gz_frame_id") or element.child("ignition_frame_id")
    return Described(name, {**_common(rate, frame), **own})


def _of_noise(
    where: str, prefix: str, noises: "list[Element | None]", rate: float
) -> dict[str, object]:
    """Return the parameters of three ``<noise>``.

    ``stddev`` is that of a sample, at the sensor's rate. The bias at the start is drawn with either
    sign, so ``bias_mean`` and ``bias_stddev`` are one deviation; ``dynamic_bias_stddev`` drives a
    first-order Gauss-Markov process (gz-sensors, GaussianNoiseModel.cc).
    """

    def values(name: str) -> list[float]:
        return [0.0 if one is None else _number(where, one, name) for one in noises]

    for one in noises:
        kind = one.attributes.get("type", "gaussian") if one is not None else "gaussian"
        if kind not in ("gaussian", "gaussian_quantized", "none"):
            raise InputError(f"{where}: noise of type {shortened(kind)} is not known")
    deviations = values("stddev")
    if any(deviations) and not rate:
        raise InputError(
            f"{where}: has no <update_rate>: <stddev> is that of one sample, so its density "
            "depends on the rate"
        )
    driving, times = values("dynamic_bias_stddev"), values("dynamic_bias_correlation_time")
    steady = zip(values("bias_mean"), values("bias_stddev"), strict=True)
    found = {
        "noise_density": [d / math.sqrt(rate) if d else 0.0 for d in deviations],
        "bias": values("mean"),
        "turn_on_bias_sigma": [math.hypot(mean, deviation) for mean, deviation in steady],
        "gauss_markov_density": [s if t else 0.0 for s, t in zip(driving, times, strict=True)],
        "correlation_time": [t if s else 0.0 for s, t in zip(driving, times, strict=True)],
        "resolution": values("precision"),
    }
    for name in ("noise_density", "turn_on_bias_sigma", "gauss_markov_density", "resolution"):
        if min(found[name]) < 0.0:
            raise InputError(f"{where}: {name} would be {min(found[name]):g}: must be at least 0")
    return {f"{prefix}{name}": numbers for name, numbers in found.items() if any(numbers)}


def _of_rotors(path: str, element: Element) -> Described:
    """Return an IMU of RotorS; what the model leaves out the plugin has values for."""
    name = element.attributes.get("name", "imu")
    where = f"{path}: plugin {shortened(name)}"
    own: dict[str, object] = {}
    for key, default in _ROTORS_DEFAULTS.items():
        triad = next(one for one in TRIADS if key.startswith(one))
        value = default if element.child(key) is None else _number(where, element, key)
        own[f"imu.{triad}_{_ROTORS[key.removeprefix(triad)]}"] = value
    for triad in TRIADS:
        if not own[f"imu.{triad}_correlation_time"]:
            own[f"imu.{triad}_gauss_markov_density"] = 0.0
    return Described(name, {**_common(0.0, element.child("linkName")), **own})


def _of_classic(path: str, element: Element, rate_of_sensor: float = 0.0) -> Described:
    """Return an IMU of Gazebo classic: one deviation for all axes, 0 if none is written."""
    name = element.attributes.get("name", "imu")
    where = f"{path}: plugin {shortened(name)}"
    deviation = _number(where, element, "gaussianNoise")
    rate = _number(where, element, "updateRateHZ") or _number(where, element, "updateRate")
    rate = rate or rate_of_sensor
    if deviation and not rate:
        raise InputError(
            f"{where}: has no <updateRateHZ>: <gaussianNoise> is that of one sample, so its "
            "density depends on the rate"
        )
    density = deviation / math.sqrt(rate) if deviation else 0.0
    own = {f"imu.{triad}_noise_density": density for triad in TRIADS}
    return Described(name, {**_common(rate, element.child("frameName")), **own})


def _common(rate: float, frame: Element | None) -> dict[str, object]:
    """Return rate and frame, if they are given."""
    result: dict[str, object] = {}
    if rate:
        result["rate"] = rate
    words = frame.text.strip().lstrip("/") if frame is not None else ""
    if words and words != IMU_FRAME:
        result["imu_frame"] = words
    return result


def _number(where: str, element: Element, name: str) -> float:
    """Return the number in a child; 0 if there is none.

    :raises InputError: for a child that is no finite number.
    """
    child = element.child(name)
    if child is None:
        return 0.0
    try:
        value = number_of(child.text.strip())
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        words = child.text.strip()
        hint = "; the file is a template: render it first" if "{" in words else ""
        raise InputError(f"{where}: <{name}> {shortened(words)}: must be a number{hint}")
    return value
