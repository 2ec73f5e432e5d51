# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Constants of a unit drawn from its seed: what a data sheet gives as a tolerance."""

import dataclasses
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import NO_CROSS_AXIS, ZERO_VECTOR, TriadParameters, Vector
from imu_sim_ros.random_streams import axis_generators

Array = NDArray[np.float64]


@lru_cache(maxsize=16)
def unit_of_seed(parameters: TriadParameters, triad: str, seed: int) -> TriadParameters:
    """Return the triad with the drawn part of each constant added and nothing left to draw.

    Temperature coefficients, cross-axis terms, non-linearity and g-sensitivity; the turn-on bias
    and scale, which differ from run to run, are :class:`TurnOn`'s. Each constant has a stream of
    its own per axis, so that adding one changes no other.

    :param triad: name of the triad, as in the streams' names.
    """
    p = parameters
    constants = {
        "temperature_bias": (p.temperature_bias, p.temperature_bias_sigma, 1),
        "temperature_scale": (p.temperature_scale, p.temperature_scale_sigma, 1),
        "quadratic": (p.quadratic, p.quadratic_sigma, 1),
        "g_sensitivity": (p.g_sensitivity, p.g_sensitivity_sigma, 3),
    }
    changed: dict[str, Any] = {}
    for kind, (value, sigma, count) in constants.items():
        if any(sigma):
            added = _drawn(seed, f"{triad}.{kind}", sigma, count)
            sums = np.array(value or ZERO_VECTOR)
            sums[: added.size] += added.ravel()
            changed |= {kind: tuple(sums.tolist()), f"{kind}_sigma": ZERO_VECTOR}
    if any(p.misalignment_sigma):
        matrix = p.response()
        added = _drawn(seed, f"{triad}.misalignment", p.misalignment_sigma, 2)
        matrix[~np.eye(3, dtype=bool)] += added.ravel()
        changed |= {**as_matrix(matrix), "misalignment_sigma": ZERO_VECTOR}
    return dataclasses.replace(p, **changed) if changed else p


def as_matrix(response: Array) -> dict[str, Any]:
    """Return the parameters that give S (3, 3) as a matrix, and no part of it in percent."""
    return {
        "scale_misalignment": tuple(np.ravel(response).tolist()),
        "scale_error_percent": ZERO_VECTOR,
        "misalignment_percent": NO_CROSS_AXIS,
    }


def _drawn(seed: int, name: str, sigma: Vector, count: int) -> Array:
    """Return count numbers for each axis (3, count)."""
    numbers = [stream.standard_normal(count) for stream in axis_generators(seed, name)]
    result: Array = np.array(numbers) * np.array(sigma)[:, None]
    return result
