# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibrations as text: deterministic errors, and twins."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING, Final

import numpy as np

from imu_sim_ros.calibration.deterministic import correction
from imu_sim_ros.core.conventions import AXES, TRIADS
from imu_sim_ros.core.digits import deviation_texts, interval_texts, plus_minus, upper_bound
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.sensors import sensors_of_imus
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.terminal.text_tables import TextTable

if TYPE_CHECKING:
    from imu_sim_ros.calibration.twin.analysis import Analysis
    from imu_sim_ros.calibration.twin.intensity import Lines
    from imu_sim_ros.jobs.twin_check import Check
    from imu_sim_ros.jobs.twin_recording import TwinRecording

_DIGITS = 1e-12  # of a noise-free result, relative
_UNITS = {
    "gyroscope_bias": "rad/s",
    "accelerometer_bias": "m/s^2",
    "gyroscope_g_sensitivity": "(rad/s)/(m/s^2)",
    "gyroscope_temperature_bias": "rad/s/K^k",
    "accelerometer_temperature_bias": "m/s^2/K^k",
    "gyroscope_temperature_scale": "1/K^k",
    "accelerometer_temperature_scale": "1/K^k",
    "reference_temperature": "degC",
    "mounting": "rad",
    "truth_curvature": "s^2",
    "truth_turn": "rad",
}


def calibration_lines(
    values: correction.Parameters,
    facts: Mapping[str, object],
    true: Mapping[str, Array],
) -> Iterator[str | TextTable]:
    """Yield a calibration's facts and parameters."""
    for name, fact in facts.items():
        yield f"{name}: {_format_fact(fact)}"
    sensors = (*TRIADS, *(sensor.name for sensor in sensors_of_imus()), "reference")
    for triad in sensors:
        triad_values = {
            name: calibrated for name, calibrated in values.items() if name.startswith(triad)
        }
        if triad_values:
            yield _group(triad, triad_values, true)


def _group(triad: str, values: correction.Parameters, true: Mapping[str, Array]) -> TextTable:
    """Return the parameters of one sensor, or of both; off: by how many standard errors."""
    header = ["", "value", "sigma", *(["truth", "off"] if true else [])]
    rows, units = [], []
    for name, calibrated in values.items():
        short = name.removeprefix(f"{triad}_")
        units.append(f"{short} [{_unit(name)}]")
        for k, label in enumerate(_labels(len(calibrated.value))):
            value, deviation = float(calibrated.value[k]), float(calibrated.sigma[k])
            truth = [float(true[name][k])] if true else []
            sigma_text, *texts = deviation_texts(deviation, value, *truth)
            row = [f"{short} {label}", texts[0], sigma_text, *texts[1:]]
            rows.append(row + [_distance(value, deviation, entry) for entry in truth])
    title = f"{triad.capitalize()}: {', '.join(units)}; sigma: standard error"
    return TextTable(header, rows, f"{title}, off: in standard errors" if true else title)


def _unit(name: str) -> str:
    """Return a parameter's unit as declared; for polynomials, the unit of each power k."""
    if name in _UNITS:
        return _UNITS[name]
    declared = parameters(ImuParameters).get(name)
    return (declared.unit if declared is not None else "") or "1"


def _format_fact(fact: object) -> str:
    """Return a number, or a list of numbers, as text."""
    if isinstance(fact, list):
        return ", ".join(_format_fact(entry) for entry in fact)
    return f"{fact:.4g}" if isinstance(fact, float) else str(fact)


def _labels(count: int) -> list[str]:
    """Return the labels of the entries of a parameter: axes, entries of a matrix, orders."""
    if count == 9:
        return [f"{row}{column}" for row in "xyz" for column in "xyz"]
    if count == 1:
        return [""]
    orders = count // 3
    return [f"{axis}{k + 1 if orders > 1 else ''}" for k in range(orders) for axis in "xyz"]


def _distance(value: float, sigma: float, truth: float) -> str:
    """Return the distance to the truth in standard errors; a sigma of 0 is exact."""
    if sigma > 0.0:
        return f"{abs(value - truth) / sigma:.1f}"
    return "0.0" if np.isclose(value, truth, rtol=_DIGITS, atol=_DIGITS) else ""


_SIX: Final = [f"{triad}{axis}" for triad in "ga" for axis in AXES]


def twin_lines(
    errors: correction.Parameters,
    undetermined: Collection[str],
    source: TwinRecording,
    clock_wander: float,
    analysis: Analysis,
    check: Check | None,
) -> Iterator[str | TextTable]:
    """Yield the text of a twin; arguments are the fields of :class:`imu_sim_ros.Twin`."""
    rows = []
    for name, calibrated in errors.items():
        for label, value, sigma in zip(
            _labels(len(calibrated.value)), calibrated.value, calibrated.sigma, strict=True
        ):
            if sigma != 0.0:
                mark = "no" if f"{name} {label}" in undetermined else ""
                sigma_text, text = deviation_texts(float(sigma), float(value))
                numbers = ["not given", ""] if np.isnan(value) else [text, sigma_text]
                rows.append([f"{name} {label}".strip(), *numbers, mark])
    estimated = (name for name, calibrated in errors.items() if calibrated.sigma.any())
    units = [f"{name} [{_unit(name)}]" for name in estimated]
    yield TextTable(
        ["", "value", "sigma", "determined"],
        rows,
        f"Constant errors: {', '.join(units)}; sigma: standard error; mounting: rotation vector of "
        "R_ib",
    )
    noise = source.noise
    if noise.is_present:
        angle, distance = 1e3 * noise.deviation
        yield (
            f"noise of the poses: {distance:.3g} mm and {angle:.3g} mrad; the motion exceeds it up "
            f"to {source.cutoff:.3g} Hz, the cut-off"
        )
    if clock_wander > 0.0:
        yield (
            f"the truth's clock wanders by {1e3 * clock_wander:.2f} ms RMS around offset and skew; "
            "this is removed and not simulated"
        )
    yield _white_floor(analysis)
    if len(analysis.lines.frequency):
        yield from _spectral_lines(analysis.lines)
    yield from _intensity(analysis)
    if check is not None:
        yield from _check_lines(check)


def _white_floor(analysis: Analysis) -> TextTable:
    """Return the table of the white noise of the readings."""
    white = analysis.white
    rows = []
    for k, (triad, axis) in enumerate((t, a) for t in TRIADS for a in AXES):
        if white.low[k] == 0.0:
            rows.append([f"{triad} {axis}", upper_bound(float(white.high[k])), ""])
            continue
        ends = (white.density[k], white.low[k], white.high[k])
        value, low, high = interval_texts(*map(float, ends))
        rows.append([f"{triad} {axis}", value, f"{low} .. {high}"])
    title = f"White floor; {len(analysis.vibration.low)} bands of vibration above it"
    return TextTable(["[unit/sqrt(Hz)]", "value", "95 % interval"], rows, title)


def _spectral_lines(lines: Lines) -> Iterator[TextTable]:
    """Yield the amplitudes of the lines, a table for each triad."""
    for triad, (name, unit) in enumerate(zip(TRIADS, ("rad/s", "m/s^2"), strict=True)):
        columns = slice(3 * triad, 3 * triad + 3)
        rows = [
            [
                plus_minus(float(frequency), float(sigma)),
                *map(plus_minus, amplitudes[columns].tolist(), deviations[columns].tolist()),
            ]
            for frequency, sigma, amplitudes, deviations in zip(
                *(lines.frequency, lines.frequency_sigma, lines.amplitude, lines.amplitude_sigma),
                strict=True,
            )
        ]
        title = f"Lines of the {name}: amplitudes [{unit}]; \N{PLUS-MINUS SIGN} standard error"
        yield TextTable(["frequency [Hz]", *AXES], rows, title)


def _intensity(analysis: Analysis) -> Iterator[TextTable]:
    """Yield tables of noise that grows with the intensity of the motion."""
    exponents, edges = analysis.exponents, analysis.range_edges
    rows = []
    for k in range(len(edges) - 1):
        for triad, name in enumerate(TRIADS):
            if exponents.value[k, triad].any():
                values = zip(exponents.value[k, triad], exponents.sigma[k, triad], strict=True)
                rows.append(
                    [f"{edges[k]:g}-{edges[k + 1]:g} Hz {name}"]
                    + [plus_minus(float(v), float(s)) if v else "" for v, s in values]
                )
    if rows:
        title = "Exponents of the vibration's intensity; \N{PLUS-MINUS SIGN} standard error"
        yield TextTable(["", "rate", "acceleration", "speed"], rows, title)


def _check_lines(check: Check) -> Iterator[str | TextTable]:
    """Yield the comparison of the twin's readings with the recorded ones, by frequency."""
    from imu_sim_ros.calibration.twin.comparison import BANDS

    rows = [
        [f"{low:g}-{high:g} Hz"]
        + ["" if np.isnan(v) else f"{round(v, 1) + 0.0:+.1f}" for v in values]
        for (low, high), values in zip(BANDS, check.decibels, strict=True)
    ]
    title = f"Density of the twin over that of the sensor, {check.seconds:.1f} s held out [dB]"
    yield TextTable(["density", *_SIX], rows, title)
    drift = zip((1, 2, 5), check.real_drift, check.simulated_drift, strict=True)
    for seconds, real, simulated in drift:
        yield (
            f"median error after {seconds} s of dead reckoning: twin {simulated:.3g} m, real "
            f"sensor {real:.3g} m ({100.0 * (simulated / real - 1.0):+.0f} %)"
        )
    louder = ", ".join(f"{20.0 * np.log10(r):+.1f}" for r in check.truth_noise)
    yield f"noise of the true poses, held-out part over fitted part: {louder} dB"
    twin, real = 100.0 * check.told_apart, 100.0 * check.real_told_apart
    yield (
        f"a classifier separates windows of twin and real sensor with an accuracy of {twin:.0f} %, "
        f"windows of the sensor in both parts with {real:.0f} % (chance: 50 %)"
    )
