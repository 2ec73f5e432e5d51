# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Terms of a state's covariance from slow errors, large tilts and the rest at the start."""

from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.components import Vector
from imu_sim_ros.core.types import Array
from imu_sim_ros.navigation.evaluation import attitude_sigma
from imu_sim_ros.parameters.kinds import ZERO_VECTOR
from imu_sim_ros.sensors.imu.triads import TriadsParameters

_SHORTEST: Final = 0.1
"""Correlation time of the fastest process of the 1/f noise [s]; faster ones average out."""
_CONSTANT: Final = 12
"""Input of errors that scale with nothing, behind those of TriadsParameters.response_terms."""


class SlowErrors:
    """Slow errors a (m,) of an IMU: Gauss-Markov processes, and errors of its response.

    Each has unit variance. They change the readings by H a, with H (6, m), gyroscope first; their
    covariance with the error of the state (n,) is C (n, m). Half of H is stored, so that a product
    and its transpose add up to a symmetric matrix with few operations.
    """

    def __init__(self, noise: TriadsParameters, size: int) -> None:
        """Start with errors that are uncorrelated with the state.

        :param noise: the IMU's errors.
        :param size: n, how many numbers the error of the state has; its last six are the biases.
        """
        entries, scales = noise.processes(_SHORTEST), noise.response_terms()
        axes = [axis for axis, _, _ in (*entries, *scales)]
        self.count = len(axes)
        """Number m of the slow errors."""
        times = [tau for _, tau, _ in entries] + [np.inf] * len(scales)
        self._decay_rate = -1.0 / np.array(times)
        self.cross = np.zeros((size, self.count))
        """(n, m) covariance C of state and slow errors."""
        self._half_in_state = np.zeros((size, self.count))
        """(n, m) H / 2 in the rows of the biases, zero elsewhere."""
        self._half_effect = self._half_in_state[-6:]
        inputs = [_CONSTANT] * len(entries) + [source for _, source, _ in scales]
        self._inputs = np.array(inputs, np.intp)
        sigmas = [sigma for _, _, sigma in (*entries, *scales)]
        self._half_sigmas = np.zeros((6, self.count))
        """(6, m) H / 2 if all inputs that the errors are proportional to are 1."""
        self._half_sigmas[axes, range(self.count)] = 0.5 * np.array(sigmas)
        self._has_scales = bool(scales)
        self.of_rate = np.flatnonzero(np.array(axes, dtype=np.intp) < 3)
        """Places in a of the gyroscope's errors."""
        self._half_gain = np.empty((size - 6, self.count))
        self._total = np.empty((size, self.count))
        self._h, self._decay = 0.0, np.ones(self.count)
        self._set_effect(ZERO_VECTOR, ZERO_VECTOR)

    def __bool__(self) -> bool:
        """Return whether there is any such error."""
        return self.count > 0

    @property
    def effect(self) -> Array:
        """(6, m) H, gyroscope first; a scale's entry is that of the latest reading."""
        return 2.0 * self._half_effect

    def act(self, by_bias: Array, rate_b: Vector[float], force_b: Vector[float]) -> Array:
        """Return G H / 2 (n - 6, m): half the effect of the errors on the state in an interval.

        All calls return the same array.

        :param by_bias: (n - 6, 6) G.
        :param rate_b: corrected rate in the interval, in the body [rad/s].
        :param force_b: corrected specific force [m/s^2].
        """
        self.act_on(rate_b, force_b)
        return by_bias.dot(self._half_effect, self._half_gain)

    def decay_over(self, h: float, passed: Array) -> None:
        """Set C at the end of an interval of length h [s].

        :param passed: (n, m) F C + G H.
        """
        if h != self._h:
            self._h, self._decay = h, self.decay(h)
        np.multiply(passed, self._decay, self.cross)

    def over(self, time: float) -> tuple[Array, Array]:
        """Return the variances (m,) of the errors' means over a time [s], and with its end.

        As :func:`mean_factors`.
        """
        return mean_factors(-self._decay_rate * time)

    def decay(self, time: float) -> Array:
        """Return the share (m,) of each error that is left after a time [s]."""
        return np.exp(self._decay_rate * time)

    def act_on(self, rate_b: Vector[float], force_b: Vector[float]) -> None:
        """Set the effect of scale errors on a reading."""
        if self._has_scales:
            self._set_effect(rate_b, force_b)

    def _set_effect(self, rate_b: Vector[float], force_b: Vector[float]) -> None:
        """Set the effect of the slow errors on rate and force for the current motion."""
        (x, y, z), (a, b, c) = rate_b, force_b
        inputs = (x, y, z, a, b, c, x * x, y * y, z * z, a * a, b * b, c * c, 1.0)
        factors = np.array(inputs).take(self._inputs)
        np.multiply(self._half_sigmas, factors, self._half_effect)

    def add_bias(self, covariance: Array) -> None:
        """Add the effect H a of the slow errors a on the biases to a covariance (n, n).

        ``C H^T + H C^T + H H^T`` in the rows and columns of the biases: H a is added to the error
        of the state x, and ``E[(x + H a) (x + H a)^T] = P + C H^T + H C^T + H H^T``.
        """
        # (C + H / 2) H^T and its transpose add up to all three terms.
        total = np.add(self.cross, self._half_in_state, self._total)
        half = total.dot(self._half_effect.T)
        half += half
        covariance[:, -6:] += half
        covariance[-6:] += half.T


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
"""Number of error states that a process drives: position, velocity, attitude."""
_TOGETHER: Final = 64
"""Attitudes whose largest standard deviations are computed in one go."""
_EYE: Final = np.eye(3)
_CROSS: Final = 0.5 * rotation.skew(_EYE)
"""(3, 3, 3): row k of ``theta x theta' / 2`` is ``-theta^T _CROSS[k] theta'``."""


def _attitude_forms() -> Array:
    """Return (3, 36) quadratic forms of the attitude's change of second order in an interval."""
    forms = np.zeros((3, 6, 6))
    forms[:, :3, 3:], forms[:, 3:, :3] = -0.5 * _CROSS, 0.5 * _CROSS
    return forms.reshape(3, 36)


def _shortening_forms() -> Array:
    """Return (108, 3): a force a times it is the forms (3, 36) of what shortens it at both ends.

    Row k of ``(Z - tr(Z) I) a / 2`` is ``theta^T S theta``, S the block of the start and the end.
    """
    along = np.einsum("ki,jl->kijl", _EYE, _EYE)
    forms = np.zeros((3, 6, 6, 3))
    forms[:, :3, :3] = 0.25 * (along + along.swapaxes(1, 2))
    forms[:, :3, :3] -= 0.5 * np.einsum("kl,ij->kijl", _EYE, _EYE)
    forms[:, 3:, 3:] = forms[:, :3, :3]
    return forms.reshape(108, 3)


_TURNING: Final = _attitude_forms()
_SHORTENING: Final = _shortening_forms()


class SecondOrder:
    """Mean and covariance of the second-order errors of attitude, velocity and position.

    In an interval they gain quadratic forms of eta (6,), the first-order errors of the attitude at
    its start and at its end; a form is (6, 6), or its 36 entries row by row.
    """

    def __init__(self, rates: int) -> None:
        """Start with no error.

        :param rates: r, how many errors of the rate the state x has in addition to theta.
        """
        n = 3 + rates
        self._largest_sigma = 0.0
        self._attitudes, self._count = np.empty((_TOGETHER, 3, 3)), 0
        """Latest covariances of the attitude, and how many of them are not judged yet."""
        self.mean_square = np.zeros((_SIZE, _SIZE))
        """(9, 9) mean square of the errors of attitude, velocity and position."""
        self._mean, self._covariance = np.zeros(_SIZE), np.zeros((_SIZE, _SIZE))
        """Mean (9,) and covariance (9, 9) of these errors."""
        self._with_state = np.zeros((_SIZE, n, n))
        """Covariances of the errors with the products of x."""
        self._with_ends = np.empty((_SIZE, 6, 6))
        """Covariances of the errors with the products of eta."""
        self._keep, self._forms = np.eye(_SIZE), np.empty((_SIZE, 36))
        """(9, 9) L, by which the errors pass through an interval, and the forms that they gain."""
        self._forms[:3] = _TURNING
        self._keep_velocity = np.einsum("ii->i", self._keep[6:, 3:6])
        self._form_matrices = self._forms.reshape(_SIZE, 6, 6)
        self._shares = np.ones(n)
        """Share of x at the start that remains at the end."""
        self._products, self._eta = np.empty((n, 6)), np.empty((6, 6))
        """E[x eta^T] with x at the end of an interval, and E[eta eta^T]."""

    @property
    def largest_sigma(self) -> float:
        """Largest standard deviation of the attitude so far, along its worst axis [rad]."""
        self._judge_attitudes()
        return self._largest_sigma

    def _judge_attitudes(self) -> None:
        """Compute the standard deviations of the latest attitudes."""
        sigmas = attitude_sigma(self._attitudes[: self._count]).tolist()
        self._largest_sigma, self._count = max(self._largest_sigma, *sigmas, 0.0), 0

    def step(
        self,
        h: float,
        acceleration: Vector[float],
        previous: Array,
        updated: Array,
        by_rates: Array,
        decay: Array,
    ) -> None:
        """Propagate over an interval.

        :param h: length of the interval [s].
        :param acceleration: mean specific force, in the world [m/s^2].
        :param previous: (n, n) covariance of x at the start.
        :param updated: (n, n) covariance of x at the end.
        :param by_rates: (3, r) how theta at the end depends on the errors of the rate at the start.
        :param decay: (r,) share of the initial errors of the rate that remains at the end.
        """
        if self._count == _TOGETHER:
            self._judge_attitudes()
        self._attitudes[self._count] = updated[:3, :3]
        self._count += 1
        self._set_interval(h, acceleration)
        self._shares[3:] = decay
        self._set_moments(previous, updated, by_rates)
        self._advance_products(by_rates)
        self._advance_errors()
        self._add_forms_to_products()
        self.mean_square = self._covariance + self._mean[:, None] * self._mean

    def _set_moments(self, previous: Array, updated: Array, by_rates: Array) -> None:
        """Set E[x eta^T] (n, 6), of x at the end, and E[eta eta^T] (6, 6); arguments of step."""
        products, eta = self._products, self._eta
        # x at the end with theta at the start: x decays, and theta gains from the rates.
        end_with_start = np.multiply(previous[:, :3], self._shares[:, None], products[:, :3])
        end_with_start[:3] += by_rates.dot(previous[3:, :3])
        products[:, 3:] = updated[:, :3]
        eta[:3, :3], eta[3:] = previous[:3, :3], products[:3]
        eta[:3, 3:] = end_with_start[:3].T

    def _advance_errors(self) -> None:
        """Propagate mean and covariance of the errors: they become L times themselves plus forms.

        The covariance of forms A and B of normal numbers eta is ``2 tr(A E B E)``, their mean
        ``tr(A E)``, with E = E[eta eta^T].
        """
        keep, forms, eta = self._keep, self._forms, self._eta
        weighed = self._form_matrices @ eta
        transposed = weighed.swapaxes(1, 2).reshape(_SIZE, 36)
        form_covariance = weighed.reshape(_SIZE, 36).dot(transposed.T)
        form_covariance += form_covariance
        errors_with_forms = keep.dot(self._with_ends.reshape(_SIZE, 36)).dot(forms.T)
        self._covariance = keep.dot(self._covariance).dot(keep.T)
        self._covariance += form_covariance
        self._covariance += errors_with_forms
        self._covariance += errors_with_forms.T
        self._mean = keep.dot(self._mean) + forms.dot(eta.reshape(36))

    def _add_forms_to_products(self) -> None:
        """Propagate the covariances of the errors with products of x by L, and add the forms'.

        That of a form A with ``x x^T`` is ``2 E[x eta^T] A E[eta x^T]``.
        """
        keep, products = self._keep, self._products
        with_state = keep.dot(self._with_state.reshape(_SIZE, -1)).reshape(self._with_state.shape)
        weighed = (products @ self._form_matrices).reshape(-1, 6)
        products += products
        with_state += weighed.dot(products.T).reshape(with_state.shape)
        self._with_state = with_state

    def _set_interval(self, h: float, acceleration: Vector[float]) -> None:
        """Set L (9, 9), which keeps the errors, and the forms of an interval.

        Both are by the trapezoid of the interval's ends: ``theta2 x a h`` turns the velocity.
        """
        x, y, z = acceleration
        x, y, z, half = x * h, y * h, z * h, 0.5 * h
        keep, forms = self._keep, self._forms
        keep[3:6, :3] = tilted = np.array(((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)))
        tilted *= half
        keep[6:, :3] = tilted
        self._keep_velocity[:] = h
        velocity = _SHORTENING.dot(acceleration).reshape(3, 36)
        velocity *= half
        velocity += keep[3:6, :3].dot(0.5 * _TURNING)
        forms[3:6] = velocity
        velocity *= half
        forms[6:] = velocity

    def _advance_products(self, by_rates: Array) -> None:
        """Propagate x in the covariances with its products, and set those with products of eta.

        Attitude theta, the first three entries of x, gains ``by_rates`` times the errors of the
        rate, which then decay; eta is theta before and after.
        """
        c, ends = self._with_state, self._with_ends
        # A view: it is theta theta^T first, then theta theta'^T, then theta' theta'^T.
        attitude = c[:, :3, :3]
        ends[:, :3, :3] = attitude
        c[:, :, :3] += c[:, :, 3:] @ by_rates.T
        ends[:, :3, 3:] = attitude
        ends[:, 3:, :3] = attitude.swapaxes(1, 2)
        c[:, :3] += by_rates @ c[:, 3:]
        ends[:, 3:, 3:] = attitude
        c *= self._shares[:, None] * self._shares
