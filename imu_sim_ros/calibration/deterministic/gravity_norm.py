# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of an accelerometer at rest in any positions: its input has the norm of gravity.

``| T (y - b) | = g`` for the mean reading y of every rest (Skog and Haendel, "Calibration of a MEMS
inertial measurement unit", IMEKO 2006; Tedaldi, Pretto and Menegatti, "A robust and easy to
implement method for IMU calibration without external equipments", ICRA 2014). A rotation of all
axes changes no norm, so the axes are chosen such that ``T = S^-1`` and S are upper triangular: z is
the direction of the sensor's z axis. Nine parameters, which rests in ten directions determine.
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.deterministic.response import (
    Observations,
    likely_whitener,
    rounding_error,
)
from imu_sim_ros.calibration.deterministic.steady import Steady
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array

PARAMETERS: Final = 9
"""Number of parameters: bias and upper triangular matrix."""
_ROWS: Final = np.array([0, 0, 0, 1, 1, 2])
_COLUMNS: Final = np.array([0, 1, 2, 1, 2, 2])
_STEPS: Final = 30
"""Largest number of Gauss-Newton steps."""
_CONVERGED: Final = 1e-12
"""Last change over gravity of a converged fit."""
_SAME_DIRECTION: Final = float(np.cos(np.radians(0.5)))
"""Cosine of the smallest angle between two different directions."""
_DEPENDENT: Final = 1e-4
"""Ratio of singular values below which rests do not determine the parameters."""


class NormFit(NamedTuple):
    """An accelerometer's parameters from the norm of gravity."""

    scale_misalignment: Array
    """(3, 3) S, upper triangular."""
    scale_misalignment_sigma: Array
    """(3, 3); 0 below the diagonal, which is 0 by the choice of axes."""
    bias: Array
    """(3,) bias at the start of the record [m/s^2]."""
    bias_sigma: Array
    """(3,) standard errors."""
    force: Array
    """(m, 3) specific force in the axes chosen, of length g [m/s^2]."""
    misfit: float
    """Sum of squares of the norms' residuals, in standard errors of the readings."""


def directions(accel: Array) -> int:
    """Return the number of directions, half a degree apart, of readings (m, 3) at rest."""
    distinct: list[Array] = []
    for direction in accel / np.linalg.norm(accel, axis=1, keepdims=True):
        if all(float(direction @ representative) < _SAME_DIRECTION for representative in distinct):
            distinct.append(direction)
    return len(distinct)


def is_determined(accel: Array) -> bool:
    """Return whether mean readings (m, 3) determine nine parameters."""
    if len(accel) <= PARAMETERS or directions(accel) <= PARAMETERS:
        return False
    jacobian = _jacobian(np.eye(3), accel, np.linalg.norm(accel, axis=1))
    singular = np.linalg.svd(jacobian / np.linalg.norm(jacobian, axis=0), compute_uv=False)
    return bool(singular[-1] > _DEPENDENT * singular[0])


def fit_norm(steady: Steady, gravity: float) -> NormFit:
    """Return the nine parameters by weighted least squares of the norms.

    The readings' errors are their noise and a bias that walks, as in
    :func:`~imu_sim_ros.calibration.deterministic.response.fit_axis`; standard errors are widened by
    the square root of the residuals' chi-square if that is above one.

    :param steady: m rests in ten directions or more.
    :param gravity: magnitude of gravity [m/s^2].
    :raises InputError: if the rests do not determine the parameters.
    """
    if not is_determined(steady.accel):
        raise InputError(
            f"{directions(steady.accel)} directions at rest: the norm of gravity needs "
            f"{PARAMETERS + 1} or more, half a degree apart and all around"
        )
    inverse, bias = np.eye(3), np.zeros(3)
    for _ in range(_STEPS):
        inverse, bias, change = _gauss_newton_step(inverse, bias, steady, gravity)
        if change < _CONVERGED * gravity:
            break
    return _summary(inverse, bias, steady, gravity)


def _gauss_newton_step(
    inverse: Array, bias: Array, steady: Steady, gravity: float
) -> tuple[Array, Array, float]:
    """Return T and b after one Gauss-Newton step of ``|T (y - b)| = g``, and its largest change.

    :param inverse: (3, 3) T before the step.
    :param bias: (3,) b before the step [m/s^2].
    :param gravity: magnitude g of gravity [m/s^2].
    """
    centred = steady.accel - bias
    norms = np.linalg.norm(centred @ inverse.T, axis=1)
    sigma = _norm_sigma(inverse, centred, norms, steady)
    jacobian = _jacobian(inverse, centred, norms)
    step = np.linalg.lstsq(jacobian / sigma[:, None], (gravity - norms) / sigma, rcond=None)[0]
    moved = inverse.copy()
    moved[_ROWS, _COLUMNS] += step[:6]
    return moved, bias + step[6:], float(np.abs(step).max())


def _jacobian(inverse: Array, centred: Array, norms: Array) -> Array:
    """Return (m, 9) the derivatives of the norms by the entries of T and by b."""
    force = centred @ inverse.T
    by_matrix = force[:, _ROWS] * centred[:, _COLUMNS] / norms[:, None]
    by_bias = -(force @ inverse) / norms[:, None]
    return np.column_stack([by_matrix, by_bias])


def _norm_sigma(inverse: Array, centred: Array, norms: Array, steady: Steady) -> Array:
    """Return (m,) the standard errors of the norms by those of the readings."""
    slope = (centred @ inverse.T) @ inverse / norms[:, None]
    variance = np.sum(np.square(slope * steady.accel_sigma), axis=1)
    return np.sqrt(np.maximum(variance, rounding_error(steady.accel) ** 2))


def _summary(inverse: Array, bias: Array, steady: Steady, gravity: float) -> NormFit:
    """Return the parameters with standard errors, after a last step with the walk of the bias.

    :param inverse: (3, 3) T, the inverse of S.
    :param bias: (3,) b [m/s^2].
    :param gravity: magnitude of gravity [m/s^2].
    """
    centred = steady.accel - bias
    force = centred @ inverse.T
    norms = np.linalg.norm(force, axis=1)
    sigma = _norm_sigma(inverse, centred, norms, steady)
    jacobian = _jacobian(inverse, centred, norms)
    residuals = gravity - norms
    # A walk of the bias acts along the direction of each rest.
    slope = force @ inverse / norms[:, None]
    data = Observations(
        inputs=jacobian,
        readings=residuals,
        sigma=sigma,
        time=steady.time,
        temperature=np.zeros(len(residuals)),
    )
    weight = likely_whitener(data, jacobian, slope @ slope.T)
    whitened = weight @ jacobian
    change = np.linalg.lstsq(whitened, weight @ residuals, rcond=None)[0]
    inverse = inverse.copy()
    inverse[_ROWS, _COLUMNS] += change[:6]
    bias = bias + change[6:]
    remainder = weight @ (residuals - jacobian @ change)
    chi_square = float(remainder @ remainder) / max(len(residuals) - PARAMETERS, 1)
    covariance = np.linalg.pinv(whitened.T @ whitened) * max(chi_square, 1.0)
    scale: Array = np.linalg.inv(inverse).astype(np.float64)
    # dS = -S dT S, entry by entry of T.
    by_entry = -scale[:, _ROWS].T[:, :, None] * scale[_COLUMNS][:, None, :]  # (6, 3, 3)
    spread = np.einsum("aij,ab,bij->ij", by_entry, covariance[:6, :6], by_entry)
    force = (steady.accel - bias) @ inverse.T
    lengths = np.linalg.norm(force, axis=1, keepdims=True)
    plain = (lengths[:, 0] - gravity) / sigma
    return NormFit(
        scale_misalignment=scale,
        scale_misalignment_sigma=np.sqrt(np.maximum(np.triu(spread), 0.0)),
        bias=bias,
        bias_sigma=np.sqrt(np.diag(covariance)[6:]),
        force=force * (gravity / lengths),
        misfit=float(plain @ plain),
    )


def upper_triangular(scale_misalignment: Array) -> Array:
    """Return S (3, 3) in axes turned so that it is upper triangular, its diagonal positive.

    Any S is such a matrix times a rotation (an RQ decomposition): ``S a = U (Q a)``.
    """
    r: Array = np.asarray(np.linalg.qr(scale_misalignment[::-1].T, mode="r"))
    upper: Array = r.T[::-1, ::-1]
    return upper * np.sign(np.diag(upper))
