# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The IMU that a model of Gazebo describes: SDF's ``<noise>``, Gazebo classic's plugin, RotorS'.

A plugin is known by its library: what a model does not write has the plugin's own default.

The XML is read without entities: a document type, with which they are declared, is refused.
"""

import math
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.conventions import AXES, IMU_FRAME, TRIADS
from imu_sim_ros.core.errors import InputError, Remark, warn
from imu_sim_ros.core.names import nearest, suggestion
from imu_sim_ros.core.rotation import from_euler, pose_matrix, to_matrix
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.rows import number_of, read_text, shorten_word
from imu_sim_ros.inputs.xml_text import Element, parse_xml
from imu_sim_ros.parameters.sections import bad_value_lines, parameters
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
_NOISE: Final = (
    *("mean", "stddev", "bias_mean", "bias_stddev", "precision"),
    *("dynamic_bias_stddev", "dynamic_bias_correlation_time"),
)
_KINDS: Final = ("none", "gaussian", "gaussian_quantized")
"""Types of noise, which sdformat compares in lower case (Noise.cc)."""
_OF_A_SENSOR: Final = ("update_rate", "imu", "pose", "gz_frame_id", "ignition_frame_id")
_OF_CLASSIC: Final = (
    *("gaussianNoise", "updateRateHZ", "updateRate", "frameName", "bodyName"),
    *("xyzOffset", "rpyOffset"),
)
_TYPO: Final = 0.85
"""Similarity from which on an element without an effect is a typing error of a known one."""
_ALIKE: Final = 0.6
"""Similarity within ``<noise>`` from which on an element is a typing error of a known one."""
_NO_SENSOR: Final = "imu-system"
"""Part of the names of gz-sim's own plugins, which run the sensors of a model."""
_TEMPLATE: Final = ("{%", "{{", "{#")
_XACRO: Final = "<xacro:"
_TYPES: Final = ("imu", "imu_sensor")
"""Types of sensors that are IMUs."""


class Described(NamedTuple):
    """An IMU of a model."""

    name: str
    """Name of its sensor or plugin."""
    parameters: dict[str, object]
    """Values by dotted name: ``imu.*``, of which ``imu.preset`` is ``FILE#NAME``, ``rate`` and
    ``imu_frame`` if the model has them."""


class _Part(NamedTuple):
    """An element of an IMU, with the place that messages name."""

    where: str
    element: Element
    remarks: list[str]
    """A line for each element without an effect in Gazebo, and so here."""

    def number(self, name: str) -> float:
        """Return the number in a child; 0 if there is none.

        :raises InputError: for a child that is no finite number.
        """
        return 0.0 if self.element.child(name) is None else self.numbers(name, 1)[0]

    def numbers(self, name: str, *counts: int) -> list[float]:
        """Return the numbers in a child; zeros if there is none.

        :param counts: allowed numbers of numbers; without a child, the first one of them is zeros.
        :raises InputError: for anything but finite numbers, and for another count.
        """
        child = self.element.child(name)
        if child is None:
            return [0.0] * counts[0]
        text = child.text.strip()
        try:
            values = [number_of(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) not in counts or not all(map(math.isfinite, values)):
            hint = "; the file is a template: render it first" if "{" in text else ""
            count = " or ".join(map(str, counts))
            must = "a number" if counts == (1,) else f"{count} numbers"
            raise InputError(f"{self.where}: <{name}> {shorten_word(text)}: must be {must}{hint}")
        return values

    def check(self, names: Collection[str], similarity: float = _TYPO) -> None:
        """Refuse children with unknown names that resemble known ones.

        :param similarity: least similarity of names that are alike, 0 to 1.
        :raises InputError: for the first one of them.
        """
        for child in self.element.children:
            suggested = None if child.tag in names else nearest(child.tag, names, similarity)
            if suggested is not None:
                raise InputError(
                    f"{self.where}: <{child.tag}>: unknown element; did you mean <{suggested}>?"
                )


def read_model(path: str | Path, sensor: str | None = None, rate: object = None) -> Described:
    """Return the IMU of a model; elements without an effect in Gazebo are remarks.

    :param path: path of the file, or ``FILE#SENSOR``.
    :param sensor: name of the sensor; None: the only one.
    :param rate: samples per second [Hz] of a sensor whose model states none; what is no positive
        number is none.
    :raises InputError: for a file that is none, one without an IMU, and one with several; the line
        lists them.
    """
    file, _, fragment = str(path).partition("#")
    sensor = sensor or fragment or None
    root = _parse(file)
    elements = _name_imus(_imus(root))
    have = ", ".join(name for name, *_ in elements) or "none"
    if sensor is not None:
        elements = [imu for imu in elements if imu[0] == sensor]
        if not elements:
            raise InputError(f"{file}: has no IMU {shorten_word(sensor)}; it has {have}")
    if not elements:
        _refuse_template(file)
        hints = "".join(f"; {hint}" for hint in _hints(root))
        raise InputError(f"{file}: describes no IMU: no <sensor type='imu'>, no IMU plugin{hints}")
    name, element, values_of = elements[0]
    if len(elements) > 1 and sensor is None:
        raise InputError(f"{file}: has several IMUs, name one of {have}: {file}#{name}")
    if len(elements) > 1:
        raise InputError(f"{file}: has several IMUs named {name}; give them other names")
    part = _Part(f"{file}: {element.tag} {shorten_word(name)}", element, [])
    values = values_of(part, float(rate) if isinstance(rate, int | float) and rate > 0 else 0.0)
    problems = bad_value_lines(parameters(ImuParameters, prefix="imu."), values).values()
    if problems:
        raise InputError([f"{file}: {name}: {line}" for line in problems])
    for line in part.remarks:
        warn(line, Remark)
    return Described(name, {**values, "imu.preset": f"{file}#{name}"})


def _name_imus(
    imus: "Iterator[tuple[str, Element, ValuesOf]]",
) -> "list[tuple[str, Element, ValuesOf]]":
    """Return IMUs by name; those that share one have the names of their models before it.

    :param imus: IMUs with the names of the models around them, ``outer::left::``, before theirs.
    """
    scoped = list(imus)
    plain = [scope.rpartition("::")[2] for scope, *_ in scoped]
    return [
        (scope if plain.count(name) > 1 else name, element, values_of)
        for name, (scope, element, values_of) in zip(plain, scoped, strict=True)
    ]


def _hints(root: Element) -> Iterator[str]:
    """Yield what a model without an IMU has that may stand for one."""
    for element in root.every():
        kind = element.attributes.get("type", "")
        if element.tag == "sensor" and kind not in _TYPES and kind.lower() in _TYPES:
            yield f"<sensor type='{kind}'>: Gazebo knows 'imu' alone, in lower case"
        elif element.tag == "plugin" and "imu" in _library(element):
            yield f"{element.attributes['filename']} is not known"
        elif element.tag == "include":
            uri = element.child("uri")
            model = shorten_word(uri.text.strip()) if uri is not None else "another file"
            yield f"<include> is not followed: give the file of {model}"


def _parse(file: str) -> Element:
    """Return the root of a file.

    :raises InputError: for one that is not XML, perhaps because it is a template of it.
    """
    try:
        return parse_xml(file)
    except InputError:
        _refuse_template(file)
        raise


def _refuse_template(file: str) -> None:
    """Refuse a file that is a template.

    :raises InputError: if it is.
    """
    text = read_text(Path(file))
    if _XACRO in text:
        raise InputError(f"{file}: is a xacro file: run xacro, and give the result") from None
    if any(mark in text for mark in _TEMPLATE):
        raise InputError(
            f"{file}: is a Jinja template, not XML: render it first, and give the result"
        ) from None


def _library(plugin: Element) -> str:
    """Return the library of a plugin without ``lib`` and ``.so``; empty for gz-sim's own."""
    name = Path(plugin.attributes.get("filename", "")).name
    return "" if _NO_SENSOR in name else name.removeprefix("lib").removesuffix(".so")


def _imus(parent: Element, scope: str = "") -> Iterator[tuple[str, Element, "ValuesOf"]]:
    """Yield each IMU below an element: its name, and the function that reads it.

    A plugin within a sensor is a part of it.

    :param scope: names of the models around it, ``outer::left::``.
    """
    for element in parent.children:
        name = element.attributes.get("name", "imu")
        if element.tag == "sensor" and element.attributes.get("type") in _TYPES:
            yield scope + name, element, _sensor_parameters
            continue
        if element.tag == "plugin":
            if _library(element) in _ROTORS_LIBRARIES or any(map(element.child, _ROTORS_DEFAULTS)):
                yield scope + name, element, _rotors_parameters
            elif _is_classic(element):
                yield scope + name, element, _classic_parameters
        yield from _imus(element, f"{scope}{name}::" if element.tag == "model" else scope)


ValuesOf = Callable[[_Part, float], dict[str, object]]
"""Returns the parameters of an IMU by dotted name, given the rate where the model has none [Hz]."""


def _is_classic(plugin: Element) -> bool:
    """Return True for a plugin of Gazebo Classic with an IMU."""
    library = _library(plugin)
    noise = plugin.child("gaussianNoise")
    return library in _CLASSIC_LIBRARIES or ("imu" in library and noise is not None)


def _sensor_parameters(part: _Part, rate: float) -> dict[str, object]:
    """Return an IMU of SDF.

    A plugin of Gazebo classic in it takes the sensor's latest reading at a rate of its own, with
    noise, frame and offset of its own (gazebo_ros_imu_sensor.cpp).
    """
    where, element, remarks = part
    part.check(_OF_A_SENSOR)
    plugins = [
        _Part(f"{where}: plugin", child, remarks)
        for child in element.children
        if child.tag == "plugin" and _is_classic(child)
    ]
    stated = [part.number("update_rate"), *map(_classic_rate, plugins)]
    for hertz in stated:
        if hertz < 0.0:
            raise InputError(f"{where}: a rate of {hertz:g} Hz: must be at least 0")
    slowest = min((hertz for hertz in stated if hertz), default=0.0)
    values: dict[str, object] = {}
    for triad in TRIADS:
        noises = _noises(part, triad)
        if any(noises):
            values |= _noise_parameters(where, f"imu.{triad}_", noises, slowest or rate)
    frame = element.child("gz_frame_id") or element.child("ignition_frame_id")
    pose = _pose(part)
    for plugin in plugins:
        density = _classic_density(plugin, slowest or rate)
        for key in (f"imu.{triad}_noise_density" for triad in TRIADS):
            of_the_sensor = np.broadcast_to(np.asarray(values.get(key, 0.0)), (3,))
            values[key] = np.hypot(of_the_sensor, density).tolist()
        frame = plugin.element.child("frameName") or plugin.element.child("bodyName") or frame
        pose = pose @ _offset(plugin)
    return {**_rate_and_frame(slowest, frame), **_mount(pose), **values}


def _noises(part: _Part, triad: str) -> "list[_Part | None]":
    """Return the ``<noise>`` of the axes of a triad; None: none, or one that Gazebo passes over.

    Its type is ``none`` unless the model says another one (sdformat, noise.sdf).

    :raises InputError: for a type that does not exist.
    """
    where, element, remarks = part
    imu, quantity = element.child("imu"), _QUANTITIES[triad]
    if imu is None:
        return [None, None, None]
    _Part(f"{where}: <imu>", imu, remarks).check((*_QUANTITIES.values(), "noise"))
    common, whole = imu.child("noise", _OLD_QUANTITIES[triad]), imu.child(quantity)
    if common is not None:  # SDF up to 1.4 has one for the three axes
        of_noise = imu.child("noise", "type")
        kinds = ["" if of_noise is None else of_noise.text.strip()] * 3
        elements: list[Element | None] = [common, common, common]
    else:
        elements = [imu.child(quantity, axis, "noise") for axis in AXES]
        kinds = ["" if noise is None else noise.attributes.get("type", "") for noise in elements]
    if whole is not None and whole.child("noise") is not None:
        remarks.append(
            f"{where}: <{quantity}><noise>: no effect, as in Gazebo; it reads the noise of <x>, "
            "<y> and <z>"
        )
    noises: list[_Part | None] = []
    silent: dict[str, list[str]] = {"type none": [], "without a type": []}
    for axis, noise, written in zip(AXES, elements, kinds, strict=True):
        place, kind = f"{where}: <{quantity}><{axis}><noise>", written.strip().lower()
        if kind not in ("", *_KINDS):
            raise InputError(
                f"{place}: noise of type {shorten_word(written)} is not known; "
                f"{suggestion(kind, _KINDS)}"
            )
        part_of_axis = None if noise is None else _Part(place, noise, remarks)
        if part_of_axis is not None:
            part_of_axis.check(_NOISE, _ALIKE)
        if part_of_axis is not None and not kind.startswith("gaussian"):
            if any(map(part_of_axis.number, _NOISE)):
                silent["type none" if kind else "without a type"].append(f"<{axis}>")
            part_of_axis = None
        noises.append(part_of_axis)
    remarks += [
        f"{where}: <{quantity}>: the noise of {', '.join(axes)} is {why}: no effect, as in Gazebo"
        for why, axes in silent.items()
        if axes
    ]
    return noises


def _noise_parameters(
    where: str, prefix: str, noises: "list[_Part | None]", rate: float
) -> dict[str, object]:
    """Return the parameters of three ``<noise>``.

    ``stddev`` is that of a sample, at the sensor's rate. The bias at the start is drawn with either
    sign, so ``bias_mean`` and ``bias_stddev`` are one deviation; ``dynamic_bias_stddev`` drives a
    first-order Gauss-Markov process (gz-sensors, GaussianNoiseModel.cc).

    :param rate: samples per second [Hz]; 0: not known.
    """

    def values(name: str) -> list[float]:
        return [0.0 if noise is None else noise.number(name) for noise in noises]

    deviations = values("stddev")
    if any(deviations) and not rate:
        raise InputError(
            f"{where}: has no <update_rate>: <stddev> is that of one sample, so its density "
            f"depends on the rate: give {argument('rate')}"
        )
    driving, times = values("dynamic_bias_stddev"), values("dynamic_bias_correlation_time")
    halves = [a for a, s, t in zip(AXES, driving, times, strict=True) if bool(s) != bool(t)]
    if halves:
        part = next(noise for noise in noises if noise is not None)
        part.remarks.append(
            f"{where}: {prefix.strip('_')}: the dynamic bias of {', '.join(halves)} has either "
            "<dynamic_bias_stddev> or <dynamic_bias_correlation_time>, not both: no effect, as in "
            "Gazebo"
        )
    steady = zip(values("bias_mean"), values("bias_stddev"), strict=True)
    axes = {
        "noise_density": [d / math.sqrt(rate) if d else 0.0 for d in deviations],
        "bias": values("mean"),
        "turn_on_bias_sigma": [math.hypot(mean, deviation) for mean, deviation in steady],
        "gauss_markov_density": [s if t else 0.0 for s, t in zip(driving, times, strict=True)],
        "correlation_time": [t if s else 0.0 for s, t in zip(driving, times, strict=True)],
        "resolution": values("precision"),
    }
    for name in ("noise_density", "turn_on_bias_sigma", "gauss_markov_density", "resolution"):
        if min(axes[name]) < 0.0:
            raise InputError(f"{where}: {name} would be {min(axes[name]):g}: must be at least 0")
    return {f"{prefix}{name}": numbers for name, numbers in axes.items() if any(numbers)}


def _rotors_parameters(part: _Part, _: float) -> dict[str, object]:
    """Return an IMU of RotorS; the plugin has defaults for missing elements."""
    part.check(tuple(_ROTORS_DEFAULTS))
    values: dict[str, object] = {}
    for key, default in _ROTORS_DEFAULTS.items():
        triad = next(name for name in TRIADS if key.startswith(name))
        value = default if part.element.child(key) is None else part.number(key)
        values[f"imu.{triad}_{_ROTORS[key.removeprefix(triad)]}"] = value
    for triad in TRIADS:
        if not values[f"imu.{triad}_correlation_time"]:
            values[f"imu.{triad}_gauss_markov_density"] = 0.0
    return {**_rate_and_frame(0.0, part.element.child("linkName")), **values}


def _classic_parameters(part: _Part, rate: float) -> dict[str, object]:
    """Return an IMU of Gazebo classic: one deviation for all axes, 0 if none is written."""
    stated = _classic_rate(part)
    density = _classic_density(part, stated or rate)
    frame = part.element.child("frameName") or part.element.child("bodyName")
    values = {f"imu.{triad}_noise_density": density for triad in TRIADS}
    return {**_rate_and_frame(stated, frame), **_mount(_offset(part)), **values}


def _classic_rate(part: _Part) -> float:
    """Return the rate of a plugin of Gazebo classic [Hz]; 0: none is written."""
    return part.number("updateRateHZ") or part.number("updateRate")


def _classic_density(part: _Part, rate: float) -> float:
    """Return the noise density of a plugin of Gazebo classic.

    :param rate: messages per second [Hz]; 0: not known.
    """
    part.check(_OF_CLASSIC)
    deviation = part.number("gaussianNoise")
    if deviation and not rate:
        raise InputError(
            f"{part.where}: has no <updateRateHZ>: <gaussianNoise> is that of one sample, so its "
            f"density depends on the rate: give {argument('rate')}"
        )
    return deviation / math.sqrt(rate) if deviation else 0.0


def _offset(part: _Part) -> Array:
    """Return ``xyzOffset`` [m] and ``rpyOffset`` [rad] of a plugin as a pose (4, 4)."""
    angles = np.array(part.numbers("rpyOffset", 3))
    return pose_matrix(to_matrix(from_euler(angles)), part.numbers("xyzOffset", 3))


def _pose(part: _Part) -> Array:
    """Return the ``<pose>`` (4, 4) of a sensor in its link: x y z [m], roll pitch yaw."""
    element = part.element.child("pose")
    values = np.array(part.numbers("pose", 6, 7))
    if element is None or not values.any():
        return np.eye(4)
    if element.attributes.get("relative_to"):
        part.remarks.append(f"{part.where}: <pose relative_to>: no effect; only one in the link is")
        return np.eye(4)
    if len(values) == 7:  # rotation_format="quat_xyzw"
        attitude = to_matrix(values[[6, 3, 4, 5]] / np.linalg.norm(values[3:]))
    else:
        angles = values[3:]
        if element.attributes.get("degrees", "").lower() in ("true", "1"):
            angles = np.radians(angles)
        attitude = to_matrix(from_euler(angles))
    return pose_matrix(attitude, values[:3])


def _mount(pose: Array) -> dict[str, object]:
    """Return the parameters of a pose (4, 4) in the body; none if it is the body's."""
    if np.array_equal(pose, np.eye(4)):
        return {}
    arm, mounting = pose[:3, 3].tolist(), np.ravel(pose[:3, :3]).tolist()
    return {"imu.lever_arm": arm, "imu.mounting": mounting}


def _rate_and_frame(rate: float, frame: Element | None) -> dict[str, object]:
    """Return rate and frame, if they are given."""
    values: dict[str, object] = {}
    if rate:
        values["rate"] = rate
    name = frame.text.strip().lstrip("/") if frame is not None else ""
    if name and name != IMU_FRAME:
        values["imu_frame"] = name
    return values
