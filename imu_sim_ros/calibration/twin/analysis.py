# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A twin of a sensor on a vehicle: its constant errors, and the vibration that they leave."""

from collections.abc import Callable
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.twin import alignment as clock
from imu_sim_ros.calibration.twin import intensity, spectrum
from imu_sim_ros.calibration.twin.fit import Fit, Recording, fit
from imu_sim_ros.calibration.twin.intensity import Lines, find_lines
from imu_sim_ros.calibration.twin.model import Errors, KnownMotion, predicted, true_times
from imu_sim_ros.calibration.twin.spectrum import Bands, White
from imu_sim_ros.types import Array, Mask

_LOWEST_WHITE: Final = 1.0
"""[Hz] below it the truth's own errors hide a white floor."""
_FOLDS: Final = 4
_LEAST: Final = 0.2
"""Share of a variance that a quarter of a recording takes from it at least."""
_LARGE_SHARE: Final = 0.3
"""Share of a residual that is noise of the poses."""
_BIAS_WINDOW: Final = 5.0
"""[s] over which the bias is averaged."""


class Analysis(NamedTuple):
    """Parameters of a sensor on a vehicle, as a recording determines them."""

    fit: Fit
    lines: Lines
    bands: Bands
    """All of the residual without the lines, at the intensity of the reference motion."""
    white: White
    vibration: Bands
    """What the bands have above the white floor."""
    range_edges: Array
    """(r + 1,) [Hz]."""
    exponents: intensity.Exponents
    reference: Array
    """(3,) RMS of rate, acceleration and speed of the motion."""
    largest: Array
    """(3,) the largest running RMS of these over the reference."""
    parts: tuple[slice, ...]
    """Rows of the recording in motion, from which the spectrum is."""
    bias_t: Array
    """(k,) middle of each window of the bias [s] after the truth's first pose."""
    bias: Array
    """(k, 6) bias over time."""
    bias_sigma: Array
    """(k, 6) standard errors."""


def constant_errors(recording: Recording, truth: KnownMotion, start: Errors) -> Fit:
    """Return the constant errors, and how the truth's clock wanders if it does."""
    found = fit(recording, truth, start)
    if not found.settled:  # a first guess far off: the poses' noise is taken out anew, closer by
        found = fit(recording, truth, found.errors)
    course = clock.wander(recording.stamps, found.residuals, found.slope, recording.rate)
    if course.any():
        found = fit(recording, truth, found.errors, wander=course)
    return found


class Foreseen(NamedTuple):
    """What fits say of a quarter of a recording that they have not seen (cross-validation)."""

    residuals: Array
    """(n, 6) Parameters taken from a short recording explain a part of its noise. What they leave
    of readings they have not seen is what a twin has to simulate."""
    disagreement: Array
    """(42,) RMS of how far these fits are from that to the whole recording, over the standard error
    of that (Hausman 1978: the difference of their variances); 1 if all is as it should be."""


def foreseen(recording: Recording, truth: KnownMotion, found: Fit) -> Foreseen:
    """Return what fits to three quarters of a recording say of the fourth."""
    edges = np.linspace(0, len(recording.stamps), _FOLDS + 1).astype(int)
    residuals, squares = np.empty_like(found.residuals), np.zeros(len(found.sigma))
    for first, last in pairwise(edges.tolist()):
        rows = np.concatenate([np.arange(first), np.arange(last, len(recording.stamps))])
        pieces = []
        for piece in recording.pieces:
            low, high = min(piece.stop, first), max(piece.start, last)
            if low > piece.start:
                pieces.append(slice(piece.start, low))
            if piece.stop > high:
                pieces.append(slice(high - (last - first), piece.stop - (last - first)))
        rest = Recording(
            recording.stamps[rows], recording.readings[rows], tuple(pieces), recording.rate
        )
        other = fit(rest, truth, found.errors, wander=found.wander[rows])
        t = true_times(
            other.errors, recording.stamps[first:last], other.reference, found.wander[first:last]
        )
        own = predicted(other.errors, truth.motion_at, t)[0]
        residuals[first:last] = recording.readings[first:last] - own
        moved = other.errors.referred(found.reference - other.reference)
        variance = other.sigma**2
        variance = np.maximum(variance - found.sigma**2, _LEAST * variance)
        squares += moved.away_from(found.errors) ** 2 / variance
    return Foreseen(residuals, np.sqrt(squares / _FOLDS))


def noise_residuals(recording: Recording, truth: KnownMotion, found: Fit) -> list[Array]:
    """Return the effect of the poses' noise on the residuals (n, 6), drawn several times."""
    t = true_times(found.errors, recording.stamps, found.reference, found.wander)
    own = predicted(found.errors, truth.motion_at, t)[0]
    return [own - predicted(found.errors, other, t)[0] for other in truth.noisy]


def beyond(recording: Recording, whole: KnownMotion, slow: KnownMotion, found: Fit) -> Array:
    """Return what the whole motion reads in addition to its slow part (n, 6)."""
    t = true_times(found.errors, recording.stamps, found.reference, found.wander)
    each = [predicted(found.errors, motion.motion_at, t)[0] for motion in (whole, slow)]
    return each[0] - each[1]


def analyse(
    recording: Recording,
    found: Fit,
    unseen: Array,
    noises: list[Array],
    sizes: Callable[[Array], Array],
    motion: tuple[Array, Array, Array],
    moving: Mask,
) -> Analysis:
    """Return lines, bands and white floor of what a fit leaves, and how they follow the motion.

    :param unseen: (n, 6) residuals of :func:`foreseen`, for the slowest range.
    :param noises: noises of the poses, (n, 6) each; what they have is not the sensor's.
    :param sizes: returns the logarithms (n, 3) of the motion's size relative to a reference (3,).
    :param motion: norms (n,) of rate, acceleration and speed.
    :param moving: (n,) rows in motion: a vehicle at rest does not vibrate as in flight.
    """
    rate = recording.rate
    parts = spectrum.segments(_parts(recording, moving)) or spectrum.segments(recording.pieces)
    lowest = _above_noise(found.residuals, noises, parts, rate)
    lines, residuals = _without_lines(found.residuals, parts, rate, lowest)
    rows = np.concatenate([np.arange(part.start, part.stop) for part in parts])
    reference = np.array([np.sqrt(np.mean(m[rows] ** 2)) for m in motion])
    reference = np.maximum(reference, 1e-3)
    logs = sizes(reference)
    exponents = intensity.follow(residuals, parts, rate, logs)

    def above_noise(followed: Array) -> tuple[Bands, Bands]:
        """Return the bands of the residual, and without what the poses' noise has in them."""
        pairs = [(unseen, residuals), *((x, x) for x in noises)]
        whole, *each = (_bands(list(x), parts, rate, logs, followed) for x in pairs)
        noise = [x.matrix for x in each]
        return whole, whole.less(np.mean(noise, axis=0)) if noise else whole

    whole, bands = above_noise(exponents.value)
    # A sensor's own noise does not follow the motion, and it is in all frequencies, in those that
    # say little of it, too.
    steady, level = above_noise(np.zeros_like(exponents.value))
    floor = spectrum.white_floor(level, _LOWEST_WHITE)
    floor = spectrum.lowered(floor, steady.density.min(axis=0))
    white = spectrum.raised(floor, spectrum.quietest(recording.readings, rate))
    return Analysis(
        found,
        lines,
        bands,
        white,
        spectrum.above(bands, white),
        intensity.range_edges(rate),
        exponents,
        reference,
        np.maximum(np.exp(logs[rows].max(axis=0)), 1.0),
        tuple(parts),
        *_bias_over_time(recording, found, whole),
    )


def _without_lines(
    residuals: Array, parts: list[slice], rate: float, lowest: float
) -> tuple[Lines, Array]:
    """Return the lines of the longest part, and the residuals (n, 6) without those of each."""
    longest = max(parts, key=lambda part: part.stop - part.start)
    lines, rest = find_lines(residuals[longest], rate, lowest)
    if len(lines.frequency):
        residuals = residuals.copy()
        for part in parts:
            other = find_lines(residuals[part], rate, lowest)[1]
            residuals[part] = rest if part == longest else other
    return lines, residuals


def _above_noise(residuals: Array, noises: list[Array], parts: list[slice], rate: float) -> float:
    """Return the frequency [Hz] above which residuals are not mostly noise of the poses."""
    duration = max(part.stop - part.start for part in parts) / rate
    edges = spectrum.band_edges(duration, rate)
    whole = spectrum.cross_spectra(residuals, parts, rate, edges)
    each = [spectrum.cross_spectra(x, parts, rate, edges).density ** 2 for x in noises]
    if not each:
        return 0.0
    noisy = (np.mean(each, axis=0) > _LARGE_SHARE * whole.density**2).any(axis=1)
    return float(whole.high[noisy].max(initial=0.0))


def _parts(recording: Recording, moving: Mask) -> list[slice]:
    """Return the pieces from the first to the last motion in each."""
    result = []
    for piece in recording.pieces:
        rows = np.flatnonzero(moving[piece])
        if len(rows):
            result.append(slice(piece.start + int(rows[0]), piece.start + int(rows[-1]) + 1))
    return result


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
    found = []
    for k, (low, high) in enumerate(pairwise(ranges)):
        own = edges[(edges >= low) & (edges <= high)]
        if len(own) < 2:
            continue
        values = residuals[min(k, 1)]
        if k:  # the slowest range has too few periods in a window
            values, _ = intensity.calmed(values, parts, rate, low, high)
        if exponents[k].any():
            values = values / intensity.factors(exponents[k], logs)
        found.append(spectrum.cross_spectra(values, parts, rate, own))
    low, *others = (np.concatenate(columns) for columns in zip(*found, strict=True))
    low[0] = 0.0  # what is slower than the record can show goes on as it ends
    return Bands(low, *others)


def _bias_over_time(recording: Recording, found: Fit, bands: Bands) -> tuple[Array, Array, Array]:
    """Return times, means over windows of bias and residual, and their standard errors.

    The error of a mean over a window of length W is that of a density S: ``sqrt(S / W)``, with
    the density at the lowest frequencies.
    """
    size = max(round(_BIAS_WINDOW * recording.rate), 1)
    starts = [
        s for p in recording.pieces for s in range(p.start, max(p.stop - size, p.start) + 1, size)
    ]
    rows = [np.arange(s, min(s + size, len(recording.stamps))) for s in starts]
    t = np.array([recording.stamps[r].mean() for r in rows])
    values = np.array([found.residuals[r].mean(axis=0) for r in rows]) + found.errors.bias
    slow = bands.density[bands.low <= 1.0 / _BIAS_WINDOW]
    density = slow.mean(axis=0) if len(slow) else bands.density[0]
    lengths = np.array([len(r) for r in rows])[:, None] / recording.rate
    return t, values, density / np.sqrt(lengths)
