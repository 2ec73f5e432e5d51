# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Terms of a state's covariance from slow errors, large tilts and the rest at the start."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array
from imu_sim_ros.navigation.evaluation import attitude_sigma
from imu_sim_ros.sensors.imu.triads import TriadsParameters

_SHORTEST: Final = 0.1
"""Correlation time of the fastest process of the 1/f noise [s]; faster ones average out."""


class SlowErrors:
    """The vector a, its covariance C with the error of the state, and how it acts on readings."""

    def __init__(self, noise: TriadsParameters, size: int) -> None:
        """Start with errors that are uncorrelated with the state.

        :param noise: the IMU's errors.
        :param size: n, how many numbers the error of the state has; its last six are the biases.
        """
        entries, scales = noise.processes(_SHORTEST), noise.response_terms()
        axes = [axis for axis, _, _ in entries] + [axis for axis, _, _ in scales]
        self.count = len(axes)
        """m"""
        times = [tau for _, tau, _ in entries] + [np.inf] * len(scales)
        self._decay_rate = -1.0 / np.array(times)
        self.cross = np.zeros((size, self.count))
        """(n, m) C"""
        self._in_state = np.zeros((size, self.count))
        """(n, m) H at the biases' places in the state, zero elsewhere"""
        self.effect = self._in_state[-6:]
        """(6, m) H, gyroscope first; a scale's entry is that of the latest reading."""
        sigmas = [sigma for _, _, sigma in entries]
        self.effect[axes[: len(entries)], np.arange(len(entries))] = sigmas
        columns = np.arange(len(entries), self.count, dtype=np.intp)
        self._scale_entries = (
            np.array([axis for axis, _, _ in scales], np.intp) * self.count + columns
        )
        self._scale_inputs = np.array([source for _, source, _ in scales], dtype=np.intp)
        self._scale_sigmas = np.array([sigma for _, _, sigma in scales])
        self.of_rate = np.flatnonzero(np.array(axes, dtype=np.intp) < 3)
        """Places in a of the gyroscope's errors."""
        self.gain = self._in_state
        """(n, m) G H of the latest step."""
        self._h, self._decay = 0.0, np.ones(self.count)

    def __bool__(self) -> bool:
        """Return whether there is any such error."""
        return self.count > 0

    def step(
        self,
        h: float,
        transition: Array,
        by_bias: Array,
        rate_b: Array | Sequence[float],
        force_b: Array | Sequence[float],
    ) -> Array:
        """Propagate over an interval of length h [s]; return half of what it adds to P.

        :param transition: (n, n) F.
        :param by_bias: (n, n) whose last six columns are G; the others do not matter.
        :param rate_b: (3,) corrected rate in the interval, in the body [rad/s].
        :param force_b: (3,) corrected specific force [m/s^2].
        :returns: (n, n); with its transpose it is the whole.
        """
        if h != self._h:
            self._h, self._decay = h, self.decay(h)
        self.act_on(rate_b, force_b)
        self.gain = gain = by_bias.dot(self._in_state)
        half = 0.5 * gain
        passed: Array = transition.dot(self.cross)
        passed += half
        covariance: Array = passed.dot(gain.T)
        passed += half
        passed *= self._decay
        self.cross = passed
        return covariance

    def over(self, time: float) -> tuple[Array, Array]:
        """Return :func:`of_mean` (m,) of a time [s]."""
        return mean_factors(-self._decay_rate * time)

    def decay(self, time: float) -> Array:
        """Return the remaining share of each after a time [s] (m,)."""
        return np.exp(self._decay_rate * time)

    def act_on(self, rate_b: Array | Sequence[float], force_b: Array | Sequence[float]) -> None:
        """Let the scales act on a reading."""
        if len(self._scale_entries):
            inputs = np.array([*rate_b, *force_b] * 2)
            inputs[6:] *= inputs[6:]
            self.effect.reshape(-1)[self._scale_entries] = (
                inputs.take(self._scale_inputs) * self._scale_sigmas
            )

    def bias(self) -> Array:
        """Return (n, n); with its transpose it is what H a, added to the biases, adds to P."""
        return (self.cross + 0.5 * self._in_state).dot(self._in_state.T)


def mean_factors(u: Array) -> tuple[Array, Array]:
    """Return the variance of a process' mean over a time, and its covariance with the end.

    ``2 (u - 1 + exp(-u)) / u^2`` and ``(1 - exp(-u)) / u``, of a process of unit variance.

    :param u: the time over the correlation time, of any shape.
    """
    small, u = u, np.maximum(u, 1e-5)  # below, the series: to 1e-11
    gone = -np.expm1(-u)
    short = small < 1e-5
    mean = np.where(short, 1.0 - small / 3.0, 2.0 * (u - gone) / u**2)
    return mean, np.where(short, 1.0 - 0.5 * small, gone / u)


_SIZE: Final = 9
_EYE: Final = np.eye(3)
_CROSS: Final = 0.5 * rotation.skew(_EYE)
"""(3, 3, 3): row k of ``theta x theta' / 2`` is ``-theta^T _CROSS[k] theta'``."""


class SecondOrder:
    """Mean and covariance of the second-order errors of attitude, velocity and position."""

    def __init__(self, rates: int) -> None:
        """Start with no error.

        :param rates: r, how many errors of the rate the state x has in addition to theta.
        """
        n = 3 + rates
        self.largest_sigma = 0.0
        """Largest standard deviation of the attitude so far, along its worst axis [rad]."""
        self.mean_square = np.zeros((_SIZE, _SIZE))
        """(9, 9) mean square of the errors of attitude, velocity and position."""
        self._mean, self._covariance = np.zeros(_SIZE), np.zeros((_SIZE, _SIZE))
        self._with_state = np.zeros((_SIZE, n, n))
        self._forms = np.zeros((_SIZE, 6, 6))
        self._forms[:3, :3, 3:] = -0.5 * _CROSS
        self._forms[:3, 3:, :3] = 0.5 * _CROSS

    def step(
        self,
        h: float,
        acceleration: Array,
        previous: Array,
        updated: Array,
        by_rates: Array,
        decay: Array,
    ) -> None:
        """Propagate over an interval.

        :param h: length of the interval [s].
        :param acceleration: (3,) mean specific force, in the world [m/s^2].
        :param previous: (n, n) covariance of x at the start.
        :param updated: (n, n) at the end.
        :param by_rates: (3, r) how theta at the end depends on the errors of the rate at the start.
        :param decay: (r,) share of the initial errors of the rate that remains at the end.
        """
        theta = slice(0, 3)
        self.largest_sigma = max(self.largest_sigma, float(attitude_sigma(updated[theta, theta])))
        forms = self._forms
        forms[3:6, theta, theta] = forms[6:, 3:, 3:] = _shortening(acceleration)
        at_end = _propagate(previous[:, theta], by_rates, decay)  # E[x theta^T], x at the end
        k = np.concatenate([at_end, updated[:, theta]], axis=1)
        g = np.empty((6, 6))
        g[:3, :3], g[:3, 3:] = previous[theta, theta], at_end[theta].T
        g[3:, :3], g[3:, 3:] = at_end[theta], updated[theta, theta]
        weighed = forms @ g
        mean_products = 2.0 * np.einsum("iab,jba->ij", weighed, weighed)
        keep, gain = _transition(h, acceleration)
        c = self._with_state
        u = np.zeros((6, len(previous)))
        u[:3, :3], u[3:, :3], u[3:, 3:] = _EYE, _EYE, by_rates
        shared = np.einsum("iab,kab->ki", forms, u @ c @ u.T)
        crossed = keep @ shared @ gain.T
        y = keep @ self._covariance @ keep.T + crossed + crossed.T + gain @ mean_products @ gain.T
        self._covariance = y
        self._mean = keep @ self._mean + gain @ weighed.trace(axis1=1, axis2=2)
        c = _propagate(_propagate(c, by_rates, decay).swapaxes(1, 2), by_rates, decay)
        c = np.tensordot(keep, c, 1) + np.tensordot(gain, 2.0 * (k @ forms @ k.T), 1)
        self._with_state = c
        self.mean_square = y + np.outer(self._mean, self._mean)


def _shortening(a: Array) -> Array:
    """Return (3, 3, 3): row k of ``(Z - tr(Z) I) a / 2`` is ``theta^T _[k] theta``."""
    along = _EYE[:, :, None] * a
    return 0.25 * (along + along.swapaxes(1, 2)) - 0.5 * a[:, None, None] * _EYE


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


def _propagate(rows: Array, by_rates: Array, decay: Array) -> Array:
    """Return ``F rows`` for rows (..., n, k): theta gains from the rates, the rates decay."""
    theta, rates = rows[..., :3, :], rows[..., 3:, :]
    return np.concatenate([theta + by_rates @ rates, decay[:, None] * rates], axis=-2)
