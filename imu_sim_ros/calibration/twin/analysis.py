# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A twin of a sensor on a vehicle: its constant errors, and the vibration that they leave."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.twin import alignment as clock
from imu_sim_ros.calibration.twin import intensity, spectrum
from imu_sim_ros.calibration.twin.fit import Fit, Recording, fit
from imu_sim_ros.calibration.twin.intensity import Lines, find_lines
from imu_sim_ros.calibration.twin.model import Errors, KnownMotion, predict_readings, true_times
from imu_sim_ros.calibration.twin.spectrum import Bands, White
from imu_sim_ros.core.types import Array, Mask

_LOWEST_WHITE: Final = 1.0
"""Lowest frequency of the white floor: below it the truth's own errors hide it [Hz]."""
_FOLDS: Final = 4
"""Number of parts of a recording, each of which is predicted by a fit to the others."""
_LEAST: Final = 0.2
"""Smallest share of a variance that a quarter of a recording contributes."""
_LARGE_SHARE: Final = 0.3
"""Largest share of the poses' noise in a residual."""
_BIAS_WINDOW: Final = 5.0
"""Window of the mean bias [s]."""


class Analysis(NamedTuple):
    """Parameters of a sensor on a vehicle, as a recording determines them."""

    fit: Fit
    lines: Lines
    bands: Bands
    """Bands of the residual without the lines, at the intensity of the reference motion."""
    white: White
    vibration: Bands
    """Bands above the white floor."""
    range_edges: Array
    """(r + 1,) edges of the ranges [Hz]."""
    exponents: intensity.Exponents
    reference: Array
    """(3,) RMS of rate, acceleration and speed of the motion."""
    largest: Array
    """(3,) largest running RMS of these over the reference."""
    parts: tuple[slice, ...]
    """Rows of the recording in motion, from which the spectrum is computed."""
    bias_t: Array
    """(k,) middle of each window of the bias [s] after the truth's first pose."""
    bias: Array
    """(k, 6) bias over time."""
    bias_sigma: Array
    """(k, 6) standard errors."""


def constant_errors(recording: Recording, truth: KnownMotion, start: Errors) -> Fit:
    """Return a fit of the constant errors, and of the wander of the truth's clock, if it has any.

    :param start: first guess with mounting and offset.
    """
    fitted = fit(recording, truth, start)
    if not fitted.settled:  # a poor first guess: remove the poses' noise again, with better values
        fitted = fit(recording, truth, fitted.errors)
    course = clock.wander(recording.stamps, fitted.residuals, fitted.slope, recording.rate)
    if course.any():
        fitted = fit(recording, truth, fitted.errors, wander=course)
    return fitted


class CrossValidation(NamedTuple):
    """Predictions of a quarter of a recording by fits to the other three (cross-validation)."""

    residuals: Array
    """(n, 6) residuals of readings that were not used in the fit: the noise that a twin has to
    simulate. A fit to a short recording explains a part of its noise."""
    disagreement: Array
    """(42,) RMS difference of these fits from that to the whole recording, over its standard error
    (Hausman 1978: the difference of the variances); 1 is the expectation."""


def cross_validate(recording: Recording, truth: KnownMotion, whole_fit: Fit) -> CrossValidation:
    """Return the predictions of each quarter of a recording by a fit to the other three."""
    edges = np.linspace(0, len(recording.stamps), _FOLDS + 1).astype(int)
    residuals, squares = np.empty_like(whole_fit.residuals), np.zeros(len(whole_fit.sigma))
    for begin, end in pairwise(edges.tolist()):
        rows = np.concatenate([np.arange(begin), np.arange(end, len(recording.stamps))])
        pieces = []
        for piece in recording.pieces:
            low, high = min(piece.stop, begin), max(piece.start, end)
            if low > piece.start:
                pieces.append(slice(piece.start, low))
            if piece.stop > high:
                pieces.append(slice(high - (end - begin), piece.stop - (end - begin)))
        remainder = Recording(
            recording.stamps[rows], recording.readings[rows], tuple(pieces), recording.rate
        )
        part_fit = fit(remainder, truth, whole_fit.errors, wander=whole_fit.wander[rows])
        t = true_times(
            part_fit.errors,
            recording.stamps[begin:end],
            part_fit.reference,
            whole_fit.wander[begin:end],
        )
        predictions = predict_readings(part_fit.errors, truth.motion_at, t)[0]
        residuals[begin:end] = recording.readings[begin:end] - predictions
        moved = part_fit.errors.shift_reference(whole_fit.reference - part_fit.reference)
        variance = part_fit.sigma**2
        variance = np.maximum(variance - whole_fit.sigma**2, _LEAST * variance)
        squares += moved.away_from(whole_fit.errors) ** 2 / variance
    return CrossValidation(residuals, np.sqrt(squares / _FOLDS))


def noise_residuals(recording: Recording, truth: KnownMotion, fitted: Fit) -> list[Array]:
    """Return the effect of the poses' noise on the residuals (n, 6), for several draws."""
    t = true_times(fitted.errors, recording.stamps, fitted.reference, fitted.wander)
    predictions = predict_readings(fitted.errors, truth.motion_at, t)[0]
    return [
        predictions - predict_readings(fitted.errors, noisy_motion, t)[0]
        for noisy_motion in truth.noisy
    ]


def fast_part(recording: Recording, whole: KnownMotion, slow: KnownMotion, fitted: Fit) -> Array:
    """Return the readings (n, 6) of the whole motion minus those of its slow part."""
    t = true_times(fitted.errors, recording.stamps, fitted.reference, fitted.wander)
    predictions = [
        predict_readings(fitted.errors, motion.motion_at, t)[0] for motion in (whole, slow)
    ]
    return predictions[0] - predictions[1]


def analyse(
    recording: Recording,
    fitted: Fit,
    held_out_residuals: Array,
    noises: list[Array],
    sizes: Callable[[Array], Array],
    motion: tuple[Array, Array, Array],
    moving: Mask,
) -> Analysis:
    """Return lines, bands and white floor of a fit's residual, and their exponents of motion.

    :param held_out_residuals: (n, 6) residuals of :func:`cross_validate`, for the slowest range.
    :param noises: effects of the poses' noise, (n, 6) each, which are not the sensor's.
    :param sizes: returns the logarithms (n, 3) of the motion's size relative to a reference (3,).
    :param motion: norms (n,) of rate, acceleration and speed.
    :param moving: (n,) rows in motion: a vehicle at rest does not vibrate as in flight.
    """
    rate = recording.rate
    parts = spectrum.segments(_rows_in_motion(recording, moving)) or spectrum.segments(
        recording.pieces
    )
    lowest = _noise_limit(fitted.residuals, noises, parts, rate)
    lines, residuals = _remove_lines(fitted.residuals, parts, rate, lowest)
    rows = np.concatenate([np.arange(part.start, part.stop) for part in parts])
    reference = np.array([np.sqrt(np.mean(m[rows] ** 2)) for m in motion])
    reference = np.maximum(reference, 1e-3)
    logs = sizes(reference)
    exponents = intensity.fit_exponents(residuals, parts, rate, logs)
    bands_for = partial(
        _bands_with_and_without_noise, (held_out_residuals, residuals), noises, parts, rate, logs
    )
    whole, bands = bands_for(exponents.value)
    # The sensor's white noise does not depend on the motion, and is present at all frequencies.
    constant_whole, constant_bands = bands_for(np.zeros_like(exponents.value))
    floor = spectrum.white_floor(constant_bands, _LOWEST_WHITE)
    floor = spectrum.bound_above(floor, constant_whole.density.min(axis=0))
    white = spectrum.bound_below(floor, spectrum.quietest_density(recording.readings, rate))
    bias_t, bias, bias_sigma = _bias_over_time(recording, fitted, whole)
    return Analysis(
        fit=fitted,
        lines=lines,
        bands=bands,
        white=white,
        vibration=spectrum.above_floor(bands, white),
        range_edges=intensity.range_edges(rate),
        exponents=exponents,
        reference=reference,
        largest=np.maximum(np.exp(logs[rows].max(axis=0)), 1.0),
        parts=tuple(parts),
        bias_t=bias_t,
        bias=bias,
        bias_sigma=bias_sigma,
    )


def _bands_with_and_without_noise(
    residuals: tuple[Array, Array],
    noises: list[Array],
    parts: list[slice],
    rate: float,
    logs: Array,
    exponents: Array,
) -> tuple[Bands, Bands]:
    """Return the bands of the residuals, and the same bands without the noise of the poses.

    :param residuals: (n, 6) for the slowest range, and for all others.
    :param noises: effects of the poses' noise, (n, 6) each; the mean of their bands is subtracted.
    :param parts: rows in motion.
    :param rate: samples per second [Hz].
    :param logs: (n, 3) logarithms of the motion's size.
    :param exponents: (ranges, 2, 3) exponents of :class:`intensity.Exponents`.
    """
    whole = _bands(list(residuals), parts, rate, logs, exponents)
    if not noises:
        return whole, whole
    matrices = [_bands([noise, noise], parts, rate, logs, exponents).matrix for noise in noises]
    return whole, whole.minus(np.mean(matrices, axis=0))


def _remove_lines(
    residuals: Array, parts: list[slice], rate: float, lowest: float
) -> tuple[Lines, Array]:
    """Return the lines of the longest part, and the residuals (n, 6) without the lines of each."""
    longest = max(parts, key=lambda part: part.stop - part.start)
    lines, longest_remainder = find_lines(residuals[longest], rate, lowest)
    if len(lines.frequency):
        residuals = residuals.copy()
        for part in parts:
            remainder = find_lines(residuals[part], rate, lowest)[1]
            residuals[part] = longest_remainder if part == longest else remainder
    return lines, residuals


def _noise_limit(residuals: Array, noises: list[Array], parts: list[slice], rate: float) -> float:
    """Return the frequency [Hz] above which residuals are not mostly noise of the poses."""
    duration = max(part.stop - part.start for part in parts) / rate
    edges = spectrum.band_edges(duration, rate)
    whole = spectrum.cross_spectra(residuals, parts, rate, edges)
    noise_powers = [spectrum.cross_spectra(x, parts, rate, edges).density ** 2 for x in noises]
    if not noise_powers:
        return 0.0
    noisy = (np.mean(noise_powers, axis=0) > _LARGE_SHARE * whole.density**2).any(axis=1)
    return float(whole.high[noisy].max(initial=0.0))


def _rows_in_motion(recording: Recording, moving: Mask) -> list[slice]:
    """Return the rows from the first to the last motion of each gap-free piece of a recording."""
    parts = []
    for piece in recording.pieces:
        rows = np.flatnonzero(moving[piece])
        if len(rows):
            parts.append(slice(piece.start + int(rows[0]), piece.start + int(rows[-1]) + 1))
    return parts


def _bands(
    residuals: list[Array], parts: list[slice], rate: float, logs: Array, exponents: Array
) -> Bands:
    """Return the bands of the residual, each range at the intensity of the reference motion.

    :param residuals: (n, 6) for the slowest range, and for all others.
    """
    duration = max(part.stop - part.start for part in parts) / rate
    edges = spectrum.band_edges(duration, rate)
    ranges = intensity.range_edges(rate)
    edges = np.unique(np.concatenate([edges, ranges[(ranges > edges[0]) & (ranges < edges[-1])]]))
    columns_by_range = []
    for k, (low, high) in enumerate(pairwise(ranges)):
        range_edges = edges[(edges >= low) & (edges <= high)]
        if len(range_edges) < 2:
            continue
        values = residuals[min(k, 1)]
        if k:  # the slowest range has too few periods in a window
            values, _ = intensity.remove_disturbances(values, parts, rate, low, high)
        if exponents[k].any():
            values = values / intensity.factors(exponents[k], logs)
        columns_by_range.append(spectrum.cross_spectra(values, parts, rate, range_edges))
    low, *remaining = (np.concatenate(columns) for columns in zip(*columns_by_range, strict=True))
    low[0] = 0.0  # the lowest band extends to frequencies below those of the record
    return Bands(low, *remaining)


def _bias_over_time(recording: Recording, fitted: Fit, bands: Bands) -> tuple[Array, Array, Array]:
    """Return times (k,) [s], means (k, 6) of bias plus residual in windows, and their errors.

    The error of a mean over a window of length W is that of a density S: ``sqrt(S / W)``, with
    the density at the lowest frequencies.
    """
    size = max(round(_BIAS_WINDOW * recording.rate), 1)
    starts = [
        s for p in recording.pieces for s in range(p.start, max(p.stop - size, p.start) + 1, size)
    ]
    rows = [np.arange(s, min(s + size, len(recording.stamps))) for s in starts]
    t = np.array([recording.stamps[r].mean() for r in rows])
    values = np.array([fitted.residuals[r].mean(axis=0) for r in rows]) + fitted.errors.bias
    slow = bands.density[bands.low <= 1.0 / _BIAS_WINDOW]
    density = slow.mean(axis=0) if len(slow) else bands.density[0]
    lengths = np.array([len(r) for r in rows])[:, None] / recording.rate
    return t, values, density / np.sqrt(lengths)
