# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the errors of a triad, gyroscope or accelerometer: each off at zero, each per axis.

One table describes both; where their words and units differ they stand in braces.
``imu.gyroscope.bias`` in Python is the parameter ``imu.gyroscope_bias``. Names and units of the
noise are kalibr's. ``live`` marks what may change between two blocks without a jump of anything
else.
"""

import dataclasses
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.core.conventions import Triad
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.kinds import (
    IDENTITY_MATRIX,
    ZERO_MATRIX,
    Matrix,
    Vector,
    copy_parameter,
    matrix,
    numbers,
    vector,
)
from imu_sim_ros.parameters.sections import parameters, section

NO_CROSS_AXIS = (0.0,) * 6
_OF_A_TRIAD: Final = "of a triad"
"""Key of a field of another sensor that is one of the triads'."""
_SMALLEST_DETERMINANT: Final = 1e-3
"""Smallest determinant of a response that can be inverted."""
_LONGEST_FLICKER: Final = 1e4
"""Longest correlation time of the processes whose sum is 1/f noise [s]."""

_WORDS: Final[Mapping[Triad, Mapping[str, str]]] = {
    "gyroscope": {
        "triad": "gyroscope",
        "quantity": "rate",
        "unit": "rad/s",
        "change": "rad/s^2",
        "increment": "rad",
        "increments": "delta angles",
    },
    "accelerometer": {
        "triad": "accelerometer",
        "quantity": "specific force",
        "unit": "m/s^2",
        "change": "m/s^3",
        "increment": "m/s",
        "increments": "delta velocities",
    },
}
"""Words for each triad's descriptions; ``change``: unit per second, ``increment``: unit times s."""
_OF_THE_GYROSCOPE: Final = ("g_sensitivity", "g_sensitivity_sigma", "g_squared_sensitivity")
"""An accelerometer's response to specific force is its scale and its non-linearity."""


class WhiteTerms(NamedTuple):
    """Terms of the variance of white noise and rounding in the readings of a triad."""

    by_rate: Array
    """(3,) variance per rate of the readings [unit of the triad^2 / Hz]."""
    constant: Array
    """(3,) variance at any rate [unit of the triad^2]."""

    def variance(self, rate: float) -> Array:
        """Return the variance (3,) of a reading.

        :param rate: readings per second [Hz].
        """
        return self.by_rate * rate + self.constant


@dataclass(frozen=True)
class TriadParameters:
    """Errors of a gyroscope or an accelerometer."""

    noise_density: Vector = vector(
        0.0,
        "white noise of the {triad}, continuous time, two-sided: the variance of a sample is "
        "density^2 * rate; a data sheet's one-sided density D is D / sqrt(2) here",
        unit="{unit}/sqrt(Hz)",
        minimum=0.0,
        live=True,
        covariance=True,
    )
    noise_correlation: Vector = vector(
        0.0,
        "correlation of the {triad}'s white noise between its axes: xy, xz, yz",
        unit="1",
        minimum=-1.0,
        maximum=1.0,
        live=True,
    )
    noise_temperature_coefficient: Vector = vector(
        0.0,
        "relative change of the {triad}'s white noise with temperature: its deviation is "
        "multiplied by 1 + coefficient (T - T0), at least 0",
        unit="1/K",
        live=True,
    )
    random_walk: Vector = vector(
        0.0,
        "random walk of the {triad}'s bias, continuous time",
        unit="{change}/sqrt(Hz)",
        minimum=0.0,
        live=True,
        covariance=True,
    )
    gauss_markov_sigma: Vector = vector(
        0.0,
        "first-order Gauss-Markov bias of the {triad}: its stationary standard deviation",
        unit="{unit}",
        minimum=0.0,
        live=True,
        covariance=True,
    )
    gauss_markov_density: Vector = vector(
        0.0,
        "first-order Gauss-Markov bias of the {triad}: the noise that drives it (as in RotorS)",
        unit="{change}/sqrt(Hz)",
        minimum=0.0,
        live=True,
        covariance=True,
    )
    correlation_time: Vector = vector(
        0.0,
        "correlation time of the {triad}'s Gauss-Markov bias",
        unit="s",
        minimum=0.0,
        covariance=True,
    )
    bias_instability: Vector = vector(
        0.0,
        "bias instability B of the {triad}: 1/f noise of two-sided density "
        "B^2 / (2 pi f); the flat Allan deviation is 0.664 B",
        unit="{unit}",
        minimum=0.0,
        live=True,
        covariance=True,
    )
    rate_ramp: Vector = vector(
        0.0, "steady drift of the {triad}'s bias", unit="{change}", live=True
    )
    bias: Vector = vector(0.0, "constant bias of the {triad}", unit="{unit}", live=True)
    turn_on_bias_sigma: Vector = vector(
        0.0,
        "standard deviation of the {triad}'s bias from run to run; a simulation draws it from the "
        "seed",
        unit="{unit}",
        minimum=0.0,
        covariance=True,
    )
    turn_on_scale_sigma: Vector = vector(
        0.0,
        "standard deviation of the {triad}'s scale from run to run; a simulation draws it from the "
        "seed",
        unit="1",
        minimum=0.0,
        covariance=True,
    )
    scale_misalignment: Matrix = matrix(
        IDENTITY_MATRIX,
        "scale and misalignment S of the {triad}: reading = S x + b",
        live=True,
        turn_on_scale="multiplies",
    )
    scale_error_percent: Vector = vector(
        0.0,
        "scale error of the {triad}, instead of the matrix: the diagonal of S - I",
        unit="%",
        live=True,
    )
    misalignment_percent: tuple[float, ...] = numbers(
        NO_CROSS_AXIS,
        "cross-axis terms of the {triad}, instead of the matrix: xy, xz, yx, yz, zx, zy of S",
        unit="%",
        group=6,
        live=True,
    )
    quadratic: Vector = vector(
        0.0,
        "second-order non-linearity of the {triad}: q x^2",
        unit="1/({unit})",
        live=True,
        turn_on_scale="multiplies",
    )
    g_sensitivity: Matrix = matrix(
        ZERO_MATRIX,
        "change of the {triad}'s reading per m/s^2 of specific force",
        unit="({unit})/(m/s^2)",
        live=True,
        turn_on_scale="multiplies",
    )
    g_squared_sensitivity: Matrix = matrix(
        ZERO_MATRIX,
        "change of the {triad}'s reading per (m/s^2)^2 along each axis (vibration rectification); "
        "for the accelerometer, set `quadratic`",
        unit="({unit})/(m/s^2)^2",
        live=True,
        turn_on_scale="multiplies",
    )
    temperature_bias: tuple[float, ...] = numbers(
        (),
        "bias polynomial of the {triad}: row k, x y z, is the coefficient of (T - T0)^(k+1)",
        unit="{unit}/K^(k+1)",
        group=3,
        live=True,
    )
    temperature_scale: tuple[float, ...] = numbers(
        (),
        "scale polynomial of the {triad}: row k, x y z, is the coefficient of (T - T0)^(k+1)",
        unit="1/K^(k+1)",
        group=3,
        live=True,
        turn_on_scale="divides",
    )
    temperature_bias_sigma: Vector = vector(
        0.0,
        "standard deviation from unit to unit of the {triad}'s linear bias drift with temperature; "
        "sign and size are drawn from the seed and add to temperature_bias",
        unit="{unit}/K",
        minimum=0.0,
    )
    temperature_scale_sigma: Vector = vector(
        0.0,
        "standard deviation from unit to unit of the {triad}'s linear scale drift with "
        "temperature; sign and size are drawn from the seed and add to temperature_scale",
        unit="1/K",
        minimum=0.0,
    )
    temperature_hysteresis: Vector = vector(
        0.0,
        "bias of the {triad} while heating minus that while cooling: the width of the loop",
        unit="{unit}",
    )
    ageing_bias: Vector = vector(
        0.0,
        "drift of the {triad}'s bias with age: ageing_bias * log10(1 + days)",
        unit="{unit}",
    )
    ageing_scale: Vector = vector(
        0.0,
        "drift of the {triad}'s scale with age: ageing_scale * log10(1 + days)",
        unit="1",
        turn_on_scale="divides",
    )
    stress_step_sigma: Vector = vector(
        0.0,
        "standard deviation of the bias jumps of the {triad} at `stress_step_rate`",
        unit="{unit}",
        minimum=0.0,
    )
    shock_bias_sigma: Vector = vector(
        0.0,
        "standard deviation of the bias that a shock above `shock_threshold` leaves on the {triad}",
        unit="{unit}",
        minimum=0.0,
    )
    misalignment_sigma: Vector = vector(
        0.0,
        "standard deviation from unit to unit of each cross-axis term of the {triad}'s axis; a "
        "simulation draws it from the seed",
        unit="1",
        minimum=0.0,
        covariance=True,
    )
    quadratic_sigma: Vector = vector(
        0.0,
        "standard deviation from unit to unit of the {triad}'s second-order non-linearity; a "
        "simulation draws it from the seed",
        unit="1/({unit})",
        minimum=0.0,
        covariance=True,
    )
    g_sensitivity_sigma: Vector = vector(
        0.0,
        "standard deviation from unit to unit of each term of the g-sensitivity of the {triad}'s "
        "axis; a simulation draws it from the seed",
        unit="({unit})/(m/s^2)",
        minimum=0.0,
        covariance=True,
    )
    bandwidth: Vector = vector(
        0.0,
        "cut-off (-3 dB) of the {triad}'s low-pass; 0: none; without effect from half the rate on",
        unit="Hz",
        minimum=0.0,
    )
    range: Vector = vector(
        0.0, "largest {quantity} of the {triad}; 0: no limit", unit="{unit}", minimum=0.0, live=True
    )
    resolution: Vector = vector(
        0.0,
        "step of the {triad}'s digital output (1 LSB); 0: none. The largest reading is the "
        "largest whole step within the range",
        unit="{unit}",
        minimum=0.0,
        live=True,
        covariance=True,
    )
    increment_resolution: Vector = vector(
        0.0,
        "step of the {triad}'s {increments} with averaged sampling; the rounding remainder "
        "is carried over to the next; 0: exact",
        unit="{increment}",
        minimum=0.0,
        live=True,
    )

    def white_variance(self, rate: float) -> Array:
        """Return the variance (3,) of white noise and rounding in a reading without low-pass.

        :param rate: readings per second [Hz].
        """
        return self.white_terms().variance(rate)

    def white_terms(self) -> WhiteTerms:
        """Return the terms of :meth:`white_variance`.

        Rounding to steps of LSB is white noise of ``LSB^2 / 12`` (Widrow 1956).
        """
        return WhiteTerms(np.square(self.noise_density), np.square(self.resolution) / 12.0)

    @property
    def gauss_markov(self) -> Array:
        """The standard deviation (..., 3) of the Gauss-Markov bias, given in either form.

        A density b that drives it gives a stationary variance of ``b^2 tau / 2``.
        """
        driven = self.gauss_markov_density * np.sqrt(np.multiply(0.5, self.correlation_time))
        return np.asarray(self.gauss_markov_sigma + driven)

    def response(self) -> Array:
        """Return S (3, 3), whether given as a matrix or in percent (lecture eq. 7).

        The parameters of a batch have a leading axis, and so has S then.
        """
        percent = np.zeros((*np.shape(self.misalignment_percent)[:-1], 3, 3))
        percent[..., ~np.eye(3, dtype=bool)] = self.misalignment_percent
        percent[..., range(3), range(3)] = self.scale_error_percent
        matrix = np.reshape(self.scale_misalignment, percent.shape)
        return np.asarray(matrix + 0.01 * percent)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        triad = prefix.rpartition(".")[2]
        sigma, density = self.gauss_markov_sigma, self.gauss_markov_density
        tau = self.correlation_time
        if any(sigma) and any(density):
            yield (
                f"{prefix}gauss_markov_density = {density}: must be 0 "
                f"where {triad}gauss_markov_sigma is given; the two are one process"
            )
        if any((s or d) and not t for s, d, t in zip(sigma, density, tau, strict=True)):
            yield (
                f"{prefix}correlation_time = {tau}: must be above 0 s "
                f"on every axis that has a Gauss-Markov bias"
            )
        cross = self.misalignment_percent
        if len(cross) != len(NO_CROSS_AXIS):
            yield (
                f"{prefix}misalignment_percent = {cross}: "
                f"must be six numbers: xy, xz, yx, yz, zx, zy [%]"
            )
        percent = any(cross) or any(self.scale_error_percent)
        if percent and self.scale_misalignment != IDENTITY_MATRIX:
            yield (
                f"{prefix}scale_misalignment: must be the identity where "
                f"{triad}scale_error_percent or {triad}misalignment_percent is given"
            )
        elif percent and len(cross) == len(NO_CROSS_AXIS):
            if abs(np.linalg.det(self.response())) < _SMALLEST_DETERMINANT:
                yield (
                    f"{prefix}scale_error_percent = {self.scale_error_percent}: together with "
                    f"{triad}misalignment_percent an axis is lost"
                )
        elif not percent:
            yield from invertible_problems(self.scale_misalignment, f"{prefix}scale_misalignment")
        xy, xz, yz = self.noise_correlation
        if 1.0 + 2.0 * xy * xz * yz - xy * xy - xz * xz - yz * yz < 0.0:  # the determinant
            yield (
                f"{prefix}noise_correlation = {self.noise_correlation}: no three axes are "
                f"correlated like this; the matrix must be positive semidefinite"
            )


def invertible_problems(values: Matrix, name: str) -> Iterator[str]:
    """Yield a line if nine numbers, row by row, are no invertible matrix.

    :param name: name of the parameter, for the message.
    """
    if abs(np.linalg.det(np.reshape(values, (3, 3)))) < _SMALLEST_DETERMINANT:
        yield f"{name} = {list(values)}: must be invertible"


def triad(name: Triad, without: Collection[str] = (), fixed: bool = False) -> Any:
    """Describe the section of one triad, whose parameters are ``gyroscope_...`` in ROS.

    :param without, fixed: as for :func:`section`.
    """
    absent = (*without, *(() if name == "gyroscope" else _OF_THE_GYROSCOPE))
    return section(
        TriadParameters, joint="_", substitutions=_WORDS[name], without=absent, fixed=fixed
    )


@dataclass(frozen=True)
class TriadsParameters:
    """Errors of both triads."""

    gyroscope: TriadParameters = triad("gyroscope")
    accelerometer: TriadParameters = triad("accelerometer")

    def triad(self, name: str) -> TriadParameters:
        """Return the errors of one triad, or of another sensor with the IMU as if it were one."""
        section: object = getattr(self, name)
        return section if isinstance(section, TriadParameters) else to_triad(section)

    def processes(self, shortest: float) -> list[tuple[int, float, float]]:
        """Return the Gauss-Markov biases, and the processes whose sum is 1/f noise.

        Processes of the variance ``B^2 ln(r) / pi``, their correlation times a ratio r of about ten
        apart, have together the density ``B^2 / (2 pi f)`` of IEEE Std 952-1997.

        :param shortest: correlation time of those of the 1/f noise [s].
        :returns: of each, its axis 0 to 5, gyroscope first; its correlation time [s]; its standard
            deviation.
        """
        triads = (self.gyroscope, self.accelerometer)
        processes = [
            (3 * k + i, float(triad.correlation_time[i]), float(sigma))
            for k, triad in enumerate(triads)
            for i, sigma in enumerate(triad.gauss_markov)
        ]
        decades = round(np.log10(_LONGEST_FLICKER / shortest))
        times = np.geomspace(shortest, _LONGEST_FLICKER, max(2, decades + 1))
        share = float(np.sqrt(np.log(times[1] / times[0]) / np.pi))
        processes += [
            (3 * k + i, tau, float(b) * share)
            for k, triad in enumerate(triads)
            for i, b in enumerate(triad.bias_instability)
            for tau in times.tolist()
        ]
        return [process for process in processes if process[2] > 0.0]

    def response_terms(self) -> list[tuple[int, int, float]]:
        """Return the errors that scale with a reading: scale and misalignment, g-sensitivity, ...

        :returns: of each, its axis 0 to 5, gyroscope first; its input, the readings 0 to 5 and
            their squares 6 to 11; the standard deviation of the factor.
        """
        terms = []
        for k, triad in enumerate((self.gyroscope, self.accelerometer)):
            scale, cross = triad.turn_on_scale_sigma, triad.misalignment_sigma
            for i in range(3):
                axis = 3 * k + i
                for j in range(3):
                    terms.append((axis, 3 * k + j, float(scale[i] if i == j else cross[i])))
                terms.append((axis, 6 + axis, float(triad.quadratic_sigma[i])))
        for i, sigma in enumerate(self.gyroscope.g_sensitivity_sigma):
            terms += [(i, 3 + j, float(sigma)) for j in range(3)]
        return [term for term in terms if term[2] > 0.0]


def triad_field(name: str, unit_texts: Mapping[str, str], **changed: object) -> Any:
    """Return the field of another sensor's section for a parameter of the triads.

    :param name: name of the parameter in :class:`TriadParameters`.
    :param unit_texts: replacements of ``{triad}``, ``{unit}``, ... in text and unit.
    :param changed: fields of :class:`Parameter` that differ.
    """
    triads = parameters(TriadParameters)[name]
    texts = {"text": triads.text.format(**unit_texts), "unit": triads.unit.format(**unit_texts)}
    described = copy_parameter(triads, **{**texts, **changed})
    metadata = {**described.metadata, _OF_A_TRIAD: True}
    return dataclasses.field(default=described.default, metadata=metadata)


def names_as_in_triads(cls: type) -> list[str]:
    """Return the parameters of another sensor's section that are declared as those of a triad."""
    return [field.name for field in dataclasses.fields(cls) if _OF_A_TRIAD in field.metadata]


def to_triad(sensor: object) -> TriadParameters:
    """Return the errors of another sensor that are those of a triad.

    Those of a sensor that measures a single number are those of the first axis.
    """
    declarations, values = parameters(type(sensor)), {}
    for name in names_as_in_triads(type(sensor)):
        value, kind = getattr(sensor, name), declarations[name].kind
        if kind == "number" or (kind == "numbers" and declarations[name].group == 1):
            value = tuple(entry for x in np.ravel(value).tolist() for entry in (x, 0.0, 0.0))
        values[name] = value
    return TriadParameters(**values)
