# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The source of the stacks' files: the values of one simulated IMU."""

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors import sensors_of_imus
from imu_sim_ros.sensors.errors.triad import variance_discrete
from imu_sim_ros.sensors.imu.parameters import ImuParameters

DENSITIES: Final = tuple(f"{t}_{key}" for t in TRIADS for key in ("noise_density", "random_walk"))
"""Names of the four numbers that every stack uses in some form."""
SMALLEST: Final = 1e-12
"""Number in place of 0 for stacks that divide by it or, like kalibr, refuse 0."""
_SMALLEST_DETERMINANT: Final = 1e-6
"""Smallest determinant of a scale matrix that can be inverted."""
_FLICKER: Final = math.sqrt(2.0 * math.log(2.0) / math.pi)
HORIZON: Final = 1.0
"""Time at which the random walk of an estimator stands for the 1/f noise [s].

Chosen for the consistency of a smoother in gtsam (CombinedImuFactors, a pose every 0.2 s): with
1 s its NEES per degree of freedom is close to 1, with 10 s it is 2 to 4.
"""
# Parameters that only say how another one is interpreted.
_NO_TERMS: Final = frozenset(
    [
        "preset",
        "reference_temperature",
        "bandwidth_order",
        *(f"{triad}_correlation_time" for triad in TRIADS),
    ]
)
SAME_TIME: Final = 1e-5
"""Largest difference of delays that stacks ignore [s]."""
_VIBRATION: Final = ("vibration.line_amplitude", "vibration.band_density")
"""Strengths of the vehicle's vibration; its other parameters are frequencies and phases."""
# The mount is no error: the stacks estimate the trajectory of the IMU.
_EXTRINSICS: Final = frozenset(["lever_arm", "mounting"])


@dataclass(frozen=True)
class ImuValues:
    """One IMU as its consumers see it."""

    imu: ImuParameters
    """Simulated parameters, with the constants drawn for this run."""
    rate: float
    """Sample rate [Hz]."""
    gravity: float
    """Magnitude of gravity [m/s^2]."""
    topic: str
    """Topic of the readings."""
    duration: float = 0.0
    """Length of the record [s]; 0: unknown."""

    def axes(self, name: str) -> Array:
        """Return a parameter of the IMU per axis (3,)."""
        return np.asarray(flatten(self.imu)[name], dtype=np.float64)

    def filter_axes(self, name: str) -> Array:
        """Return a density (3,) for an estimator, whose walk includes the 1/f noise.

        The Allan deviations of a walk and of 1/f noise, ``K sqrt(t / 3)`` and ``0.664 B``, meet at
        the horizon T if ``K^2 = 3 (0.664 B)^2 / T``, which is added to the square of the walk.
        """
        triad, _, key = name.partition("_")
        if key != "random_walk":
            return self.axes(name)
        flicker = math.sqrt(3.0 / HORIZON) * _FLICKER * self.axes(f"{triad}_bias_instability")
        return np.hypot(self.axes(name), flicker)

    def rms_density(self, name: str) -> float:
        """Return the root mean square over the axes of a density for an estimator."""
        return _root_mean_square(self.filter_axes(name))

    def densities(self) -> dict[str, float]:
        """Return kalibr's four numbers as simulated: continuous time, one for three axes."""
        return {name: _root_mean_square(self.axes(name)) for name in DENSITIES}

    def positive_densities(self) -> dict[str, float]:
        """Return kalibr's four numbers for an estimator, each above 0."""
        return {name: max(self.rms_density(name), SMALLEST) for name in DENSITIES}

    def response(self, triad: str) -> Array:
        """Return S (3, 3) of ``reading = S x + ...``; the identity if no stack can invert it."""
        if self.is_reversible(triad):
            return np.reshape(self.axes(f"{triad}_scale_misalignment"), (3, 3))
        return np.eye(3)

    def is_reversible(self, triad: str) -> bool:
        """Return whether S is invertible and does not mirror."""
        s = np.reshape(self.axes(f"{triad}_scale_misalignment"), (3, 3))
        return float(np.linalg.det(s)) > _SMALLEST_DETERMINANT

    def lowest_deviation(self, triad: str) -> Array:
        """Return the minimum of the Allan deviation (3,): white noise, flicker and random walk.

        ``N^2 / tau + 0.664^2 B^2 + K^2 tau / 3`` is smallest at ``tau = sqrt(3) N / K``.
        """
        n, k, b = (
            self.axes(f"{triad}_{key}")
            for key in ("noise_density", "random_walk", "bias_instability")
        )
        return np.sqrt(2.0 * n * k / math.sqrt(3.0) + (_FLICKER * b) ** 2)

    @property
    def rest_deviation(self) -> float:
        """Root of the summed variances of the accelerometer's axes at rest [m/s^2]."""
        return math.sqrt(sum(variance_discrete(self.imu, "accelerometer", self.rate)))

    @property
    def lateness(self) -> float:
        """Stamp of a slow motion in the readings minus its true time [s].

        The delay is that of the gyroscope, which determines the time shift of other sensors.
        """
        return self.imu.stamp_offset + float(np.mean(self.imu.delay("gyroscope", self.rate)))

    def delay_remarks(self) -> Iterator[str]:
        """Yield a sentence if the delays of axes or triads differ: one time shift is not enough."""
        mean = self.lateness - self.imu.stamp_offset
        for triad in TRIADS:
            delays = self.imu.delay(triad, self.rate)
            if max(abs(delay - mean) for delay in delays) > SAME_TIME:
                numbers = ", ".join(decimal(float(f"{delay:.6g}")) for delay in delays)
                yield (
                    f"The readings of the {triad} lag by {numbers} s (x, y, z); the time shift has "
                    f"{decimal(float(f'{mean:.6g}'))} s, the mean of the gyroscope"
                )

    def inexpressible_terms(self, expressed: Collection[str] = ()) -> list[str]:
        """Return the simulated terms that a format cannot express, by parameter.

        :param expressed: parameters that the format can express in addition to the four densities.
        """
        default = flatten(ImuParameters())
        ignored = {*DENSITIES, *expressed, *_NO_TERMS, *_EXTRINSICS}
        ignored -= {f"{t}_scale_misalignment" for t in TRIADS if not self.is_reversible(t)}
        unfiltered = (t for t in TRIADS if not any(self.imu.low_pass(t, self.rate)))
        ignored |= {f"{t}_bandwidth" for t in unfiltered}
        return [
            name
            for name, value in flatten(self.imu).items()
            if name not in ignored and value != default[name] and _is_imu_error(name)
        ]

    def axis_dependent_densities(self) -> list[str]:
        """Return the densities that differ between the axes."""
        return [name for name in DENSITIES if len(set(self.axes(name).tolist())) > 1]


def _root_mean_square(axes: Array) -> float:
    """Return the root mean square of the values (3,) of three axes."""
    return math.sqrt(float(np.mean(axes**2)))


def _is_imu_error(name: str) -> bool:
    """Return whether a parameter is an error of the IMU's readings."""
    if name.startswith("vibration."):
        return name in _VIBRATION
    # Stacks do not read the other sensors of an IMU.
    return not name.startswith(tuple(f"{sensor.name}_" for sensor in sensors_of_imus()))


def number_notes(
    values: ImuValues,
    expressed: Collection[str] = (),
    *,
    per_axis: bool = False,
    above_zero: bool = False,
) -> Iterator[str]:
    """Yield the notes of a file on its numbers, a sentence each.

    :param expressed: parameters of the IMU that the format can express, next to the densities.
    :param per_axis: True if the format has a number for each axis.
    :param above_zero: True if the format needs numbers above 0.
    """
    zero = [name for name in DENSITIES if values.rms_density(name) == 0.0]
    walks = [f"{t}_random_walk" for t in TRIADS if values.axes(f"{t}_bias_instability").any()]
    if walks and not set(expressed).issuperset(f"{t}_bias_instability" for t in TRIADS):
        yield (
            f"{', '.join(walks)}: sqrt(K^2 + 3 (0.664 B)^2 / T), T = {HORIZON:g} s: the simulated "
            "walk K and a walk whose Allan deviation is that of the simulated 1/f noise B at T, "
            "with which velocity and pose of a smoother in gtsam have the covariance it states. "
            + "; ".join(f"{w}: K = {decimal(values.densities()[w])}" for w in walks)
        )
    if above_zero and zero:
        yield f"0 in the simulation, but a number above 0 is required: {', '.join(zero)}"
    if not per_axis and (differing := values.axis_dependent_densities()):
        yield f"The root mean square of axes that differ: {', '.join(differing)}"
    missing = values.inexpressible_terms(expressed)
    if missing:
        yield f"Simulated, but not expressible in this format: {', '.join(missing)}"
    elif per_axis or not values.axis_dependent_densities():
        yield "This format expresses every error of the IMU that is simulated."


def comment(lines: Iterator[str] | list[str]) -> str:
    """Return sentences as YAML comments, wrapped at 100 columns."""
    import textwrap

    return "".join(
        f"{row}\n"
        for line in lines
        for row in textwrap.wrap(line, 100, initial_indent="# ", subsequent_indent="#   ")
    )


def rows(matrix: Array, indent: str) -> str:
    """Return a matrix as YAML, a list of floating-point numbers for each row."""
    return "".join(f"{indent}- [ {', '.join(map(yaml_float, row.tolist()))} ]\n" for row in matrix)


def yaml_float(value: float) -> str:
    """Return a number as text that YAML readers parse as floating point."""
    text = decimal(value)
    return text if "." in text else f"{text}.0"
