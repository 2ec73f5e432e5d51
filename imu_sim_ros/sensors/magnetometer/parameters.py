# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the magnetometer of an IMU: ``imu.magnetometer_...``.

Errors that gyroscopes and accelerometers have as well have the same names.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.kinds import (
    IDENTITY_MATRIX,
    Matrix,
    Vector,
    flag,
    matrix,
    numbers,
    vector,
)
from imu_sim_ros.sensors.imu.triads import invertible_problems, triad_field
from imu_sim_ros.sensors.parameters import OwnRateParameters

_TEXTS: Final = {"triad": "magnetometer", "unit": "T", "change": "T/s", "quantity": "field"}


@dataclass(frozen=True)
class MagnetometerParameters(OwnRateParameters):
    """One magnetometer; every error is off at zero."""

    hard_iron: Vector = vector(
        0.0,
        "constant field of magnetised parts of the board and body, in the IMU's axes",
        unit="T",
        turn_on_scale="multiplies",
    )
    hard_iron_sigma: Vector = vector(
        0.0,
        "standard deviation from unit to unit of the hard iron, drawn from the seed",
        unit="T",
        minimum=0.0,
    )
    soft_iron: Matrix = matrix(
        IDENTITY_MATRIX,
        "matrix by which soft iron changes a field, in the IMU's axes",
        unit="1",
        turn_on_scale="multiplies",
    )
    soft_iron_sigma: Vector = vector(
        0.0,
        "standard deviation from unit to unit of each term in a row of the soft iron, drawn from "
        "the seed",
        unit="1",
        minimum=0.0,
    )
    misalignment: Vector = vector(
        0.0,
        "rotation vector that turns the IMU's axes into the magnetometer's, at most pi",
        unit="rad",
    )
    misalignment_sigma: Vector = vector(
        0.0,
        "standard deviation from unit to unit of the misalignment, drawn from the seed",
        unit="rad",
        minimum=0.0,
    )
    current_coupling: Vector = vector(
        0.0,
        "field of one ampere in the wires near the sensor, in the IMU's axes",
        unit="T/A",
        turn_on_scale="multiplies",
    )
    current_profile: tuple[float, ...] = numbers(
        (),
        "time [s] and current [A] alternating, times increasing; linear in between, the first and "
        "last are held",
        unit="s, A",
        group=2,
    )
    noise_density: Vector = triad_field("noise_density", _TEXTS)
    random_walk: Vector = triad_field("random_walk", _TEXTS)
    bias_instability: Vector = triad_field("bias_instability", _TEXTS)
    bias: Vector = triad_field("bias", _TEXTS, text="offset of the sensor itself, in its own axes")
    turn_on_bias_sigma: Vector = triad_field("turn_on_bias_sigma", _TEXTS)
    turn_on_scale_sigma: Vector = triad_field("turn_on_scale_sigma", _TEXTS)
    temperature_bias: tuple[float, ...] = triad_field("temperature_bias", _TEXTS)
    temperature_scale: tuple[float, ...] = triad_field("temperature_scale", _TEXTS)
    range: Vector = triad_field("range", _TEXTS)
    resolution: Vector = triad_field("resolution", _TEXTS)

    def response_and_bias(self) -> tuple[Array, Array]:
        """Return M (3, 3) and b (3,) [T] of ``reading = M B + b``, both in the sensor's axes.

        All random constants of the unit are drawn; no currents flow; the temperature is the
        reference.
        """
        r_mi = rotation.to_matrix(rotation.exp(self.misalignment)).T
        return r_mi @ np.reshape(self.soft_iron, (3, 3)), r_mi @ self.hard_iron + self.bias

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        yield from super().problems(prefix)
        if sum(x * x for x in self.misalignment) > 3.15**2:
            yield (
                f"{prefix}misalignment = {self.misalignment}: must be a rotation by at most pi rad"
            )
        yield from invertible_problems(self.soft_iron, f"{prefix}soft_iron")
        for previous, following in pairwise(self.current_profile[::2]):
            if following <= previous:
                yield (
                    f"{prefix}current_profile: time {following:g} s after {previous:g} s: "
                    "times must increase"
                )


@dataclass(frozen=True)
class MagnetometerSwitches:
    """Switches of the published topics."""

    magnetic_field: bool = flag(False, "publish imu/mag, the readings of the magnetometer")
    ground_truth_magnetic_field: bool = flag(
        False, "publish ground_truth/mag, the magnetic field without errors"
    )
