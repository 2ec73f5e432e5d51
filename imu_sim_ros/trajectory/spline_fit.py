# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Least-squares control points of a pose spline near recorded poses.

Minimised is ``sum |p_i - s(t_i)|^2 + lambda sum |third difference of the control points|^2``, a
P-spline (Eilers and Marx, "Flexible smoothing with B-splines and penalties", 1996); third
differences over h^3 stand for the third derivative, so gaps are bridged with the least jerk. On
SO(3) the same system is solved for small turns of the control rotations until they vanish
(Gauss-Newton; the increments between control rotations take the place of first differences).
"""

from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array, Integers
from imu_sim_ros.trajectory.bspline import BASIS, ORDER, PoseSpline, RotationSpline, UniformKnots

_ITERATIONS: Final = 30
"""Largest number of Gauss-Newton steps."""
_CONVERGED: Final = 1e-10  # rad
_REWEIGHTINGS: Final = 30
"""Largest number of reweighted fits."""
_SETTLED: Final = 1e-3
"""Largest change of a weight at which reweighting stops."""
_DIFFERENCE: Final = (-1.0, 3.0, -3.0, 1.0)
"""Factors of a third difference."""


class LeastSquares:
    """The linear system of one set of times and knots; its matrix is factored once."""

    def __init__(
        self, t: Array, knots: UniformKnots, cutoff: float, trust: Array | None = None
    ) -> None:
        """Set up and factor the normal equations.

        :param t: (n,) times [s] in [0, duration].
        :param cutoff: frequency [Hz] above which motion is smoothed away: where data are dense,
            the fit is a filter of gain ``1 / (1 + (f / cutoff)^6)``. At most ``1 / spacing``
            acts: below that the knots smooth, and a penalty too small leaves gaps undetermined.
        :param trust: (n,) factor of each pose's squared distance; None: all 1.
        """
        self._knots = knots
        segment, u = knots.locate(t)
        powers = u[:, None] ** np.arange(ORDER)
        self._columns = segment[:, None] + np.arange(ORDER)
        self._basis: Array = powers @ BASIS.T
        self._weighted = self._basis if trust is None else self._basis * trust[:, None]
        self._penalty = self._penalty_rows(t, segment, cutoff)
        from scipy.linalg import cholesky_banded  # most trajectories fit nothing

        self._factor = cholesky_banded(self._normal_matrix(), lower=True)

    def _penalty_rows(self, t: Array, segment: Integers, cutoff: float) -> Array:
        """Return lambda (c - 3,) of each third difference; more if there are no data.

        A continuous filter of the given cut-off has ``lambda = rate / (2 pi cutoff)^6`` times the
        squared third derivative; the difference form has h^-5 in its place. In a gap nothing but
        the penalty acts: its size does not matter there, and a large one keeps more digits.
        """
        h = self._knots.spacing
        rate = 1.0 / float(np.median(np.diff(t)))
        dense = rate * h / (2.0 * np.pi * min(cutoff * h, 1.0)) ** ORDER
        filled = np.bincount(segment, minlength=self._knots.segments) > 0
        covered = np.zeros(self._knots.control_points, dtype=bool)
        for k in range(ORDER):
            covered[k : k + len(filled)] |= filled
        touched = covered[:-3] | covered[1:-2] | covered[2:-1] | covered[3:]
        return np.where(touched, dense, max(dense, rate * h))

    def _normal_matrix(self) -> Array:
        """Return ``B^T B + D^T lambda D`` in SciPy's lower banded form (6, c)."""
        c = self._knots.control_points
        bands = np.zeros((ORDER, c))
        for i in range(ORDER):
            for j in range(i + 1):
                product = self._weighted[:, i] * self._basis[:, j]
                bands[i - j] += np.bincount(self._columns[:, j], product, minlength=c)
        for i, a in enumerate(_DIFFERENCE):
            for j, b in enumerate(_DIFFERENCE[: i + 1]):
                bands[i - j, j : j + c - 3] += a * b * self._penalty
        return bands

    def solve(self, data: Array, bend: Array | None = None) -> Array:
        """Return control points (c, 3) nearest to data (n, 3).

        :param bend: (c - 3, 3) third differences that the control points already have.
        """
        c = self._knots.control_points
        target = np.zeros((c, data.shape[1]))
        for axis in range(data.shape[1]):
            products = self._weighted * data[:, axis, None]
            target[:, axis] = np.bincount(self._columns.ravel(), products.ravel(), minlength=c)
        if bend is not None:
            for i, a in enumerate(_DIFFERENCE):
                target[i : i + c - 3] -= a * self._penalty[:, None] * bend
        from scipy.linalg import cho_solve_banded

        return cho_solve_banded((self._factor, True), target)

    def evaluate(self, points: Array) -> Array:
        """Return the spline (n, 3) of control points (c, 3) at the times."""
        return np.sum(self._basis[..., None] * points[self._columns], axis=1)


def fit(
    t: Array,
    position: Array,
    q_wb: Array,
    knots: UniformKnots,
    cutoff: float,
    outlier_distance: float = 0.0,
) -> PoseSpline:
    """Return the spline near the poses.

    :param t: (n,) times [s], increasing from 0 to the knots' duration.
    :param position: (n, 3) positions [m].
    :param q_wb: (n, 4) unit quaternions, of any sign.
    :param cutoff: see :class:`LeastSquares` [Hz].
    :param outlier_distance: poses at this distance [m] from the spline count half, farther ones
        less; 0: all count alike.
    """
    # About the first position: coordinates of a large map would cost digits.
    origin = position[0]
    system = LeastSquares(t, knots, cutoff)
    points = system.solve(position - origin)
    if outlier_distance > 0.0:
        system, points = _reject_outliers(t, position - origin, knots, cutoff, outlier_distance)
    return PoseSpline(knots, points + origin, _fit_rotation(system, t, q_wb, knots))


def _reject_outliers(
    t: Array, position: Array, knots: UniformKnots, cutoff: float, distance: float
) -> tuple[LeastSquares, Array]:
    """Return the system in which outliers count little, and the control points it gives.

    Weights ``1 / (1 + (e / distance)^2)`` of the distances e, again and again (the Cauchy loss by
    iteratively reweighted least squares).

    :param t: (n,) times of the positions [s].
    :param position: (n, 3) positions [m].
    :param cutoff: frequency above which the spline is smooth [Hz].
    :param distance: distance e at which a position has half its weight [m].
    """
    trust = np.ones(len(t))
    for _ in range(_REWEIGHTINGS):
        system = LeastSquares(t, knots, cutoff, trust)
        points = system.solve(position)
        squared = np.sum((system.evaluate(points) - position) ** 2, axis=-1)
        previous, trust = trust, 1.0 / (1.0 + squared / distance**2)
        if np.max(np.abs(trust - previous)) < _SETTLED:
            break
    return system, points


def _fit_rotation(system: LeastSquares, t: Array, q_wb: Array, knots: UniformKnots) -> Array:
    """Return control rotations (c, 4) near the attitudes."""
    controls = _first_controls(t, q_wb, knots)
    segment, u = knots.locate(t)
    for _ in range(_ITERATIONS):
        fitted = RotationSpline(knots, controls).attitude(segment, u)
        residual = rotation.log(rotation.multiply(rotation.conjugate(fitted), q_wb))
        steps = rotation.log(rotation.multiply(rotation.conjugate(controls[:-1]), controls[1:]))
        turn = system.solve(residual, bend=np.diff(steps, n=2, axis=0))
        controls = rotation.multiply(controls, rotation.exp(turn))
        if np.max(np.abs(turn)) < _CONVERGED:
            break
    return rotation.normalise(controls)


def _first_controls(t: Array, q_wb: Array, knots: UniformKnots) -> Array:
    """Return the given attitudes, interpolated at the control points' own times."""
    times = (np.arange(knots.control_points) - (ORDER / 2 - 1)) * knots.spacing
    q = rotation.unwrap_signs(q_wb)
    return rotation.normalise(np.column_stack([np.interp(times, t, q[:, k]) for k in range(4)]))
