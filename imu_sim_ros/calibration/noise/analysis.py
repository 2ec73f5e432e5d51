# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Allan analysis of an IMU at rest: from messages to noise parameters."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.deviation import Deviation, DeviationAccumulator
from imu_sim_ros.calibration.noise.estimate import (
    KEYS,
    RAMP,
    AxisNoise,
    Estimate,
    UsableBand,
    common_estimates,
    estimate,
    explains_wander,
    usable_band,
)
from imu_sim_ros.calibration.noise.gauss_markov import GAUSS_MARKOV_KEYS, estimate_gauss_markov
from imu_sim_ros.calibration.noise.losses import LossFiller
from imu_sim_ros.calibration.noise.slow_signals import LevelShift, Line, Signal, Transient
from imu_sim_ros.calibration.noise.spectrum import Spectrum, SpectrumAccumulator
from imu_sim_ros.calibration.noise.terms import (
    FLICKER,
    FLICKER_FLOOR,
    QUANTISATION,
    QUANTITIES,
    WALK,
    WHITE,
)
from imu_sim_ros.calibration.record import AXES, Record, Timing
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.types import Array
from imu_sim_ros.recordings.findings.catalogue import rest_findings
from imu_sim_ros.recordings.findings.roles import RestRecord

SHORTEST: Final = 60.0
"""Shortest analysable rest [s]."""
_SHORT: Final = 3600.0
"""Length of a rest below which a random walk is barely visible [s]."""
_MOVING_SHARE: Final = 0.01
"""Share of the rest in motion from which on an analysis is meaningless."""
_TABLE_RATE: Final = 0.5
"""Mean rate that is worth reporting [rad/s]."""
_DISTURBED_SHARE: Final = 0.05
"""Share of the rest with disturbances from which on an analysis is meaningless."""
_COARSE: Final = 0.55
"""Deviation of the readings, in steps, below which the rounding dominates. At 0.55 the noise is
between 0.45 and 0.48 steps, wherever the mean lies."""
_HIDDEN: Final = 0.58
"""Largest deviation of noise and rounding together if the readings are coarse, in steps."""
MODELS: Final = ("standard", "gauss_markov")
UNITS: Final = ("rad/s", "m/s^2")


class AllanResult(NamedTuple):
    """The analysis of an IMU at rest; axes are gyroscope x y z, accelerometer x y z."""

    timing: Timing
    duration: float
    """Length of the analysed rest [s]."""
    deviation: Deviation
    noise: tuple[AxisNoise | None, ...]
    """Noise by axis; None: not analysed."""
    bands: tuple[UsableBand | None, ...]
    """Frequencies used by axis; None: not analysed."""
    mean: Array
    """(6,) mean readings [rad/s, m/s^2]."""
    model: str
    """``standard`` or ``gauss_markov``."""
    warnings: tuple[str, ...]
    """Lines about stamps, readings and estimates that limit the result."""
    reasons: dict[str, str]
    """Reason by axis that is not analysed."""

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the model's parameters, also if no axis has an estimate."""
        return KEYS if self.model == "standard" else GAUSS_MARKOV_KEYS

    @property
    def record(self) -> str:
        """Length and rate of the record as text: ``4 h at 200 Hz``."""
        units = ((3600.0, "h"), (60.0, "min"), (1.0, "s"))
        size, unit = next(
            unit_size for unit_size in units if self.duration >= unit_size[0] or unit_size[0] == 1.0
        )
        return f"{self.duration / size:.3g} {unit} at {self.timing.rate:.6g} Hz"

    def estimate(self, axis: int, key: str) -> Estimate:
        """Return a parameter of one axis; an axis that is not analysed has no information."""
        noise = self.noise[axis]
        return Estimate(None, 0.0, np.inf) if noise is None else noise.estimates[key]


def analyse(
    bags: Iterable[Iterable[Readings]],
    *,
    model: str = "standard",
    force: bool = False,
    advance: Callable[[int], None] = lambda count: None,
) -> AllanResult:
    """Return the Allan deviation and the noise parameters of one IMU at rest.

    :param bags: messages of each bag, in blocks, which have passed the gate.
    :param model: ``standard`` (Q, N, B, K, R) or ``gauss_markov`` (N and a Gauss-Markov process).
    :param force: continue if a check finds that the result would be meaningless.
    :param advance: called with the number of messages read.
    :raises InputError: with a line for each check that fails.
    """
    record = Record()
    rest = _accumulate(record, bags, advance)
    spectra, longest = rest.spectra, rest.longest_piece / record.rate
    # A constant zero is not a measurement. Another constant may be noise below the resolution: then
    # the axis is left out, unless all axes are constant.
    constant = record.constant_axes()
    dead = [k for k in constant if len(constant) == len(AXES) or record.lowest.value[k] == 0.0]
    timing = record.timing()
    if rest.longest_piece < SHORTEST * record.rate:
        problems = _problems(record, longest, spectra.signals, None, dead)
        raise InputError([*_stamp_warnings(timing), *problems])
    spectrum = spectra.result().at_rate(timing.rate).with_losses(rest.lost)
    problems = _problems(record, longest, spectra.signals, spectrum, dead)
    if problems and not force:
        raise InputError([*_stamp_warnings(timing), *problems])
    # A constant axis bounds no noise.
    reasons = {
        axis: f"always {record.lowest.value[axis] + 0.0:g}: a dead axis, or noise far below the "
        "resolution"
        for axis in constant
    }
    bands = [None if k in reasons else usable_band(spectrum, k) for k in range(6)]
    smoother = spectra.result(doubtful=False).at_rate(timing.rate).with_losses(rest.lost)
    estimate_axis = estimate if model == "standard" else estimate_gauss_markov
    noise: list[AxisNoise | None] = []
    for k, band in enumerate(bands):
        if band is None:
            noise.append(None)
            continue
        certain = [signal for signal in spectra.signals if signal.axis == k]
        doubtful = [signal for signal in spectra.doubtful if signal.axis == k]
        axis_noise = _estimate_with_signals(
            partial(estimate_axis, axis=k), band, (spectrum, smoother), certain, doubtful
        )
        decays = [signal for signal in certain if isinstance(signal, Transient)]
        if decays and RAMP in axis_noise.estimates:
            axis_noise = _drop_ramp(axis_noise, decays, timing.rate, longest)
        noise.append(_add_step_uncertainty(axis_noise, record, k))
    warnings = [
        *_record_warnings(record, timing, longest, reasons, dead),
        *problems,
        *_noise_warnings(bands, spectra.signals, spectra.doubtful, noise, timing.rate),
    ]
    deviation = rest.deviations.result()
    return AllanResult(
        timing=timing,
        duration=rest.samples / timing.rate,
        deviation=deviation._replace(tau=deviation.size / timing.rate),
        noise=tuple(noise),
        bands=tuple(bands),
        mean=record.mean,
        model=model,
        warnings=tuple(warnings),
        reasons={AXES[k]: reason for k, reason in reasons.items()},
    )


def _estimate_with_signals(
    estimate_rows: Callable[[Spectrum], AxisNoise],
    band: UsableBand,
    spectra: tuple[Spectrum, Spectrum],
    certain: list[Signal],
    doubtful: list[Signal],
) -> AxisNoise:
    """Return the noise of an axis; with doubtful signals, what holds with and without them.

    :param estimate_rows: estimator of the axis from the rows of a spectrum.
    :param band: frequencies that are used.
    :param spectra: spectra of the readings without the certain signals, and without all signals.
    """
    spectrum, smoother = spectra
    noise = estimate_rows(spectrum.rows(band.used & ~spectrum.rows_of_lines(certain)))
    if not doubtful:
        return noise
    rows = smoother.rows(band.used & ~smoother.rows_of_lines(certain + doubtful))
    strict = not all(isinstance(signal, Line) for signal in doubtful)
    return common_estimates(noise, estimate_rows(rows), strict=strict)


class _Rest(NamedTuple):
    """Readings at rest of all bags: their sums and counts."""

    deviations: DeviationAccumulator
    spectra: SpectrumAccumulator
    samples: int
    """Number of readings."""
    longest_piece: int
    """Number of readings in the longest piece without a gap."""
    lost: float
    """Share of the readings that were lost and filled in."""


def _accumulate(
    record: Record, bags: Iterable[Iterable[Readings]], advance: Callable[[int], None]
) -> _Rest:
    """Accumulate the readings at rest for the Allan deviation and the spectrum.

    :param record: receives all readings.
    :raises InputError: if there are none.
    """
    losses = LossFiller(6)
    accumulators: tuple[DeviationAccumulator, SpectrumAccumulator] | None = None
    samples = piece = longest_piece = 0
    for y in record.at_rest(bags, advance):
        if accumulators is None:  # the first readings determine the rate
            accumulators = DeviationAccumulator(record.rate, 6), SpectrumAccumulator(record.rate, 6)
        if y is not None and not np.isnan(y[:, 0]).all():
            filled = losses.fill(y)
            for accumulator in accumulators:
                accumulator.add(filled)
            piece += len(y)
            samples += len(y)
            longest_piece = max(longest_piece, piece)
        elif piece:
            for accumulator in accumulators:
                accumulator.end_piece()
            piece = 0
    if accumulators is None:
        raise InputError("no Imu messages")
    lost = losses.samples / samples if samples else 0.0
    return _Rest(*accumulators, samples, longest_piece, lost)


def _drop_ramp(
    noise: AxisNoise, decays: Sequence[Transient], rate: float, longest: float
) -> AxisNoise:
    """Return the estimates of an axis with removed transients: without a value of the ramp.

    A slow transient and a ramp look alike, so the upper bound of the ramp grows by the steepest
    slope of a transient in the middle of a piece of length T, ``size / tau exp(-T / (2 tau))``.

    :param decays: transients that were removed from the readings; ``tau`` in samples.
    :param rate: samples per second [Hz].
    :param longest: length T of the longest piece [s].
    """
    slopes = [
        abs(decay.size)
        * rate
        / decay.time_constant
        * np.exp(-0.5 * longest * rate / decay.time_constant)
        for decay in decays
    ]
    bound = Estimate(None, 0.0, noise.estimates[RAMP].high + float(max(slopes)))
    chosen = tuple(key for key in noise.chosen if key != RAMP)
    return noise._replace(estimates=noise.estimates | {RAMP: bound}, chosen=chosen, trend=0.0)


def _add_step_uncertainty(noise: AxisNoise, record: Record, axis: int) -> AxisNoise:
    """Return the estimates of an axis with the uncertainty that its digital step adds.

    If the readings are coarse, no term has a value, and each bound is at least what the rounding
    can hide: an error of half a step either way, whose Allan deviation is below a step.
    """
    step, deviation = float(record.steps.step[axis]), float(record.rest.noise()[axis])
    estimates = dict(noise.estimates)
    if step > 0.0 and deviation < _COARSE * step:
        seconds = record.samples / record.rate
        hidden = {
            WHITE.key: _HIDDEN * step / np.sqrt(record.rate),
            QUANTISATION.key: step / record.rate / np.sqrt(3.0),
            FLICKER.key: step / FLICKER_FLOOR,
            WALK.key: step * np.sqrt(3.0 / seconds),
            RAMP: step * np.sqrt(2.0) / seconds,
        }
        for key, term in estimates.items():
            estimates[key] = Estimate(None, 0.0, max(term.high, float(hidden.get(key, 0.0))))
        return noise._replace(estimates=estimates, chosen=())
    if step == 0.0:
        return noise
    # The relative uncertainty of the readings' variance that rounding leaves.
    x = max((deviation / step) ** 2 - 1.0 / 12.0, 0.0)
    share = (1.0 / np.pi**2 + 4.0 * x) * np.exp(-2.0 * np.pi**2 * x)
    doubt = 0.5 * float(share / max(x + 1.0 / 12.0, 1e-12))
    white = estimates[WHITE.key]
    estimates[WHITE.key] = white._replace(
        low=white.low * (1.0 - doubt), high=white.high * (1.0 + doubt)
    )
    return noise._replace(estimates=estimates)


def _problems(
    record: Record,
    longest: float,
    signals: Sequence[Signal],
    spectrum: Spectrum | None,
    dead: Sequence[int],
) -> list[str]:
    """Return a line for each reason why an analysis would be meaningless.

    :param longest: the longest piece [s].
    :param spectrum: None: the record is too short for one.
    :param dead: axes without a measurement.
    """
    problems = [
        f"{AXES[k]}: always {record.lowest.value[k] + 0.0:g}: a missing or dead axis, or no noise "
        f"at all; all six axes must be measured ({argument('skip_checks', True)} leaves it out)"
        for k in dead
    ]
    rest = record.rest
    lines = [signal for signal in signals if isinstance(signal, Line)]
    swaying = {n.axis for n in lines if rest.sways(n.axis, n.amplitude, 1.0 / n.frequency)}
    suspects = {m.axis for m in rest.moving} - swaying
    walks = set()
    if spectrum is not None:  # axes whose noise explains their drift
        for axis in suspects:
            if explains_wander(spectrum.rows(usable_band(spectrum, axis).used), axis):
                walks.add(axis)
    motions = [m for m in rest.moving if m.axis not in walks or rest.is_sudden(m)]
    # Stretches in which several axes move count once.
    moving = sum(m.end - m.begin for m in {m.begin: m for m in motions}.values())
    motion_texts: list[str] = []
    if moving > _MOVING_SHARE * rest.seconds:
        # A rate of 1 rad/s counts as much as 10 m/s^2, about gravity.
        worst = max(motions, key=lambda m: m.size / (1.0 if m.axis < 3 else 10.0))
        motion_texts.append(
            f"the {AXES[worst.axis]} moves by {worst.size:.3g} "
            f"{UNITS[worst.axis // 3]} between {worst.begin:.0f} and {worst.end:.0f} s"
        )
    disturbed = sum(m.end - m.begin for m in rest.disturbed)
    if disturbed > _DISTURBED_SHARE * rest.seconds:
        first_disturbance = rest.disturbed[0]
        motion_texts.append(
            f"{len(rest.disturbed)} disturbances of {disturbed:.0f} s in all, "
            f"the first {first_disturbance.begin:.0f} s after the start on the "
            f"{AXES[first_disturbance.axis]}"
        )
    problems += [finding.sentence() for finding in rest_findings(RestRecord(tuple(motion_texts)))]
    if longest < SHORTEST:
        problems.append(
            f"{longest:.1f} s at rest without a gap: at least {SHORTEST:.0f} s are needed, "
            "an hour for white noise and flicker, several for a random walk"
        )
    return problems


def _stamp_warnings(timing: Timing) -> Iterator[str]:
    """Yield the lines about stamps that are corrected."""
    if timing.duplicates:
        yield (
            f"{timing.duplicates} messages repeat the one before them and were dropped "
            "[messages_repeated]"
        )
    yield from timing.remarks


def _record_warnings(
    record: Record,
    timing: Timing,
    longest: float,
    reasons: Mapping[int, str],
    dead: Collection[int],
) -> Iterator[str]:
    """Yield warnings about the stamps, the readings and the rest of a record.

    :param longest: the longest piece [s].
    :param reasons: reasons of axes that are not analysed.
    :param dead: axes that are reported as problems.
    """
    if timing.lost:
        yield (
            f"{timing.lost} samples lost in short losses were replaced by draws from the noise "
            "of the record, given all around them"
        )
    if timing.gaps:
        yield (
            f"{timing.gaps} gaps, the longest {timing.longest_gap:.3f} s: "
            "the pieces between them are analysed separately and combined"
        )
    yield from _stamp_warnings(timing)
    share = timing.jitter * timing.rate
    if share > 0.1 and not timing.remarks:
        yield (
            f"stamps jitter by {timing.jitter * 1e3:.3f} ms, {100 * share:.0f} % of the interval; "
            "equal intervals are assumed"
        )
    for axis, mean in enumerate(record.mean[:3]):
        if abs(mean) > _TABLE_RATE:
            yield (
                f"{AXES[axis]}: its mean is {mean:.3g} rad/s, a large bias or a turning table; "
                "a steady rate does not change the noise"
            )
    noise, saturated = record.rest.noise(), record.saturated_axes()
    for axis, step in enumerate(record.steps.step):
        if axis in reasons:
            if axis not in dead:
                yield f"{AXES[axis]}: {reasons[axis]}; it is not analysed"
        elif step > 0.0 and noise[axis] < _COARSE * step:
            yield f"{AXES[axis]}: the resolution of {step:.3g} hides the noise: upper bounds only"
        for _, value, share in (entry for entry in saturated if entry[0] == axis):
            yield f"{AXES[axis]}: {100 * share:.2g} % of the samples are {value:g}: saturated"
    for motion in record.rest.disturbed[:5]:
        yield (
            f"disturbance cut out at {motion.begin:.0f} s: {AXES[motion.axis]}, "
            f"{motion.size:.3g} {UNITS[motion.axis // 3]}"
        )
    if longest < _SHORT:
        yield (
            f"{longest / 60.0:.0f} min without a gap: a random walk needs hours; "
            "expect an upper bound for it"
        )


def _noise_warnings(
    bands: Iterable[UsableBand | None],
    signals: Iterable[Signal],
    doubtful: Iterable[Signal],
    noise: Sequence[AxisNoise | None],
    rate: float,
) -> Iterator[str]:
    """Yield warnings about the parts of the spectrum that the model does not describe.

    :param doubtful: slow signals that may exist instead of a term.
    """
    for axis, band in enumerate(bands):
        if band is None:
            continue
        if band.limit < 0.49 * rate:
            yield (
                f"{AXES[axis]}: the spectrum above {band.limit:.3g} Hz is not the model's "
                "(low-pass filter or vibration) and was left out"
            )
        if band.lines:
            frequencies = ", ".join(f"{f:.3g}" for f in band.lines[:5])
            yield f"{AXES[axis]}: vibration at {frequencies} Hz was left out"
    for signal in signals:
        yield f"{_signal_text(signal, rate)} was taken out"
    for signal in doubtful:
        axis_noise = noise[signal.axis]
        if axis_noise is not None and axis_noise.withheld:
            triad = TRIADS[signal.axis // 3]
            texts = " and ".join(QUANTITIES[triad, key].text for key in axis_noise.withheld)
            yield (
                f"{_signal_text(signal, rate)} explains the record as well as {texts}: only bounded"
            )
    yield from _process_warnings(noise)


def _signal_text(signal: Signal, rate: float) -> str:
    """Return axis, kind, size and time of a signal as text."""
    axis, unit = AXES[signal.axis], UNITS[signal.axis // 3]
    if isinstance(signal, Line):
        period = 1.0 / (signal.frequency * rate)
        return (
            f"{axis}: a sinusoid of {signal.amplitude:.3g} {unit} with a period of {period:.4g} s"
        )
    if isinstance(signal, LevelShift):
        seconds = signal.position / rate
        return f"{axis}: a shift of level of {signal.size:.3g} {unit} at {seconds:.0f} s"
    seconds = signal.time_constant / rate
    return f"{axis}: a warm-up of {signal.size:.3g} {unit} with a time constant of {seconds:.3g} s"


def _process_warnings(noise: Sequence[AxisNoise | None]) -> Iterator[str]:
    """Yield warnings about axes that the standard model does not describe, with a better model."""
    fits = {
        AXES[k]: axis.process
        for k, axis in enumerate(noise)
        if axis is not None and axis.process is not None
    }
    instead = {axis: process for axis, process in fits.items() if process.gain_over_model > 0.0}
    additional = {axis: process for axis, process in fits.items() if axis not in instead}
    if instead:
        gains = _range_text([process.gain_over_model for process in instead.values()])
        yield (
            f"{', '.join(instead)}: N, B and K do not describe the record; white noise with a "
            f"Gauss-Markov process fits better, by a log-likelihood of {gains}: use "
            f"{argument('model', 'gauss_markov')}"
        )
    if additional:
        gains = _range_text([process.gain_within_model for process in additional.values()])
        times = _range_text([process.correlation_time for process in additional.values()])
        yield (
            f"{', '.join(additional)}: N, B and K alone do not describe the record; with a "
            f"Gauss-Markov process of {times} s beside them it fits better, by a log-likelihood of "
            f"{gains}, which {argument('model', 'gauss_markov')} finds with white noise alone"
        )


def _range_text(values: Sequence[float]) -> str:
    """Return ``low to high`` of some values as text, or one number if they agree to two digits."""
    low, high = f"{min(values):.2g}", f"{max(values):.2g}"
    return low if low == high else f"{low} to {high}"
