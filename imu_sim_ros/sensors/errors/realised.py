# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Constants of a unit drawn from its seed: what a data sheet gives as a tolerance.

Which constants there are, and what a turn-on scale does to them, the declarations of a sensor's
parameters say: a constant is a parameter NAME next to which there is a NAME_sigma.
"""

import dataclasses
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.random_streams import Seed, Streams, axes_first
from imu_sim_ros.core.types import Array, Keywords
from imu_sim_ros.parameters.kinds import ZERO_VECTOR
from imu_sim_ros.parameters.sections import parameters as declared
from imu_sim_ros.sensors import sensors_of_imus
from imu_sim_ros.sensors.errors.terms import is_set, turn_on
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import NO_CROSS_AXIS, TriadParameters

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_Section = TypeVar("_Section", bound="DataclassInstance")


class _Constant(NamedTuple):
    """A constant of a section that is drawn."""

    name: str
    sigma: str
    """Name of its standard deviation."""
    numbers_per_axis: int
    """Numbers per axis: 3 for a matrix, else 1."""


@cache
def _constants(cls: type) -> tuple[_Constant, ...]:
    """Return the constants of a section."""
    section_parameters = declared(cls)
    return tuple(
        _Constant(name, f"{name}_sigma", 3 if parameter.kind == "matrix" else 1)
        for name, parameter in section_parameters.items()
        if f"{name}_sigma" in section_parameters
    )


def add_constants(section: _Section, sensor: str, seed: Seed) -> _Section:
    """Return a section of parameters with the drawn part of each constant added.

    Each constant has a stream of its own per axis, so that adding one changes no other.

    :param sensor: as in the streams' names.
    """
    changed: Keywords = {}
    drawn = [
        constant
        for constant in _constants(type(section))
        if is_set(getattr(section, constant.sigma))
    ]
    if not drawn:
        return section
    sources = [f"{sensor}.{constant.name}" for constant in drawn]
    numbers = Streams(seed, *sources).next(max(constant.numbers_per_axis for constant in drawn))
    for k, (name, sigma, count) in enumerate(drawn):
        numbers_of_constant = axes_first(numbers[:count, ..., 3 * k : 3 * k + 3])
        added = numbers_of_constant * np.asarray(getattr(section, sigma))[..., None]
        value = np.asarray(getattr(section, name))
        sums = np.array(value) if value.size else np.zeros((*np.shape(seed), 3))
        sums[..., : 3 * count] += added.reshape(*np.shape(seed), 3 * count)
        changed |= _fields(seed, **{name: sums, sigma: np.zeros(3)})
    return dataclasses.replace(section, **changed)


def _fields(seed: Seed, **values: Array) -> Keywords:
    """Return values of parameters: tuples for one unit, arrays (count, k) for those of a batch."""
    if not np.ndim(seed):
        return {name: tuple(np.ravel(value).tolist()) for name, value in values.items()}
    return {name: broadcast_to_units(value, np.shape(seed)) for name, value in values.items()}


def broadcast_to_units(value: Array, shape: tuple[int, ...]) -> Array:
    """Return values (k,) or (count, k) as those of each unit (count, k), without a copy."""
    return value if value.ndim > 1 else np.broadcast_to(value, (*shape, len(value)))


def realise_unit(parameters: TriadParameters, triad: str, seed: Seed) -> TriadParameters:
    """Return the triad with the drawn part of each constant added and nothing left to draw.

    The turn-on bias and scale differ from run to run: :func:`include_turn_on`.

    :param triad: name of the triad, as in the streams' names.
    """
    p = add_constants(parameters, triad, seed)
    if not (np.ndim(seed) or is_set(p.misalignment_sigma)):
        return p
    matrix = p.response()
    numbers = axes_first(Streams(seed, f"{triad}.misalignment").next(2))
    added = numbers * np.asarray(p.misalignment_sigma)[..., None]
    matrix[..., ~np.eye(3, dtype=bool)] += added.reshape(*np.shape(seed), 6)
    changed = _fields(
        seed,
        scale_misalignment=matrix.reshape(*matrix.shape[:-2], 9),
        scale_error_percent=np.zeros(3),
        misalignment_percent=np.zeros(6),
        misalignment_sigma=np.zeros(3),
    )
    return dataclasses.replace(p, **changed)


def include_turn_on(section: Any, sensor: str, seed: int, axes: Array | None = None) -> Any:
    """Return a section with the turn-on bias and scale included, and none left to draw.

    With parts c of the scale by temperature and age, ``(1 + s + c) (S x + ...)`` becomes
    ``(1 + c / (1 + s)) ((1 + s) S x + ...)``; readings differ by rounding only.

    :param sensor: as in the streams' names.
    :param axes: (3, 3) matrix from the sensor's axes to those of its response; None: the same axes.
    """
    bias = turn_on(seed, f"{sensor}.turn_on_bias", section.turn_on_bias_sigma)
    scale = 1.0 + turn_on(seed, f"{sensor}.turn_on_scale", section.turn_on_scale_sigma)
    gain = np.diag(scale) if axes is None else axes @ np.diag(scale) @ axes.T
    changed: Keywords = {"bias": np.asarray(section.bias) + bias}
    for name, parameter in declared(type(section)).items():
        value = np.asarray(getattr(section, name)) if parameter.turn_on_scale else np.empty(0)
        if parameter.turn_on_scale == "multiplies":
            changed[name] = gain @ value.reshape(3, -1)
        elif parameter.turn_on_scale == "divides":
            changed[name] = value.reshape(-1, 3) / scale
    changed = {name: tuple(np.ravel(value).tolist()) for name, value in changed.items()}
    changed |= {"turn_on_bias_sigma": ZERO_VECTOR, "turn_on_scale_sigma": ZERO_VECTOR}
    return dataclasses.replace(section, **changed)


def realise_triad(parameters: TriadParameters, triad: str, seed: int) -> TriadParameters:
    """Return the triad of a seed with nothing left to draw but the noise."""
    p = realise_unit(parameters, triad, seed)
    p = dataclasses.replace(p, **matrix_parameters(p.response()))
    return include_turn_on(p, triad, seed)


def realise_imu(imu: ImuParameters, seed: int) -> ImuParameters:
    """Return the IMU of this seed with nothing left to draw but the noise.

    Constants that differ from unit to unit are drawn. A turn-on bias is added to the constant one.
    A turn-on scale s, drawn per axis, multiplies the whole response of its axis,
    ``(1 + s + c) (S x + q x^2 + G f + H f^2)`` with the parts c of temperature and age: which
    parameters it multiplies and which it divides, their declarations say (``turn_on_scale``).
    Readings of the result differ from those of the seed by rounding only.
    """
    realised: Keywords = {
        **{name: realise_triad(imu.triad(name), name, seed) for name in TRIADS},
        "sensors": {
            sensor.name: sensor.realised(imu.sensors[sensor.name], seed, sensor.name)
            for sensor in sensors_of_imus()
        },
    }
    return dataclasses.replace(imu, **realised)


def matrix_parameters(response: Array) -> Keywords:
    """Return parameters that state S (3, 3) as a matrix, without percent forms."""
    return {
        "scale_misalignment": tuple(np.ravel(response).tolist()),
        "scale_error_percent": ZERO_VECTOR,
        "misalignment_percent": NO_CROSS_AXIS,
    }
