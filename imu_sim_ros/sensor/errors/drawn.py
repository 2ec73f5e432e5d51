# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Constants of a unit that its seed draws: what a data sheet gives as a tolerance."""

import dataclasses
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import ImuParameters
from imu_sim_ros.random_streams import axis_generators
from imu_sim_ros.sensor.errors.deterministic import scale_misalignment
from imu_sim_ros.sensor.errors.noise import axis_values

Array = NDArray[np.float64]

_KINDS: Final = (
    ("temperature_bias", 1),
    ("temperature_scale", 1),
    ("misalignment", 2),
    ("quadratic", 1),
    ("g_sensitivity", 3),
)
"""Names with the numbers that are drawn for each axis."""


def unit_of_seed(imu: ImuParameters, triad: str, seed: int) -> ImuParameters:
    """Return the IMU with the drawn part of each constant added to it and nothing left to draw.

    Temperature coefficients, cross-axis terms, non-linearity and g-sensitivity; the turn-on bias
    and scale, which differ from run to run, are :class:`TurnOn`'s. Each constant has a stream of
    its own per axis, so that one more of them changes no other.

    :param triad: whose constants are drawn.
    """
    changed: dict[str, Any] = {}
    for kind, count in _KINDS:
        name = f"{triad}_{kind}_sigma"
        sigma = getattr(imu, name, (0.0,))
        if any(sigma):
            streams = axis_generators(seed, f"{triad}.{kind}")
            drawn = np.array([s.standard_normal(count) for s in streams]) * np.array(sigma)[:, None]
            changed.update(_added(imu, triad, kind, drawn))
            changed[name] = np.zeros(3)
    if not changed:
        return imu
    values: dict[str, Any] = {n: tuple(np.ravel(v).tolist()) for n, v in changed.items()}
    return dataclasses.replace(imu, **values)


def _added(imu: ImuParameters, triad: str, kind: str, drawn: Array) -> dict[str, Array]:
    """Return the parameters that hold a constant, with the drawn numbers (3, count) added."""
    if kind == "misalignment":
        matrix = scale_misalignment(imu, triad)
        matrix[~np.eye(3, dtype=bool)] += drawn.ravel()
        return {
            f"{triad}_scale_misalignment": matrix,
            f"{triad}_scale_error_percent": np.zeros(3),
            f"{triad}_misalignment_percent": np.zeros(6),
        }
    name = f"{triad}_{kind}"
    value = axis_values(imu, triad, kind)
    if kind.startswith("temperature") and not len(value):
        value = np.zeros(3)
    result = value.copy()
    result[: drawn.size] += drawn.ravel()
    return {name: result}
