# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Six-position calibration of an accelerometer (lecture eq. 6 and 7)."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.deterministic.response import AxisResponse, Observations, fit_axis
from imu_sim_ros.calibration.deterministic.steady import Steady
from imu_sim_ros.errors import InputError

Array = NDArray[np.float64]

FACES: Final = ("+x", "-x", "+y", "-y", "+z", "-z")
_ALIGNED: Final = float(np.cos(np.radians(20.0)))
"""Cosine of the largest angle between a face's axis and the measured force."""
_AT_REST: Final = 0.05
"""Largest difference from the usual gyroscope reading [rad/s]."""


class SixPosition(NamedTuple):
    """The accelerometer's deterministic errors, and the gyroscope's bias at rest."""

    scale_misalignment: Array
    """(3, 3) S of ``reading = S a + b``."""
    scale_misalignment_sigma: Array
    """(3, 3) standard errors; 0 where the simple variant assumes the entry."""
    bias: Array
    """(3,) at the start of the record [m/s^2]"""
    bias_sigma: Array
    """(3,)"""
    gyroscope_bias: Array
    """(3,) [rad/s] reading at rest, at the start (the Earth's rate is in it)."""
    gyroscope_bias_sigma: Array
    """(3,)"""
    positions: Steady
    """The m stretches that were used."""
    faces: NDArray[np.int64]
    """(m,) index into :data:`FACES`: which axis points up."""
    residuals: Array
    """(m, 3) reading minus model [m/s^2]."""
    left_out: int
    """Pieces that are not at rest, or not near any face."""


def calibrate_six_position(steady: Steady, gravity: float, *, simple: bool = False) -> SixPosition:
    """Return bias, scale and misalignment from rest with each axis up and down.

    :param steady: what was found in the record; more than six positions are welcome.
    :param gravity: its magnitude [m/s^2].
    :param simple: eq. 6, ``b = (up + down) / 2`` and ``S = (up - down) / 2g`` per axis, without
        misalignment; else the twelve parameters of eq. 7 by weighted least squares.
    :raises InputError: where a face is missing.
    """
    rest = np.linalg.norm(steady.gyro - np.median(steady.gyro, axis=0), axis=1) < (
        _AT_REST + 6.0 * np.linalg.norm(steady.gyro_sigma, axis=1)
    )
    faces, aligned = nearest_faces(steady.accel)
    used = rest & aligned
    positions, faces = steady.rows(used), faces[used]
    missing = [name for k, name in enumerate(FACES) if k not in faces]
    if missing:
        raise InputError(
            f"{6 - len(missing)} of 6 positions found; never up: {', '.join(missing)}. Each axis "
            "must rest pointing up and down, level to 20 degrees, 2 s or longer"
        )
    force = gravity * face_vectors(faces)
    axes = [_axis(positions, force, k, simple) for k in range(3)]
    gyro = [  # with the force as input, for a sensitivity to it is no bias
        fit_axis(observations(positions, force, positions.gyro, positions.gyro_sigma, k))
        for k in range(3)
    ]
    return SixPosition(
        np.array([_row(axis.gain, k, simple) for k, axis in enumerate(axes)]),
        np.array([_row(axis.gain_sigma, k, simple) for k, axis in enumerate(axes)]),
        np.array([axis.bias[0] for axis in axes]),
        np.array([axis.bias_sigma[0] for axis in axes]),
        np.array([axis.bias[0] for axis in gyro]),
        np.array([axis.bias_sigma[0] for axis in gyro]),
        positions,
        faces,
        _residuals(axes, faces, simple),
        int(np.count_nonzero(~used)),
    )


def nearest_faces(accel: Array) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return (m,) the face that points up, and whether it does so to 20 degrees."""
    direction = accel / np.maximum(np.linalg.norm(accel, axis=1, keepdims=True), 1e-12)
    axis = np.argmax(np.abs(direction), axis=1)
    along = np.take_along_axis(direction, axis[:, None], axis=1)[:, 0]
    return 2 * axis + (along < 0.0), np.abs(along) > _ALIGNED


def face_vectors(faces: NDArray[np.int64]) -> Array:
    """Return (m, 3) unit vectors of the faces."""
    result = np.zeros((len(faces), 3))
    result[np.arange(len(faces)), faces // 2] = 1.0 - 2.0 * (faces % 2)
    return result


def _axis(positions: Steady, force: Array, k: int, simple: bool) -> AxisResponse:
    """Fit one axis; the simple variant looks at its own two faces only."""
    if not simple:
        return fit_axis(observations(positions, force, positions.accel, positions.accel_sigma, k))
    own = np.abs(force[:, k]) > 0.0
    used, along = positions.rows(own), force[own, k : k + 1]
    return fit_axis(observations(used, along, used.accel, used.accel_sigma, k))


def observations(
    steady: Steady,
    inputs: Array,
    readings: Array,
    sigma: Array,
    axis: int,
    temperature: Array | None = None,
) -> Observations:
    """Return what one axis of a triad read, readings and sigma being (m, 3)."""
    t = np.zeros(len(inputs)) if temperature is None else temperature
    return Observations(inputs, readings[:, axis], sigma[:, axis], steady.time, t)


def _row(values: Array, k: int, simple: bool) -> Array:
    if not simple:
        return values
    row = np.zeros(3)
    row[k] = values[0]
    return row


def _residuals(axes: list[AxisResponse], faces: NDArray[np.int64], simple: bool) -> Array:
    """Return (m, 3) the residuals; the simple variant has none across an axis."""
    result = np.zeros((len(faces), 3))
    for k, axis in enumerate(axes):
        result[faces // 2 == k if simple else slice(None), k] = axis.residuals
    return result
