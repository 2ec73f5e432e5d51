# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rate and acceleration of a turn ``Exp(phi(t))`` from its rotation vector's derivatives."""

import numpy as np

from imu_sim_ros.types import Array

_SMALL = 0.1
"""[rad] below this the series are used; what they leave out is below 1e-13."""


def rate_and_acceleration(phi: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """Return omega and alpha (n, 3) of ``R = Exp(phi)``, in the axes that are turned.

    ``omega = Jr(phi) phi'`` with ``Jr = I - b [phi] + c [phi]^2``, ``b = (1 - cos t) / t^2``,
    ``c = (t - sin t) / t^3`` and ``t = |phi|`` (Chirikjian, "Stochastic models, information theory,
    and Lie groups", vol. 2, eq. 10.86); alpha is its derivative, term by term.

    :param phi: (n, 3) rotation vectors [rad].
    :param first: (n, 3) their first derivatives [rad/s].
    :param second: (n, 3) their second derivatives [rad/s^2].
    """
    angle = np.linalg.norm(phi, axis=-1)
    b, c, b_slope, c_slope = (value[:, None] for value in _coefficients(angle))
    growth = np.sum(phi * first, axis=-1, keepdims=True)  # t t'
    across = np.cross(phi, first)
    twice = np.cross(phi, across)
    omega: Array = first - b * across + c * twice
    turned = np.cross(phi, second)
    alpha: Array = second - b * turned - b_slope * growth * across + c_slope * growth * twice
    alpha += c * (np.cross(first, across) + np.cross(phi, turned))
    return omega, alpha


def _coefficients(angle: Array) -> tuple[Array, Array, Array, Array]:
    """Return b, c, and their slopes over the angle, db/dt / t and dc/dt / t, each (n,)."""
    square = angle * angle
    series = (
        1 / 2 + square * (-1 / 24 + square * (1 / 720 - square / 40320)),
        1 / 6 + square * (-1 / 120 + square * (1 / 5040 - square / 362880)),
        -1 / 12 + square * (1 / 180 + square * (-1 / 6720 + square / 453600)),
        -1 / 60 + square * (1 / 1260 + square * (-1 / 60480 + square / 4989600)),
    )
    large = angle > _SMALL
    if not large.any():
        return series
    t = np.where(large, angle, 1.0)
    sine, cosine = np.sin(t), np.cos(t)
    closed = (
        (1.0 - cosine) / t**2,
        (t - sine) / t**3,
        (t * sine - 2.0 * (1.0 - cosine)) / t**4,
        (t * (1.0 - cosine) - 3.0 * (t - sine)) / t**5,
    )
    b, c, b_slope, c_slope = (
        np.where(large, whole, short) for whole, short in zip(closed, series, strict=True)
    )
    return b, c, b_slope, c_slope
