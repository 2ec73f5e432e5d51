# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The second order of a dead-reckoned state's errors, where a tilt is no longer small.

With u the error of the rate and a the specific force, both in the world, the attitude's error theta
obeys ``theta' = Jr(theta)^-1 u`` along the estimate. Its first order is the integral of u. To
second order

    theta2' = theta x u / 2
    v2'     = theta2 x a + theta x (theta x a) / 2 = theta2 x a + (Z - tr(Z) I) a / 2
    p2'     = v2                                     with Z = theta theta^T

(Sola, arXiv:1711.02508, eq. 144; the second term of Magnus' series). Along the truth all three
change sign, which no mean square shows. theta2 is the area that theta sweeps: where the body turns,
a constant bias leads theta round a circle and back to zero, and the area is what is left. v2 is the
force that a tilt shortens: with 2.7 degrees of tilt per axis, as the lecture's gyroscope has after
10 s, by 2 cm/s^2, and integrated this is more than the first order's sigma of the vertical.

All are integrals of quadratic forms of a normal state x: theta and the errors of the rate, of
covariance P. So mean m and covariance Y of ``y = (theta2, v2, p2)`` follow without approximation
from those of x, if ``C_k = Cov(y_k, x x^T)`` is carried as well. Over an interval, in which x
becomes ``F x + noise`` and y becomes ``L y + M q``, with quadratic forms ``q_i = g^T A_i g`` of
``g = (theta at the start, theta at the end)`` and ``G = E[g g^T]``, ``U = dg/dx``,
``K = E[x g^T]`` for the x of the end,

    Cov(q_i, q_j) = 2 tr(A_i G A_j G),   Cov(y_k, q_i) = tr(A_i U C_k U^T),
    C_k <- sum_l L_kl F C_l F^T + sum_i M_ki 2 K A_i K^T

(moments of normal variables: Isserlis 1918).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.navigation.comparison import attitude_sigma

Array = NDArray[np.float64]

_SIZE: Final = 9
_EYE: Final = np.eye(3)
_CROSS: Final = 0.5 * rotation.skew(_EYE)
"""(3, 3, 3): row k of ``theta x theta' / 2`` is ``-theta^T _CROSS[k] theta'``."""


class SecondOrder:
    """Mean and covariance of the second-order errors of attitude, velocity and position."""

    def __init__(self, rates: int) -> None:
        """Start with no error.

        :param rates: r, how many errors of the rate the state x has beside theta.
        """
        n = 3 + rates
        self.largest_sigma = 0.0
        """[rad] of the attitude, along its worst axis, so far."""
        self._mean, self._covariance = np.zeros(_SIZE), np.zeros((_SIZE, _SIZE))
        self._with_state = np.zeros((_SIZE, n, n))
        self._forms = np.zeros((_SIZE, 6, 6))
        self._forms[:3, :3, 3:] = -0.5 * _CROSS
        self._forms[:3, 3:, :3] = 0.5 * _CROSS

    def step(
        self,
        h: float,
        acceleration: Array,
        before: Array,
        after: Array,
        by_rates: Array,
        decay: Array,
    ) -> None:
        """Propagate over an interval.

        :param h: its length [s].
        :param acceleration: (3,) mean specific force, in the world [m/s^2].
        :param before: (n, n) covariance of x at the start.
        :param after: (n, n) at the end.
        :param by_rates: (3, r) how theta at the end depends on the errors of the rate at the start.
        :param decay: (r,) what is left at the end of the errors of the rate at the start.
        """
        theta = slice(0, 3)
        self.largest_sigma = max(self.largest_sigma, float(attitude_sigma(after[theta, theta])))
        forms = self._forms
        forms[3:6, theta, theta] = forms[6:, 3:, 3:] = _shortening(acceleration)
        at_end = _carried(before[:, theta], by_rates, decay)  # E[x theta^T], x at the end
        k = np.concatenate([at_end, after[:, theta]], axis=1)
        g = np.block(
            [[before[theta, theta], at_end[theta].T], [at_end[theta], after[theta, theta]]]
        )
        weighed = forms @ g
        own = 2.0 * np.einsum("iab,jba->ij", weighed, weighed)
        keep, gain = _transition(h, acceleration)
        c = self._with_state
        u = np.concatenate([np.eye(len(before))[theta], np.eye(len(before))[theta]])
        u[3:, 3:] = by_rates
        shared = np.einsum("iab,kab->ki", forms, u @ c @ u.T)
        crossed = keep @ shared @ gain.T
        y = keep @ self._covariance @ keep.T + crossed + crossed.T + gain @ own @ gain.T
        self._covariance = y
        self._mean = keep @ self._mean + gain @ weighed.trace(axis1=1, axis2=2)
        c = _carried(_carried(c, by_rates, decay).swapaxes(1, 2), by_rates, decay)
        c = np.tensordot(keep, c, 1) + np.tensordot(gain, 2.0 * (k @ forms @ k.T), 1)
        self._with_state = c

    def mean_square(self) -> Array:
        """Return (9, 9): the mean square of the errors of attitude, velocity and position."""
        result: Array = self._covariance + np.outer(self._mean, self._mean)
        return result


def _shortening(a: Array) -> Array:
    """Return (3, 3, 3): row k of ``(Z - tr(Z) I) a / 2`` is ``theta^T _[k] theta``."""
    along = _EYE[:, :, None] * a
    result: Array = 0.25 * (along + along.swapaxes(1, 2)) - 0.5 * a[:, None, None] * _EYE
    return result


def _transition(h: float, a: Array) -> tuple[Array, Array]:
    """Return L and M (9, 9) of an interval, by the trapezoid of its ends.

    The forms are: what theta2 gains, and what shortens the force at the start and at the end.
    """
    tilted = -h * rotation.skew(a)  # theta2 x a h
    keep, gain = np.eye(_SIZE), np.zeros((_SIZE, _SIZE))
    keep[3:6, :3], gain[:3, :3], gain[3:6, :3] = tilted, _EYE, 0.5 * tilted
    gain[3:6, 3:6] = gain[3:6, 6:] = 0.5 * h * _EYE
    keep[6:, :3], keep[6:, 3:6], gain[6:] = 0.5 * h * tilted, h * _EYE, 0.5 * h * gain[3:6]
    return keep, gain


def _carried(rows: Array, by_rates: Array, decay: Array) -> Array:
    """Return ``F rows`` for rows (..., n, k): theta gains from the rates, the rates decay."""
    theta, rates = rows[..., :3, :], rows[..., 3:, :]
    return np.concatenate([theta + by_rates @ rates, decay[:, None] * rates], axis=-2)
