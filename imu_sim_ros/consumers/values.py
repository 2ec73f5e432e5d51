# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The source of the stacks' files: the values of one simulated IMU."""

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.text import decimal
from imu_sim_ros.config import ImuParameters, flatten
from imu_sim_ros.conventions import TRIADS

Array = NDArray[np.float64]

DENSITIES: Final = tuple(f"{t}_{key}" for t in TRIADS for key in ("noise_density", "random_walk"))
"""The four numbers that every stack uses in some form."""
SMALLEST: Final = 1e-12
"""Replaces 0 where a stack divides by the number, or refuses 0 as kalibr does."""
_SMALLEST_DETERMINANT: Final = 1e-6
_FLICKER: Final = math.sqrt(2.0 * math.log(2.0) / math.pi)
# These determine how another parameter is interpreted, or choose among forms of the same.
_NO_TERMS: Final = frozenset(
    [
        "preset",
        "reference_temperature",
        "bandwidth_order",
        *(f"{triad}_correlation_time" for triad in TRIADS),
    ]
)
_OTHER_SENSORS: Final = ("magnetometer_", "barometer_", "orientation_")
"""The stacks do not read them."""
_VIBRATION: Final = ("vibration.line_amplitude", "vibration.band_density")
"""The strengths of the vehicle's vibration; the rest of it says where and when."""
# Poses: consumers take the trajectory of the IMU from the truth, and its place from the user.
_EXTRINSICS: Final = frozenset(["lever_arm", "mounting"])


@dataclass(frozen=True)
class ImuValues:
    """One IMU as its consumers see it."""

    imu: ImuParameters
    """All simulated parameters, with the drawn constants of this run in their places."""
    rate: float
    """Samples per second [Hz]."""
    gravity: float
    """Magnitude [m/s^2]."""
    topic: str
    """Of the readings."""
    duration: float = 0.0
    """Length of the record [s]; 0: not known."""

    def axes(self, name: str) -> Array:
        """Return a parameter of the IMU per axis (3,)."""
        return np.asarray(flatten(self.imu)[name], dtype=np.float64)

    def one(self, name: str) -> float:
        """Return a parameter as one number for three axes: their root mean square."""
        return math.sqrt(float(np.mean(self.axes(name) ** 2)))

    def densities(self) -> dict[str, float]:
        """Return the four numbers of kalibr, continuous time, one for three axes."""
        return {name: self.one(name) for name in DENSITIES}

    def positive_densities(self) -> dict[str, float]:
        """Return the same, above 0."""
        return {name: max(value, SMALLEST) for name, value in self.densities().items()}

    def response(self, triad: str) -> Array:
        """Return S (3, 3) of ``reading = S x + ...``; the identity where no stack can undo it."""
        if self.is_reversible(triad):
            return np.reshape(self.axes(f"{triad}_scale_misalignment"), (3, 3))
        return np.eye(3)

    def is_reversible(self, triad: str) -> bool:
        """Return whether S has an inverse and does not mirror."""
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

    def missing(self, expressed: Collection[str] = ()) -> list[str]:
        """Return the simulated terms that a format cannot express, by parameter.

        :param expressed: the parameters that it can express besides the four densities.
        """
        default = flatten(ImuParameters())
        passed_over = {*DENSITIES, *expressed, *_NO_TERMS, *_EXTRINSICS}
        passed_over -= {f"{t}_scale_misalignment" for t in TRIADS if not self.is_reversible(t)}
        return [
            name
            for name, value in flatten(self.imu).items()
            if name not in passed_over and value != default[name] and _of_the_imu(name)
        ]

    def uneven(self) -> list[str]:
        """Return the densities that differ between the axes."""
        return [name for name in DENSITIES if len(set(self.axes(name).tolist())) > 1]


def _of_the_imu(name: str) -> bool:
    """Return whether a parameter is an error of the IMU's readings, whatever its value."""
    if name.startswith("vibration."):
        return name in _VIBRATION
    return not name.startswith(_OTHER_SENSORS)


def remarks(
    values: ImuValues,
    expressed: Collection[str] = (),
    *,
    per_axis: bool = False,
    above_zero: bool = False,
) -> Iterator[str]:
    """Yield the notes of a file on its numbers, a sentence each.

    :param expressed: parameters of the IMU that the format can express, besides the densities.
    :param per_axis: the format has a number for each axis.
    :param above_zero: the format wants numbers above 0.
    """
    zero = [name for name, value in values.densities().items() if value == 0.0]
    if above_zero and zero:
        yield f"0 in the simulation, where a number above 0 is required: {', '.join(zero)}"
    if not per_axis and values.uneven():
        yield f"The root mean square of axes that differ: {', '.join(values.uneven())}"
    missing = values.missing(expressed)
    if missing:
        yield f"Simulated, but not expressible in this format: {', '.join(missing)}"
    else:
        yield "This format expresses everything that is simulated."


def comment(lines: Iterator[str] | list[str]) -> str:
    """Return sentences as YAML comments, wrapped at 100 columns."""
    import textwrap

    return "".join(
        f"{row}\n"
        for line in lines
        for row in textwrap.wrap(line, 100, initial_indent="# ", subsequent_indent="#   ")
    )


def rows(matrix: Array, indent: str) -> str:
    """Return a matrix as YAML, a list for each row, all of it floating point."""
    return "".join(f"{indent}- [ {', '.join(map(_floating, row.tolist()))} ]\n" for row in matrix)


def _floating(value: float) -> str:
    words = decimal(value)
    return words if "." in words else f"{words}.0"
