# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Least-squares fit of a triad's response to known input: scale, misalignment, bias, temperature.

One axis reads ``y = (1 + s(T)) (S x + G f) + b(T)`` with polynomials s, without constant, and b of
``T - T0``. Without temperature that is the lecture's eq. 7, and linear; with it, Gauss-Newton
converges in a few steps, for s is small.
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.deterministic.steady import whiten
from imu_sim_ros.core.types import Array, Integers

_STEPS: Final = 8
"""Number of reweighted fits."""
_LOG_WALKS: Final = (-6.0, 14.0)
"""Range of the logarithm of the walk's variance over the record, over the readings' variance."""
_GRID: Final = 21
"""Number of sizes of the bias walk that are tried."""
_ROUNDING: Final = 16.0 * float(np.finfo(np.float64).eps)
"""Relative rounding error of a mean reading in float64."""
_NOTHING: Final = 1e-15
"""Resolution of readings that are zero [rad/s, m/s^2]."""
_CLOSE: Final = 4.0
"""Largest residual of an exact fit of noise-free readings, in units of the rounding."""
_DEPENDENT: Final = 1e-6
"""Ratio of singular values below which the inputs do not determine all parameters."""


class AxisResponse(NamedTuple):
    """One axis: the parameters and their uncertainty."""

    gain: Array
    """(p,) row of S, and of G if it is estimated."""
    bias: Array
    """(k + 1,) polynomial of the bias, lowest order first."""
    scale: Array
    """(l,) polynomial of the scale from the first order on."""
    covariance: Array
    """(q, q) covariance of gain, bias and scale in this order."""
    residuals: Array
    """(n,) reading minus model and minus the walk of the bias, smoothed over all readings."""
    chi_square: float
    """Chi-square of the residuals over their degrees of freedom, with the readings' errors."""
    criterion: float
    """Bayesian information criterion, chi-square + q ln n; the smallest model is the best."""

    @property
    def is_exact(self) -> bool:
        """True if the residuals of readings without noise are rounding alone."""
        return not self.covariance.any()

    @property
    def sigma(self) -> Array:
        """(q,) standard errors."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def gain_sigma(self) -> Array:
        """(p,) standard errors of the gain."""
        return self.sigma[: len(self.gain)]

    @property
    def bias_sigma(self) -> Array:
        """(k + 1,) standard errors of the bias."""
        return self.sigma[len(self.gain) : len(self.gain) + len(self.bias)]

    @property
    def scale_sigma(self) -> Array:
        """(l,) standard errors of the scale."""
        return self.sigma[len(self.gain) + len(self.bias) :]


class Observations(NamedTuple):
    """n mean readings of one axis, their known input, and their noise."""

    inputs: Array
    """(n, p) known inputs: true rate or force, and force for the g-sensitivity."""
    readings: Array
    """(n,) mean readings."""
    sigma: Array
    """(n,) standard errors of the readings."""
    time: Array
    """(n,) times after the start [s]."""
    temperature: Array
    """(n,) temperature differences T - T0 [K]."""


def fit_axis(
    data: Observations, bias_order: int = 0, scale_order: int = 0, whitener: Array | None = None
) -> AxisResponse:
    """Return the parameters of one axis; the bias is that at the start of the record.

    The readings' errors are their own noise and a bias that walks from the start on: generalised
    least squares with the covariance ``sigma_i^2 + K^2 min(t_i, t_j)``. Without the walk, standard
    errors of the bias would be far too small. Standard errors are widened further by the square
    root of the residuals' chi-square if that is above one.

    Readings without noise that the model explains to the last digits give exact parameters: digits
    below the rounding of float64 are removed, and their standard errors are 0.

    :param whitener: whitener from :func:`walk_whitener`; None: computed for this model.
    """
    data, noise_free = _above_rounding(data)
    weight = walk_whitener(data, bias_order, scale_order) if whitener is None else whitener
    bias_columns, scale_columns, span = _powers(data.temperature, bias_order, scale_order)
    p, b = data.inputs.shape[1], bias_columns.shape[1]
    parameters = np.zeros(p + b + scale_order)
    parameters[:p] = np.linalg.lstsq(data.inputs, data.readings, rcond=None)[0]
    for _ in range(_STEPS if scale_order else 2):
        scale = 1.0 + scale_columns @ parameters[p + b :]
        response = data.inputs @ parameters[:p]
        model = scale * response + bias_columns @ parameters[p : p + b]
        jacobian = np.column_stack(
            [scale[:, None] * data.inputs, bias_columns, scale_columns * response[:, None]]
        )
        residuals = weight @ (data.readings - model)
        parameters = parameters + np.linalg.lstsq(weight @ jacobian, residuals, rcond=None)[0]
    scale = 1.0 + scale_columns @ parameters[p + b :]
    model = scale * (data.inputs @ parameters[:p]) + bias_columns @ parameters[p : p + b]
    response_fit = _summary(
        parameters, weight, jacobian, data.readings - model, (p, b, scale_order), span
    )
    if noise_free and response_fit.chi_square <= _CLOSE**2:
        return _drop_rounding_errors(response_fit)
    # Of residuals with the covariance V, diag(sigma^2) V^-1 r is the part that is not walk.
    return response_fit._replace(
        residuals=data.sigma**2 * (weight.T @ (weight @ response_fit.residuals))
    )


def rounding_error(readings: Array) -> float:
    """Return the rounding error of one axis' readings, a lower bound of standard errors."""
    return max(_ROUNDING * float(np.abs(readings).max()), _NOTHING)


def _above_rounding(data: Observations) -> tuple[Observations, bool]:
    """Return readings with sigma at least their rounding, and whether that is their only error."""
    rounding = rounding_error(data.readings)
    sigma = np.maximum(data.sigma, rounding)
    return data._replace(sigma=sigma), bool(np.all(sigma == rounding))


def _drop_rounding_errors(fitted: AxisResponse) -> AxisResponse:
    """Return parameters with rounding errors removed, and with zero standard errors."""
    sigma = np.maximum(fitted.sigma, np.finfo(np.float64).tiny)
    digits = -np.floor(np.log10(10.0 * sigma)).astype(int)

    def cut(values: Array, decimals: Integers) -> Array:
        pairs = zip(values.tolist(), decimals.tolist(), strict=True)
        return np.array([round(value, count) + 0.0 for value, count in pairs])

    p, b = len(fitted.gain), len(fitted.bias)
    return fitted._replace(
        gain=cut(fitted.gain, digits[:p]),
        bias=cut(fitted.bias, digits[p : p + b]),
        scale=cut(fitted.scale, digits[p + b :]),
        covariance=np.zeros_like(fitted.covariance),
        residuals=np.zeros_like(fitted.residuals),
    )


def _powers(temperature: Array, bias_order: int, scale_order: int) -> tuple[Array, Array, float]:
    """Return the powers of T / span for bias and scale: columns of about one size."""
    span = max(float(np.max(np.abs(temperature))), 1.0)
    powers = (temperature / span)[:, None] ** np.arange(max(bias_order, scale_order) + 1)
    return powers[:, : bias_order + 1], powers[:, 1 : scale_order + 1], span


def walk_whitener(data: Observations, bias_order: int = 0, scale_order: int = 0) -> Array:
    """Return W (n, n), W V W.T = 1, with the walk that the restricted likelihood gives.

    Restricted (Patterson and Thompson 1971), so that the parameters taken from few readings do not
    make the walk look small.
    """
    data, _ = _above_rounding(data)
    bias_columns, scale_columns, _ = _powers(data.temperature, bias_order, scale_order)
    columns = np.column_stack([data.inputs, bias_columns])
    if data.inputs.shape[1]:  # the input that the readings of the axis follow
        main_input = int(np.argmax(np.abs(data.inputs.T @ (data.readings - data.readings.mean()))))
        columns = np.column_stack(
            [columns, scale_columns * data.inputs[:, main_input : main_input + 1]]
        )
    return likely_whitener(data, columns)


def likely_whitener(data: Observations, columns: Array, correlation: Array | None = None) -> Array:
    """Return the whitener of :func:`walk_whitener` for a model with the given columns (n, p).

    :param correlation: (n, n) correlation of a bias walk's effect on two readings; None: 1 for all.
    """
    basis, triangle = np.linalg.qr(columns)
    columns = basis[:, np.abs(np.diag(triangle)) > _DEPENDENT * np.abs(triangle).max()]
    time = np.maximum(data.time, 0.0)
    unit = float(np.median(data.sigma)) ** 2 / max(float(time[-1]), 1e-9)
    grid = np.linspace(*_LOG_WALKS, _GRID)
    shape = np.minimum.outer(time, time) * unit
    if correlation is not None:
        shape = shape * correlation
        values = np.array([_walk_objective(data, columns, shape, float(np.exp(x))) for x in grid])
    else:
        order = np.argsort(time, kind="stable")
        columns_and_readings = np.column_stack([columns, data.readings])[order]
        results = whiten(columns_and_readings, time[order], data.sigma[order], unit * np.exp(grid))
        values = np.array(
            [
                _restricted_log_likelihood(w[:, :-1], w[:, -1], float(log))
                for w, log in zip(results.columns, results.log_determinant, strict=True)
            ]
        )
    # The mean of K^2 under a flat prior in K, not the most likely value: few readings can make a
    # walk look absent, and then every bias would be claimed too sure.
    probability = np.exp(values.min() - values + 0.5 * grid)
    walk = float(np.sum(probability * np.exp(grid)) / np.sum(probability))
    return _whitener(data, shape, walk)[0]


def _walk_objective(data: Observations, columns: Array, shape: Array, walk: float) -> float:
    """Return minus the restricted log-likelihood of a walk that acts on readings as in shape."""
    w, log_determinant = _whitener(data, shape, walk)
    return _restricted_log_likelihood(w @ columns, w @ data.readings, log_determinant)


def _restricted_log_likelihood(columns: Array, readings: Array, log_determinant: float) -> float:
    """Return minus the restricted log-likelihood of whitened columns (n, p) and readings (n,)."""
    r = readings - columns @ np.linalg.lstsq(columns, readings, rcond=None)[0]
    information = np.linalg.slogdet(columns.T @ columns)[1]
    return float(0.5 * (log_determinant + information + r @ r))


def _whitener(data: Observations, shape: Array, walk: float) -> tuple[Array, float]:
    """Return the inverse Cholesky factor of the covariance and the covariance's log-determinant."""
    covariance = walk * shape + np.diag(data.sigma**2)
    factor = np.linalg.cholesky(covariance)
    # Not SciPy's solve_triangular, for which OpenBLAS starts its threads even for small matrices.
    inverse: Array = np.linalg.solve(factor, np.eye(len(factor)))
    return inverse, 2.0 * float(np.sum(np.log(np.diag(factor))))


def _summary(
    parameters: Array,
    weight: Array,
    jacobian: Array,
    residuals: Array,
    shape: tuple[int, int, int],
    span: float,
) -> AxisResponse:
    """Return the parameters of one axis with their covariance.

    :param parameters: (q,) gain, bias and scale; powers of the temperature over the span.
    :param weight: (n, n) whitener of the readings.
    :param shape: number of gains and of bias coefficients, order of the scale.
    :param span: range of the temperatures that scales their powers [K].
    """
    p, b, scale_order = shape
    n, q = jacobian.shape
    total = float(np.sum((weight @ residuals) ** 2))
    chi_square = total / max(n - q, 1)
    whitened = weight @ jacobian
    covariance = np.linalg.pinv(whitened.T @ whitened) * max(chi_square, 1.0)
    orders = np.concatenate([np.zeros(p), np.arange(b), np.arange(1, scale_order + 1)])
    units = span**-orders
    parameters = parameters * units
    return AxisResponse(
        gain=parameters[:p],
        bias=parameters[p : p + b],
        scale=parameters[p + b :],
        covariance=covariance * np.outer(units, units),
        residuals=residuals,
        chi_square=chi_square,
        criterion=total + q * float(np.log(n)),
    )


def is_distinguishable(inputs: Array) -> bool:
    """Return whether inputs (n, p) and a constant are distinguishable."""
    columns = np.column_stack([inputs, np.ones(len(inputs))])
    norms = np.linalg.norm(columns, axis=0)
    if np.any(norms == 0.0):
        return False
    singular = np.linalg.svd(columns / norms, compute_uv=False)
    return len(inputs) >= columns.shape[1] and bool(singular[-1] > _DEPENDENT * singular[0])
