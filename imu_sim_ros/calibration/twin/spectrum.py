# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The spectrum of what a fit leaves: cross-spectral matrices of the six axes, band by band.

Thomson's multitaper with sine tapers (Riedel and Sidorenko, "Minimum bias multiple taper spectral
estimation", 1995): every taper gives one nearly independent look at the whole record, and matrices
averaged over tapers and frequencies are never negative.
"""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.types import Array, Complex, Mask

_TAPERS: Final = 5
"""Number of tapers."""
_EFFICIENCY: Final = 1.0 / (1.0 + 0.5 / _TAPERS)
"""Share of a record that sine tapers use: the sum of their squares is ``1 - mean of cos 2 pi k t``.
"""
_REACH: Final = 64
"""Distance in frequency bins beyond which the spectra of the tapers do not overlap."""
_LONGEST: Final = 1 << 14
"""Samples transformed at once."""
_SHORTEST: Final = 256
"""Smallest number of samples of a segment."""
_FIRST: Final = 2.0
"""Lower end of the first band, in cycles in a segment."""
_RATIO: Final = 1.3
"""Ratio of the edges of neighbouring bands at the low end."""
_CHANCE: Final = 3.0
"""Largest deviation, in standard deviations, that is taken for chance."""
_MAJORITY: Final = 0.5
"""Share of the rows that must have nothing but the floor."""
_STARTS: Final = (0.5 * _MAJORITY, 0.5)
"""Quantiles from which a floor is looked for: the median if it is a bare majority, and if it is in
all rows, since a few low ones can be mistaken for a floor of their own."""
_KEPT: Final = 0.7
"""Quantile of a floor's rows above which they are left out."""
_ROUNDS: Final = 50
"""Largest number of iterations from one start."""
_WHOLE: Final = 0.8
"""Share of a band's degrees of freedom that noise of the poses must have left."""
_IN_BAND: Final = 10
"""Frequencies in a band of a second."""
_QUIET: Final = 1.0
"""Length of the parts of which the quiet ones are chosen [s]."""
_QUIETER: Final = 0.25
"""Largest power of a quiet part over the median of all parts."""
_MAX_BANDS: Final = 100
"""Bands of equal width up to half the rate."""


class Bands(NamedTuple):
    """m bands of frequencies."""

    low: Array
    """(m,) lower edges [Hz]."""
    high: Array
    """(m,) upper edges [Hz]."""
    matrix: Complex
    """(m, 6, 6) mean two-sided cross-spectral densities."""
    freedom: Array
    """(m, 6) independent squares in each mean: degrees of freedom of a density."""
    independent_share: Array
    """(m,) share of these that neighbouring bands do not have as well."""

    @property
    def density(self) -> Array:
        """(m, 6) roots of the axes' own densities, the diagonals of ``matrix``."""
        return np.sqrt(np.einsum("mii->mi", self.matrix).real)

    @property
    def interval(self) -> Array:
        """(2, m, 6) ends of each density's 95 % interval, as factors of the density."""
        freedom = np.maximum(self.freedom, 1e-3)
        ends = np.stack([_quantile(p, freedom) for p in (0.975, 0.025)])
        return np.sqrt(1.0 / np.maximum(ends, 1e-300))

    def rows(self, chosen: Mask) -> "Bands":
        """Return some of the bands."""
        return Bands._make(column[chosen] for column in self)

    def minus(self, noise: Complex) -> "Bands":
        """Return the bands without an independent noise (m, 6, 6) of known cross-spectral density.

        The difference is as uncertain as the sum: relative to it, the degrees of freedom are fewer.
        """
        noise_density = np.einsum("mii->mi", noise).real
        share = np.clip(noise_density / np.maximum(self.density**2, 1e-300), 0.0, 1.0)
        freedom = self.freedom * (1.0 - share) ** 2
        return self._replace(matrix=_not_negative(self.matrix - noise), freedom=freedom)


def band_edges(duration: float, rate: float) -> Array:
    """Return the edges (m + 1,) [Hz] of bands that a record of some length tells apart.

    Relative widths at the low end, then equal ones.

    :param duration: duration of the longest segment [s].
    :param rate: samples per second [Hz].
    """
    width = max(1.0, 0.5 * rate / _MAX_BANDS)
    edges = [_FIRST / duration]
    while edges[-1] < 0.5 * rate:
        step = max((_RATIO - 1.0) * edges[-1], (_TAPERS - 1.0) / duration)
        edges.append(edges[-1] + min(step, width))
    return np.append(edges[:-1], 0.5 * rate) if edges[-1] > 0.5 * rate else np.array(edges)


def segments(pieces: Sequence[slice]) -> list[slice]:
    """Return pieces, long ones cut into equal parts; too short ones are left out."""
    result = []
    for piece in pieces:
        size = piece.stop - piece.start
        count = ceil_divide(size, _LONGEST)
        edges = np.linspace(piece.start, piece.stop, count + 1).astype(int).tolist()
        if size // max(count, 1) >= _SHORTEST:
            result += [slice(a, b) for a, b in pairwise(edges)]
    return result


def cross_spectra(values: Array, parts: Sequence[slice], rate: float, edges: Array) -> Bands:
    """Return the mean cross-spectral matrices of values (n, 6) in bands.

    :param parts: rows that are transformed together.
    :param edges: (m + 1,) [Hz].
    """
    total = np.zeros((len(edges) - 1, 6, 6), dtype=np.complex128)
    count, freedom = np.zeros((2, len(edges) - 1))
    for part in parts:
        spectra = _taper(values[part], rate)
        frequency = np.arange(spectra.shape[1]) * rate / (part.stop - part.start)
        bounds = np.searchsorted(frequency, edges)
        for band, (begin, end) in enumerate(pairwise(bounds.tolist())):
            x = spectra[:, begin:end].reshape(-1, 6)
            total[band] += np.einsum("ki,kj->ij", x, x.conj())
            count[band] += len(x)
            freedom[band] += _freedom(end - begin)
    has_data = count > 0
    total[has_data] /= count[has_data, None, None]
    independent_share = 2.0 * _EFFICIENCY * count / _TAPERS / np.maximum(freedom, 1.0)
    columns = (edges[:-1], edges[1:], total, np.tile(freedom[:, None], 6), independent_share)
    return Bands(*columns).rows(has_data)


@cache
def _freedom(count: int) -> float:
    """Return the degrees of freedom of a mean over the tapers and neighbouring frequencies.

    Of white noise, spectra x_k(f) have covariances <h_k, h_l e_m>, the spectrum of the product of
    two tapers at the distance m of their frequencies; those of the squares are their squares S(m),
    summed over k and l. The mean over F frequencies has ``2 (K F)^2 / sum_m (F - |m|) S(m)``.
    """
    if not count:
        return 0.0
    apart = np.arange(min(count, _REACH))
    shared = (count - apart) * _squared_cross_spectra()[apart]
    return 2.0 * (_TAPERS * count) ** 2 / float(2.0 * shared.sum() - shared[0])


@cache
def _squared_cross_spectra() -> Array:
    """Return the squared cross-spectra of all pairs of tapers, by distance in frequency bins."""
    n = 4096  # the limit of long records
    angle = np.arange(1, n + 1) * np.pi / (n + 1)
    tapers = np.sqrt(2.0 / (n + 1)) * np.sin(np.arange(1, _TAPERS + 1)[:, None] * angle)
    products = np.fft.fft(tapers[:, None] * tapers, axis=-1)
    return np.asarray(np.sum(np.abs(products) ** 2, axis=(0, 1)))


def _taper(values: Array, rate: float) -> Complex:
    """Return the tapered spectra (tapers, frequencies, 6), scaled so that squares are densities."""
    n = len(values)
    angle = np.arange(1, n + 1) * np.pi / (n + 1)
    centred = values - values.mean(axis=0)
    result = np.empty((_TAPERS, n // 2 + 1, values.shape[1]), dtype=np.complex128)
    for k in range(_TAPERS):
        taper = np.sqrt(2.0 / (n + 1) / rate) * np.sin((k + 1) * angle)
        result[k] = np.fft.rfft(taper[:, None] * centred, axis=0)
    return result


class White(NamedTuple):
    """The white floor of six axes."""

    density: Array
    """(6,) densities of gyroscope [rad/s/sqrt(Hz)] and accelerometer [m/s^2/sqrt(Hz)]."""
    low: Array
    """(6,) lower ends of the 95 % intervals; 0 if vibration hides the floor."""
    high: Array
    """(6,) upper ends of the 95 % intervals."""
    floor: Mask
    """(m, 6) True for bands in which there is nothing but the floor."""


def remove_rounding(white: White, step: Array, rate: float) -> White:
    """Return the floor that a sensor has before its readings are rounded.

    Rounding adds ``step^2 / 12`` to the variance of a sample, as white noise that does not depend
    on the sensor's own (Widrow and Kollar, Quantization Noise, 2008, section 4). Where it is more
    than half of the floor this no longer holds, and the floor is a bound.

    :param step: (6,) digital steps of the readings, 0 if there are none.
    :param rate: samples per second [Hz].
    """
    rounding = step**2 / (12.0 * rate)
    density, low, high = np.sqrt(np.maximum(np.square(white[:3]) - rounding, 0.0))
    hidden = 2.0 * rounding > white.density**2
    return white._replace(
        density=density, low=np.where(hidden, 0.0, low), high=np.where(hidden, white.high, high)
    )


def white_floor(bands: Bands, lowest: float) -> White:
    """Return the density that all bands have in common.

    The mean of the bands that have nothing else, or, if these are no majority, the lowest band,
    which the floor is not above. A band that is not above the floor by more than chance has nothing
    else.

    :param lowest: [Hz] bands below it are not asked.
    """
    power = bands.density**2
    selected = np.flatnonzero(bands.low >= lowest)
    if not len(selected):
        selected = np.arange(len(power))
    density, low, high = np.zeros((3, 6))
    floor = np.zeros(power.shape, dtype=np.bool_)
    for axis in range(6):
        # Bands of which much was noise of the poses are too uncertain.
        whole = selected[
            bands.freedom[selected, axis] > _WHOLE * bands.freedom[selected].max(axis=1)
        ]
        clear = whole if len(whole) else selected
        rows, freedom = power[clear, axis], np.maximum(bands.freedom[clear, axis], 2.0)
        mean, mean_freedom = _floor_mean(rows, freedom) if len(whole) > 1 else (0.0, 0.0)
        mean_freedom *= np.average(bands.independent_share[clear], weights=freedom)
        if mean:
            ends = _quantile(np.array([0.975, 0.025]), mean_freedom)
            density[axis], (low[axis], high[axis]) = np.sqrt(mean), np.sqrt(mean / ends)
            chance = 1.0 + _CHANCE * np.sqrt(2.0 / np.maximum(bands.freedom[:, axis], 1e-3))
            floor[:, axis] = power[:, axis] <= mean * chance
        else:
            density[axis] = np.sqrt(rows.min())
            # Sidak: the lowest of m bands is that low by chance more often than each of them.
            rarest = 1.0 - 0.975 ** (1.0 / len(rows))
            high[axis] = np.sqrt((rows / _quantile(rarest, freedom)).min())
    return White(density, low, high, floor)


def _quantile(p: Array | float, freedom: Array | float) -> Array:
    """Return the quantile of chi-square over its degrees of freedom."""
    from scipy.special import gammaincinv  # instead of chi2.ppf of scipy.stats: quick to import

    half = 0.5 * np.asarray(freedom)
    return np.asarray(gammaincinv(half, p) / half)


def _floor_mean(power: Array, freedom: Array) -> tuple[float, float]:
    """Return the mean power of the white floor and its degrees of freedom; 0, 0: no majority.

    Most of the rows have nothing but the floor; the others have vibration as well. Power a little
    above the floor looks like chance. Rows above the floor's quantile of 70 % are therefore left
    out, and the mean M of the others is that of a chi-square distribution of n degrees of freedom,
    cut off at this quantile: ``M = m F_{n+2}(n x) / F_n(n x)`` with the floor m, the quantile x
    over n, and the distribution function F_n.

    :param power: (m,) power of each band, the mean of squares that are chi-square distributed.
    :param freedom: (m,) degrees of freedom of these means.
    """
    from scipy.special import chdtr

    end = _quantile(_KEPT, freedom)
    part = chdtr(freedom + 2.0, freedom * end) / _KEPT
    for start in _STARTS:
        mean = float(np.quantile(power, start))
        for _ in range(_ROUNDS):
            in_floor = power < end * mean
            if not in_floor.any():
                break
            mean = float(np.sum((power * freedom)[in_floor]) / np.sum((part * freedom)[in_floor]))
        # What chance explains is alike: over m rows with n degrees of freedom, the sum of
        # n / 2 (P / mean - 1)^2 is m, and its variance the sum of 2 + 12 / n (fourth moment).
        near_floor = power <= mean * (1.0 + _CHANCE * np.sqrt(2.0 / freedom))
        spread = float(np.sum((0.5 * freedom * (power / mean - 1.0) ** 2)[near_floor]))
        variance = float(np.sum((2.0 + 12.0 / freedom)[near_floor]))
        alike = spread <= np.count_nonzero(near_floor) + _CHANCE * np.sqrt(variance)
        share = np.count_nonzero(in_floor) / _KEPT / len(power)
        if alike and share >= _MAJORITY:
            break
    else:
        return 0.0, 0.0
    # The mean m is the root of sum n (P - m part) over the floor's rows: its variance is that of
    # this sum over the square of the sum's slope.
    second = (1.0 + 2.0 / freedom) * chdtr(freedom + 4.0, freedom * end)
    variance = freedom**2 * (second - _KEPT * part**2)
    at_end = 0.5 * freedom * _KEPT * (1.0 - part)  # x f_n(x) = n / 2 (F_n(x) - F_{n+2}(x))
    slope = freedom * (_KEPT * part - (end - part) * at_end)
    return mean, 2.0 * share * float(np.sum(slope) ** 2 / np.sum(variance))


def above_floor(bands: Bands, white: White) -> Bands:
    """Return the bands minus the white floor; bands with nothing but the floor are left out."""
    matrix = bands.matrix - np.diag(white.density**2)
    hidden = white.floor
    matrix = np.where(hidden[:, :, None] | hidden[:, None, :], 0.0, matrix)
    shown = np.asarray(~hidden.all(axis=1))
    return bands._replace(matrix=_not_negative(matrix)).rows(shown)


def _not_negative(matrix: Complex) -> Complex:
    """Return Hermitian matrices (m, 6, 6) without their negative eigenvalues."""
    values, vectors = np.linalg.eigh(matrix)
    adjoint = np.conj(np.swapaxes(vectors, 1, 2))
    return (vectors * np.maximum(values, 0.0)[:, None, :]) @ adjoint


def quietest_density(readings: Array, rate: float) -> Array:
    """Return the lowest root density (6,) that the quietest second shows; 0 if none is quiet.

    In a second at rest, above the frequencies of motion, readings show the sensor's own noise. The
    white floor is not below it, even if the residuals of a fit are: a truth that was computed from
    the readings follows their noise. A quiet second has at most half of the usual root density. Its
    lowest band is taken, since rotors may idle.

    :param readings: (n, 6) gyroscope [rad/s], accelerometer [m/s^2].
    :param rate: samples per second [Hz].
    """
    size = round(_QUIET * rate)
    count = (size // 2 - 1) * 4 // 5 // _IN_BAND
    starts = np.arange(0, len(readings) - size + 1, max(size // 2, 1))
    if len(starts) < 2 or count < 1:
        return np.zeros(6)
    windows = readings[starts[:, None] + np.arange(size)]
    taper = np.hanning(size + 2)[1:-1, None]
    spectra = np.fft.rfft(taper * (windows - windows.mean(axis=1, keepdims=True)), axis=1)
    power = np.abs(spectra[:, -count * _IN_BAND - 1 : -1]) ** 2 / (rate * np.sum(taper**2))
    level = power.mean(axis=1)
    second, axes = level.argmin(axis=0), np.arange(6)
    quiet = level[second, axes] <= _QUIETER * np.median(level, axis=0)
    bands = power.reshape(len(starts), count, _IN_BAND, 6).mean(axis=2)
    return np.where(quiet, np.sqrt(bands[second, :, axes].min(axis=1)), 0.0)


def bound_above(white: White, upper: Array) -> White:
    """Return a floor that is at most a root density (6,) on axes on which vibration hides it."""
    hidden = np.minimum(white.density, upper)
    return white._replace(density=np.where(white.low > 0.0, white.density, hidden))


def bound_below(white: White, lower: Array) -> White:
    """Return a floor that is at least a root density (6,)."""
    low = np.where(white.low > 0.0, np.maximum(white.low, lower), 0.0)
    return white._replace(
        density=np.maximum(white.density, lower), low=low, high=np.maximum(white.high, lower)
    )
