# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of a magnetometer that is turned all around: its readings lie on an ellipsoid.

``y = S B + b + n`` with ``|B| = F`` wherever the sensor points: ``|S^-1 (y - b)| = F``. A rotation
of all axes changes no norm, so S is chosen symmetric: it is the root of ``M M^T``, M being soft
iron, scales and misalignment together. Nine parameters, by least squares of the norms
weighted with their standard errors (P. D. Groves, "Principles of GNSS, Inertial, and Multisensor
Integrated Navigation Systems", 2nd ed., section 6.1.2; D. Gebre-Egziabher et al., "Calibration of
Strapdown Magnetometers in Magnetic Field Domain", J. Aerosp. Eng. 19 (2006) 87).
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import gate
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array

PARAMETERS: Final = 9
"""Number of parameters of an ellipsoid: centre and symmetric matrix."""
_ROWS: Final = np.array([0, 0, 0, 1, 1, 2])
_COLUMNS: Final = np.array([0, 1, 2, 1, 2, 2])
_STEPS: Final = 50
"""Largest number of reweighted fits."""
_CONVERGED: Final = 1e-13
"""Relative change of the parameters of a converged fit."""
_ROUNDING: Final = 1e-6
"""Largest last step of a converged fit: larger ones are not rounding."""
_DEPENDENT: Final = 1e-3
"""Ratio of singular values below which directions do not determine the parameters."""


class Ellipsoid(NamedTuple):
    """A magnetometer's parameters."""

    soft_iron: Array
    """(3, 3) S, symmetric and positive."""
    soft_iron_sigma: Array
    """(3, 3) standard errors."""
    hard_iron: Array
    """(3,) b [T]."""
    hard_iron_sigma: Array
    """(3,) standard errors [T]."""
    field: float
    """Field strength F: given, or such that S has the determinant 1 [T]."""
    residuals: Array
    """(n,) ``|S^-1 (y - b)| - F`` [T]."""
    noise: float
    """Standard deviation of a reading per axis, from the residuals [T]."""


def calibrate_magnetometer(readings: Array, field: float | None = None) -> Ellipsoid:
    """Return the ellipsoid of readings (n, 3) [T] with the standard errors of its parameters.

    The errors of the readings are assumed white, and equal on all axes.

    :param field: the field's true strength [T]; None: not known, S then has the determinant 1.
    :raises InputError: if the readings do not determine the parameters.
    """
    if len(readings) <= PARAMETERS:
        raise InputError(f"{len(readings)} readings of the magnetometer: needs more than 9")
    gate.Verdict(None, [(gate.FIELD, readings)]).complain("magnetometer")
    size = float(np.sqrt(np.mean(np.square(readings - readings.mean(axis=0)).sum(axis=1))))
    if size <= 1e-12 * float(np.abs(readings).max()):
        raise InputError("magnetometer: the readings are all the same")
    # In units of the readings' spread: the numbers are of order 1.
    y = readings / size
    inverse, bias = _algebraic(y)
    if inverse is None:
        raise InputError(
            "magnetometer: the readings do not determine an ellipsoid: turn the sensor all around"
        )
    variance = 0.0
    for _ in range(_STEPS):
        fit = _Step(y, inverse, bias, variance)
        inverse, bias = fit.inverse, fit.bias
        variance, previous = fit.variance, variance
        if fit.change < _CONVERGED and abs(variance - previous) <= 1e-9 * variance + 1e-30:
            break
    if not fit.change < _ROUNDING:
        raise InputError("magnetometer: the fit of an ellipsoid does not converge")
    return _summary(y, inverse, bias, variance, size, field)


def _algebraic(y: Array) -> tuple[Array | None, Array]:
    """Return T (3, 3) with ``|T (y - b)| = 1`` roughly, and b; None if it is not an ellipsoid.

    The quadric ``y^T A y + 2 c^T y = 1`` by linear least squares.
    """
    design = np.column_stack(
        [y[:, _ROWS] * y[:, _COLUMNS] * np.where(_ROWS == _COLUMNS, 1.0, 2.0), 2.0 * y]
    )
    lengths = np.linalg.norm(design, axis=0)
    centre = np.zeros(3)
    if (lengths == 0.0).any():
        return None, centre
    scaled = design / lengths
    singular = np.linalg.svd(scaled, compute_uv=False)
    if singular[-1] < _DEPENDENT * singular[0]:
        return None, centre
    solution = np.linalg.lstsq(design, np.ones(len(y)), rcond=None)[0]
    a = np.zeros((3, 3))
    a[_ROWS, _COLUMNS] = a[_COLUMNS, _ROWS] = solution[:6]
    centre = -np.linalg.solve(a, solution[6:])
    shape = a / (1.0 + centre @ a @ centre)
    values, vectors = np.linalg.eigh(shape)
    if values[0] <= 0.0:
        return None, centre
    return vectors @ np.diag(np.sqrt(values)) @ vectors.T, centre


class _Step:
    """One Gauss-Newton step of the fit of ``|T (y - b)| = 1`` to readings y.

    T is the inverse of the soft iron S, and b the bias; the strength of the field is 1.
    """

    def __init__(self, y: Array, inverse: Array, bias: Array, variance: float) -> None:
        """Compute the step, and the residuals before it.

        :param y: (n, 3) readings over the strength of the field.
        :param inverse: (3, 3) T before the step, symmetric.
        :param bias: (3,) b before the step.
        :param variance: variance of a reading.
        """
        centred = y - bias
        force = centred @ inverse.T
        norms = np.linalg.norm(force, axis=1)
        slope = (force @ inverse) / norms[:, None]
        squared = np.sum(slope * slope, axis=1)
        # Noise across a vector lengthens it by half its variance over the length.
        excess = 0.5 * variance * (np.sum(inverse * inverse) - squared) / norms
        self.residuals = norms - 1.0 - excess
        by_matrix = force[:, _ROWS] * centred[:, _COLUMNS]
        mixed = _ROWS != _COLUMNS
        by_matrix[:, mixed] += force[:, _COLUMNS[mixed]] * centred[:, _ROWS[mixed]]
        jacobian = np.column_stack([by_matrix / norms[:, None], -slope])
        weight = 1.0 / np.sqrt(squared)
        self.jacobian = jacobian * weight[:, None]
        whitened = self.residuals * weight
        step = np.linalg.lstsq(self.jacobian, -whitened, rcond=None)[0]
        self.inverse, self.bias = inverse + _symmetric(step[:6]), bias + step[6:]
        self.change = float(np.abs(step).max())
        remainder = whitened + self.jacobian @ step
        self.variance = float(remainder @ remainder) / (len(y) - PARAMETERS)


def _symmetric(entries: Array) -> Array:
    """Return the symmetric matrix (3, 3) of its six different entries."""
    matrix = np.zeros((3, 3))
    matrix[_ROWS, _COLUMNS] = matrix[_COLUMNS, _ROWS] = entries
    return matrix


def _summary(
    y: Array, inverse: Array, bias: Array, variance: float, size: float, field: float | None
) -> Ellipsoid:
    """Return the result in SI units.

    :param y: (n, 3) readings over ``size``.
    :param inverse: (3, 3) fitted T, the inverse of S.
    :param bias: (3,) fitted bias over ``size``.
    :param variance: variance of a reading over ``size`` squared.
    :param size: scale of the readings [T].
    :param field: strength of the field [T]; None: it follows from a determinant of S of 1.
    """
    fit = _Step(y, inverse, bias, variance)
    covariance = variance * np.linalg.inv(fit.jacobian.T @ fit.jacobian)
    shape: Array = np.linalg.inv(inverse).astype(np.float64)
    # dS = -S dT S for each entry of T.
    change = np.stack([-shape @ _symmetric(e) @ shape for e in np.eye(6)])
    if field is None:
        scale = float(np.cbrt(np.linalg.det(shape)))
        by_scale = np.array([np.trace(inverse @ c) for c in change]) / 3.0
        change = (change - by_scale[:, None, None] * shape) / scale
        field = scale * size
    else:
        scale = field / size
        change = change / scale
    spread = np.einsum("aij,ab,bij->ij", change, covariance[:6, :6], change)
    return Ellipsoid(
        soft_iron=shape / scale,
        soft_iron_sigma=np.sqrt(np.maximum(spread, 0.0)),
        hard_iron=bias * size,
        hard_iron_sigma=np.sqrt(np.diag(covariance)[6:]) * size,
        field=field,
        residuals=fit.residuals * field,
        noise=float(np.sqrt(variance)) * size,
    )


def symmetric_root(response: Array) -> Array:
    """Return the symmetric S (3, 3) of a response M: the root of ``M M^T``."""
    values, vectors = np.linalg.eigh(response @ response.T)
    return vectors @ np.diag(np.sqrt(values)) @ vectors.T
