# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The constant errors of an IMU from its readings on a known motion: weighted least squares.

What errors leave unexplained, vibration above all, is far from white. So readings and Jacobian go
through the orthonormal cosine transform (DCT-II), whose coefficients of a stationary process are
nearly independent with the process' spectral density as variance, and each coefficient is weighted
with that density. The density is that of the residuals of the step before, in bins, corrected for
the parameters that were taken from them. Gauss-Newton steps and densities alternate until both
stay: feasible generalised least squares, Whittle's likelihood at its maximum.

Noise of the poses is in the residuals and in the Jacobian, and so pulls every gain towards zero.
What it adds to the normal equations on average is taken from them (a corrected score: Nakamura,
"Corrected score function for errors-in-variables models", 1990); that average is over readings
predicted on motions to which the noise was added once more. Bins in which the motion is mostly
noise are left out.

Standard errors are those of the "sandwich" ``A^-1 B A^-1`` (White 1980): A the weighted normal
matrix, B the sum of the outer products of each sample's part of the gradient, all six axes
together. They hold if the noise grows with the motion, and if its axes belong together. The
residuals in B are those before the parameters took their share, bin by bin. None is smaller than
``A^-1`` gives, and a tenth of what the correction moved is added: so well is the noise known.

Each parameter has a weak normal prior (``PRIOR``), so that a motion that does not determine one
leaves it at the perfect IMU's value with the prior's standard deviation, and none is undefined.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.twin import model
from imu_sim_ros.calibration.twin.model import COUNT, Errors, KnownMotion, MotionAt
from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.types import Array, Integers

Indices = NDArray[np.intp]

ALL_PARAMETERS: Final = np.arange(COUNT)
"""Indices of all parameters."""
_SEGMENT: Final = 1 << 14
"""Largest number of samples transformed together."""
_HIGHEST: Final = 0.5
"""Highest frequency over the cut-off: above it the truth is smoothed by more than 1.6 %."""
_SMOOTHED: Final = 0.008
"""Share of a motion that the spline takes there as a rule, which motion all through the range shows
as a smoothing of the truth: half of these 1.6 %."""
_STEPS: Final = 8
"""Largest number of Gauss-Newton steps."""
_WEIGHTINGS: Final = 2
"""Number of density updates in one step."""
_SHAPED: Final = 2
"""Number of steps after which the shape of the densities within their bins is updated."""
_WITH_NOISE: Final = 3
"""Number of steps in which the effect of the poses' noise is recomputed."""
_NARROW: Final = 8
"""Number of coefficients of each draw that give one density of the poses' noise."""
_LEAST_REST: Final = 0.1
"""Smallest share of a density that is not noise of the poses."""
_CLOSE: Final = 1e-3
"""Largest last step over its standard error of a converged fit."""
_SETTLED: Final = 1.0
"""Largest last step over its standard error of a fit that is usable."""
_LARGE_SHARE: Final = 0.5
"""Largest share of the motion's energy in a bin that may be noise of the poses."""
_NOISE_KNOWN: Final = 0.1
"""Relative standard error of the variance of the poses' noise."""
_HIDDEN: Final = 1e-6
"""Information of the readings over the prior's below which noise explains all of it."""
_BIN: Final = 40
"""Number of coefficients in the first bins of the density; later bins are relatively wide."""
_WIDTH: Final = 0.5
"""Width of later bins over their lower end."""
_PRIOR_OF: Final = (
    (model.OFFSET, 1.0),
    (model.SKEW, 1e-2),
    (model.MOUNTING, 10.0),
    (model.GYROSCOPE, 0.03),
    (model.ACCELEROMETER, 0.03),
    (model.G_SENSITIVITY, 5e-4),
    (model.LEVER_ARM, 0.5),
    (model.BIAS, 10.0),
    (model.CURVATURE, 1e-4),
    (model.WORLD, 0.03),
)
PRIOR: Final = np.concatenate([np.full(part.stop - part.start, s) for part, s in _PRIOR_OF])
"""(42,) standard deviations of the priors around a perfect IMU, in each parameter's unit."""


class Recording(NamedTuple):
    """Readings of an IMU that a fit explains."""

    stamps: Array
    """(n,) times after the truth's first pose [s]."""
    readings: Array
    """(n, 6) gyroscope [rad/s], accelerometer [m/s^2]."""
    pieces: tuple[slice, ...]
    """Rows without a gap in between."""
    rate: float
    """Sample rate [Hz]."""

    def part(self, start: float, stop: float) -> "Recording":
        """Return the readings with stamps from start to before stop [s]."""
        begin, end = np.searchsorted(self.stamps, [start, stop])
        pieces = []
        for piece in self.pieces:
            low, high = max(piece.start, begin), min(piece.stop, end)
            if high > low:
                pieces.append(slice(low - begin, high - begin))
        rows = slice(begin, end)
        return Recording(self.stamps[rows], self.readings[rows], tuple(pieces), self.rate)


class Fit(NamedTuple):
    """Estimated errors with their uncertainty."""

    errors: Errors
    covariance: Array
    """(42, 42) covariance of the parameters, in the order of :meth:`Errors.step`."""
    residuals: Array
    """(n, 6) readings minus model, gyroscope [rad/s] and accelerometer [m/s^2]."""
    reference: float
    """Stamp of the offset [s]."""
    wander: Array
    """(n,) deviation of the truth's clock from offset and skew [s]."""
    slope: Array
    """(n, 6) time derivatives of the modelled readings [rad/s^2, m/s^3]."""
    noise_shift: Array
    """(42,) shift of each parameter by the correction for the poses' noise, in standard errors."""
    settled: bool
    """True if the last step was smaller than a standard error."""

    @property
    def sigma(self) -> Array:
        """(42,) standard errors."""
        return np.sqrt(np.diag(self.covariance))


class _Sums:
    """Sums over the coefficients of each bin and axis, sufficient for weights and steps.

    Bin 0 contains the mean of each segment, which belongs to the bias and not to a density.
    """

    def __init__(self, segments: list[slice], rate: float, highest: float, parameters: int) -> None:
        """Initialise without sums.

        :param segments: rows of the segments, each transformed by itself.
        :param rate: samples per second [Hz].
        :param highest: frequency up to which coefficients are used [Hz].
        :param parameters: number of the parameters that are fitted.
        """
        self.segments, self._parameters = segments, parameters
        self.smoothing = _SMOOTHED / (2.0 * np.pi * highest) ** 2
        """Largest smoothing of the truth that the spline through the poses may have [s^2]."""
        longest = max(s.stop - s.start for s in segments)
        edges = [0.5]
        while edges[-1] < longest:
            edges.append(edges[-1] + max(_BIN, round(_WIDTH * edges[-1])))
        upper = np.array(edges[1:]) * rate / (2 * longest)
        # Middles of the bins [Hz]; bin 0 is the mean.
        self.middle = np.concatenate([[0.0], 0.5 * (upper + np.append(0.0, upper[:-1]))])
        self._bins: list[Integers] = []
        for s in segments:
            f = np.arange(s.stop - s.start) * rate / (2 * (s.stop - s.start))
            f = f[: max(int(np.searchsorted(f, highest)), 2 * _BIN)]
            bins = np.minimum(1 + np.searchsorted(upper, f, side="right"), len(upper))
            bins[0] = 0
            self._bins.append(bins)
        self._shape = [np.ones((len(bins), 6)) for bins in self._bins]
        self.clear()
        self.forget_noise()

    def clear(self) -> None:
        """Reset the sums over readings."""
        count, p = len(self.middle), self._parameters
        self.count = np.zeros(count)
        """(bins,) number of coefficients."""
        self.square = np.zeros((count, 6))
        """Sums of the squared residuals."""
        self.product = np.zeros((count, 6, p))
        """Sums of the products of Jacobian and residuals."""
        self.matrix = np.zeros((count, 6, p, p))
        """Sums of the products of the Jacobian with itself."""
        self.remaining_share = np.ones((count, 6))
        """Average share of the residual's squares that remains after the fit."""

    def forget_noise(self) -> None:
        """Reset the effect of the poses' noise on product and matrix."""
        self.noise_product = np.zeros_like(self.product)
        self.noise_matrix = np.zeros_like(self.matrix)
        self._noise = [np.zeros((len(bins), 6)) for bins in self._bins]

    def weights_of(self, segment: int, weight: Array) -> tuple[Array, Array]:
        """Return weights (m, 6) of a segment's coefficients, and their remaining shares (m, 6).

        :param weight: (bins, 6) weights relative to the shape of the densities.
        """
        bins = self._bins[segment]
        return weight[bins] / self._shape[segment], self.remaining_share[bins]

    def add(self, segment: int, residuals: Array, signals: Array, coefficients: Array) -> None:
        """Add residuals (n, 6) and Jacobian of a segment.

        :param signals: (n, s), and coefficients (6, s, p), whose products are the Jacobian.
        """
        for k, values, columns in self._iterate_bins(segment, residuals, signals, coefficients):
            self.square[k] += np.sum(values**2, axis=1)
            self.product[k] += np.einsum("ami,am->ai", columns, values)
            self.matrix[k] += np.swapaxes(columns, 1, 2) @ columns
        self.count += np.bincount(self._bins[segment], minlength=len(self.count))

    def add_noise(
        self, segment: int, residuals: Array, signals: Array, coefficients: Array, share: float
    ) -> None:
        """Add a share of the effect of the poses' noise on residuals and Jacobian."""
        self._noise[segment] += share * _cosine_transform(residuals, len(self._bins[segment])) ** 2
        for k, values, columns in self._iterate_bins(segment, residuals, signals, coefficients):
            self.noise_product[k] += share * np.einsum("ami,am->ai", columns, values)
            self.noise_matrix[k] += share * (np.swapaxes(columns, 1, 2) @ columns)

    def _iterate_bins(
        self, segment: int, residuals: Array, signals: Array, coefficients: Array
    ) -> Iterator[tuple[int, Array, Array]]:
        """Yield each bin with its coefficients of residuals (6, m) and Jacobian (6, m, p)."""
        bins = self._bins[segment]
        root = np.sqrt(self._shape[segment]).T
        c = _cosine_transform(residuals, len(bins)).T / root
        j = _cosine_transform(signals, len(bins)) @ coefficients / root[:, :, None]
        starts = np.flatnonzero(np.diff(bins, prepend=-1))
        for begin, end in pairwise([*starts.tolist(), len(bins)]):
            yield int(bins[begin]), c[:, begin:end], j[:, begin:end]

    def update_shape(self, density: Array) -> None:
        """Take the noise of the poses as the shape of the densities within their bins.

        It rises with the second power of the frequency in the density of the rates, and with the
        fourth in that of the accelerations; the remainder is constant within a bin.

        :param density: (bins, 6) density over the previous shape.
        """
        count = np.maximum(self.count, 1.0)[:, None]
        noise = [_smooth_density(power) for power in self._noise]
        whole, noise_level = np.zeros((2, len(self.count), 6))
        for bins, shape, noise_power in zip(self._bins, self._shape, noise, strict=True):
            np.add.at(whole, bins, shape / count[bins])
            np.add.at(noise_level, bins, noise_power / count[bins])
        whole *= density
        other_noise = np.maximum(whole - noise_level, _LEAST_REST * whole)
        self._shape = [
            other_noise[bins] + noise_power
            for bins, noise_power in zip(self._bins, noise, strict=True)
        ]

    def widening_factors(self, weight: Array, inverse: Array) -> Array:
        """Return the factors (p,), 1 or more, by which estimated densities widen standard errors.

        Weights from n coefficients are wrong by sqrt(2 / n), which costs efficiency and is
        hidden by the inverse of the normal matrix (Kenward and Roger, "Small sample inference
        for fixed effects from restricted maximum likelihood", Biometrics 53, 1997)::

            inverse + 2 inverse sum_b (2 / n_b) (A_b - A_b inverse A_b) inverse

        with the part A_b that each bin and axis has in the normal matrix.

        :param weight: (bins, 6); inverse: (p, p) of the normal matrix.
        """
        parts = (weight[:, :, None, None] * self.matrix).reshape(-1, *inverse.shape)
        freedom = (self.count[:, None] * self.remaining_share).reshape(-1)
        relative_variance = 2.0 / np.maximum(freedom, 2.0)
        part = parts @ inverse
        lost = np.einsum("k,kij->ij", relative_variance, part - part @ part)
        added = 2.0 * np.diag(inverse @ lost) / np.diag(inverse)
        return np.asarray(np.sqrt(1.0 + np.maximum(added, 0.0)))

    def visible_bins(self, prior: Array) -> Array:
        """Return 1 for bins (bins, 6) that contain motion, and 0 if it is mostly noise."""
        total, noise = (
            np.einsum("kaii,i->ka", matrix, prior**2) for matrix in (self.matrix, self.noise_matrix)
        )
        return np.where(noise <= _LARGE_SHARE * total, 1.0, 0.0)

    def density(self, step: Array, inverse: Array, previous: Array) -> Array:
        """Return the densities (bins, 6) of the residuals after a step.

        :param inverse: (42, 42) covariance of the parameters.
        :param previous: (bins, 6) densities of the previous step.
        """
        power = self.square - 2.0 * self.product @ step + (self.matrix @ step) @ step
        explained = np.einsum("kaij,ji->ka", self.matrix, inverse) / previous
        count = self.count[:, None]
        freedom = np.maximum(count - explained, 0.1 * count)
        self.remaining_share = np.where(count > 0.0, freedom / np.maximum(count, 1.0), 1.0)
        floor = 1e-12 * np.maximum(power[1:].sum(axis=0) / count[1:].sum(), 1e-30)
        densities = np.maximum(power / np.maximum(freedom, 1e-9), floor)
        filled_bins = 1 + np.flatnonzero(self.count[1:])
        nearest = filled_bins[
            np.argmin(np.abs(np.arange(len(count))[:, None] - filled_bins), axis=1)
        ]
        return np.asarray(densities[nearest])


def fit(
    recording: Recording,
    truth: KnownMotion,
    start: Errors,
    wander: Array | None = None,
    prior: Array = PRIOR,
    free: Indices = ALL_PARAMETERS,
) -> Fit:
    """Return the errors of an IMU with their covariance, by iterated weighted least squares.

    :param truth: motion with the noise of its poses.
    :param start: first guess with mounting and offset.
    :param wander: (n,) wander of the truth's clock [s]; None: 0.
    :param prior: (42,) standard deviations.
    :param free: (p,) indices of the fitted parameters; the others stay at the start.
    """
    stamps, errors = recording.stamps, start
    wander = np.zeros(len(stamps)) if wander is None else wander
    reference = float(stamps[0] + stamps[-1]) / 2.0
    motion_at, cutoff, noisy = truth
    sums = _Sums(_segments(recording.pieces), recording.rate, _HIGHEST * cutoff, len(free))
    size = np.std(recording.readings, axis=0) + 1e-9
    density = np.where(sums.middle[:, None] < cutoff, 1.0, 100.0) * size**2
    for count in range(_STEPS):
        sums.clear()
        fresh = count < _WITH_NOISE
        if fresh:
            sums.forget_noise()
        for k, rows in enumerate(sums.segments):
            linear = model.linearise_readings(
                errors, motion_at, stamps[rows], reference, wander[rows]
            )
            jacobian_coefficients = linear.coefficients[:, :, free]
            sums.add(
                k, recording.readings[rows] - linear.readings, linear.signals, jacobian_coefficients
            )
            for noisy_motion in noisy if fresh else ():
                noisy_linear = model.linearise_readings(
                    errors, noisy_motion, stamps[rows], reference, wander[rows]
                )
                difference = noisy_linear.signals - linear.signals
                sums.add_noise(
                    k,
                    linear.readings - noisy_linear.readings,
                    difference,
                    jacobian_coefficients,
                    1.0 / len(noisy),
                )
        for _ in range(_WEIGHTINGS if count else 1):
            step, inverse = _step(sums, density, errors.deviation()[free], prior[free])
            density = sums.density(step, inverse, density)
        full_step = np.zeros(COUNT)
        full_step[free] = step
        errors = errors.step(full_step)
        sums.noise_product -= sums.noise_matrix @ step
        if noisy and count < _SHAPED:
            sums.update_shape(density)
            density = np.ones_like(density)
        last_step = float(np.max(np.abs(step) / np.sqrt(np.diag(inverse))))
        if count > 1 and last_step < _CLOSE:
            break
    fitted = _summary(
        recording,
        motion_at,
        errors,
        sums,
        density,
        reference=reference,
        wander=wander,
        prior=prior,
        free=free,
    )
    return fitted._replace(settled=last_step < _SETTLED)


def _step(sums: _Sums, density: Array, deviation: Array, prior: Array) -> tuple[Array, Array]:
    """Return the Gauss-Newton step (p,) and the covariance (p, p) that the weights give."""
    weight = sums.visible_bins(prior) / density
    normal = np.diag(prior**-2) + np.einsum("kaij,ka->ij", sums.matrix - sums.noise_matrix, weight)
    gradient = np.einsum("kai,ka->i", sums.product - sums.noise_product, weight)
    inverse, projection = _inverse(normal, prior)
    return np.asarray(inverse @ (projection.T @ gradient - deviation / prior**2)), inverse


def _inverse(normal: Array, prior: Array) -> tuple[Array, Array]:
    """Return the inverse of a normal matrix with at least the prior's information in any direction.

    The subtraction of the noise's average could leave less: where all of the motion may be noise,
    the readings have no information, and the prior alone holds.

    :returns: the inverse (p, p), and the projection (p, p) on the directions with information,
        whose transpose projects a gradient.
    """
    values, vectors = np.linalg.eigh(normal * np.outer(prior, prior))
    scaled = prior[:, None] * vectors
    inverse = (scaled / np.maximum(values, 1.0)) @ scaled.T
    projection = np.eye(len(prior))
    if (lost := values < 1.0 - _HIDDEN).any():
        directions = vectors[:, lost]
        projection -= prior[:, None] * (directions @ directions.T) / prior
    return inverse, projection


def _summary(
    recording: Recording,
    motion_at: MotionAt,
    errors: Errors,
    sums: _Sums,
    density: Array,
    *,
    reference: float,
    wander: Array,
    prior: Array,
    free: Indices,
) -> Fit:
    """Return the fit with residuals and covariance.

    The covariance is a sandwich ``N^-1 M N^-1`` of the normal matrix N and the sum M of squared
    gradients of single readings, which holds even if the noise is stronger at some times than at
    others (White, "A heteroskedasticity-consistent covariance matrix estimator", Econometrica 48,
    1980).

    :param density: (bins, 6) densities of the residuals over their shape.
    :param reference: time to which the clock's offset refers [s].
    :param wander: (n,) wander of the truth's clock [s].
    :param prior: (42,) standard deviations of the parameters before the fit.
    :param free: (p,) indices of the fitted parameters.
    """
    from scipy.fft import idct

    residuals, slopes = np.zeros((2, len(recording.stamps), 6))
    normal, middle = np.diag(prior[free] ** -2), np.diag(prior[free] ** -2)
    weight = sums.visible_bins(prior[free]) / density
    for k, rows in enumerate(sums.segments):
        linear = model.linearise_readings(
            errors, motion_at, recording.stamps[rows], reference, wander[rows]
        )
        residuals[rows], slopes[rows] = recording.readings[rows] - linear.readings, linear.slope
        weights, remaining = sums.weights_of(k, weight)
        root = np.sqrt(weights)
        # The weights whiten coefficients; back in time, each reading has a gradient of its own.
        j = _cosine_transform(linear.signals, len(root)) @ linear.coefficients[:, :, free]
        j *= root.T[:, :, None]
        flat = j.reshape(-1, len(free))
        normal += flat.T @ flat
        white = idct(
            _cosine_transform(residuals[rows], len(root)) * (root / np.sqrt(remaining)),
            norm="ortho",
            axis=0,
        )
        gradients = np.einsum("ani,na->ni", idct(j, norm="ortho", axis=1), white)
        gradients -= gradients.mean(axis=0)
        middle += gradients.T @ gradients
    # The noise of the poses adds to the normal matrix and shifts the gradient; both are taken off,
    # and the shift counts as an error since it is known to a share only.
    normal -= np.einsum("kaij,ka->ij", sums.noise_matrix, weight)
    noise_gradient = np.einsum("kai,ka->i", sums.noise_product, weight)
    middle += np.outer(noise_gradient, noise_gradient) * _NOISE_KNOWN**2
    inverse, projection = _inverse(normal, prior[free])
    noise_gradient = projection.T @ noise_gradient
    prior_information = np.diag(prior[free] ** -2)
    middle = projection.T @ (middle - prior_information) @ projection + prior_information
    covariance = np.zeros((COUNT, COUNT))
    sandwich = inverse @ middle @ inverse
    # A sandwich of few coefficients is inaccurate: it is never below that of stationary noise.
    widening = np.sqrt(np.maximum(np.diag(inverse) / np.diag(sandwich), 1.0))
    widening *= sums.widening_factors(weight, inverse)
    covariance[np.ix_(free, free)] = sandwich * np.outer(widening, widening)
    covariance[model.CURVATURE, model.CURVATURE] += sums.smoothing**2
    noise_shift = np.zeros(COUNT)
    noise_shift[free] = np.abs(inverse @ noise_gradient) / np.sqrt(np.diag(covariance)[free])
    return Fit(
        errors=errors,
        covariance=covariance,
        residuals=residuals,
        reference=reference,
        wander=wander,
        slope=slopes,
        noise_shift=noise_shift,
        settled=True,
    )


def _segments(pieces: tuple[slice, ...]) -> list[slice]:
    """Return the rows of segments of about equal length into which the pieces are divided."""
    segments = []
    for piece in pieces:
        count = ceil_divide(piece.stop - piece.start, _SEGMENT)
        edges = np.linspace(piece.start, piece.stop, count + 1).astype(int).tolist()
        segments += [slice(a, b) for a, b in pairwise(edges)]
    return segments


def _smooth_density(power: Array) -> Array:
    """Return densities (m, 6) of powers (m, 6): means of neighbours, joined by straight lines."""
    count = max(len(power) // _NARROW, 1)
    edges = np.linspace(0, len(power), count + 1).astype(int)
    means = np.add.reduceat(power, edges[:-1], axis=0) / np.diff(edges)[:, None]
    middle = 0.5 * (edges[1:] + edges[:-1] - 1)
    index = np.arange(len(power))
    return np.column_stack([np.interp(index, middle, column) for column in means.T])


def _cosine_transform(values: Array, count: int) -> Array:
    """Return the first cosine coefficients (count, c) of columns (n, c)."""
    from scipy.fft import dct

    return np.asarray(dct(values, norm="ortho", axis=0)[:count])
