# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What ``twin`` found, as tables."""

from typing import Final

import numpy as np

from imu_sim_ros.api.twin import Check, Twin, labels
from imu_sim_ros.calibration.twin import comparison
from imu_sim_ros.commands import common
from imu_sim_ros.conventions import AXES, TRIADS

_UNITS: Final = {
    "stamp_offset": "s",
    "clock_skew_ppm": "ppm",
    "mounting": "rad",
    "lever_arm": "m",
    "gyroscope_bias": "rad/s",
    "gyroscope_g_sensitivity": "(rad/s)/(m/s^2)",
    "accelerometer_bias": "m/s^2",
    "truth_curvature": "s^2",
    "truth_turn": "rad",
}


def print_twin(found: Twin) -> None:
    """Print all that was found."""
    rows = []
    for name, calibrated in found.errors.items():
        for label, value, sigma in zip(
            labels(len(calibrated.value)), calibrated.value, calibrated.sigma, strict=True
        ):
            if sigma != 0.0:
                unit = _UNITS.get(name, "1")
                mark = "no" if f"{name} {label}" in found.undetermined else ""
                numbers = ["not given", ""] if np.isnan(value) else [f"{value:.6g}", f"{sigma:.2g}"]
                rows.append([f"{name} {label}".strip(), *numbers, unit, mark])
    common.print_table(
        ["", "value", "sigma", "unit", "determined"],
        rows,
        "Constant errors; sigma: standard error; mounting: rotation vector of R_ib",
    )
    noise = found.source.noise
    if noise.there:
        angle, distance = 1e3 * noise.deviation
        print(
            f"the poses scatter by {distance:.3g} mm and {angle:.3g} mrad; their motion stands out "
            f"of that up to {found.source.cutoff:.3g} Hz, the cut-off"
        )
    if found.clock_wander > 0.0:
        print(
            f"the truth's clock wanders by {1e3 * found.clock_wander:.2f} ms RMS beside offset and "
            "skew; that is taken out and not simulated"
        )
    _print_white(found)
    _print_lines(found)
    _print_intensity(found)
    if found.check is not None:
        _print_check(found.check)


def _print_white(found: Twin) -> None:
    white = found.analysis.white
    rows = []
    for k, (triad, axis) in enumerate((t, a) for t in TRIADS for a in AXES):
        hidden = white.low[k] == 0.0
        value = f"< {white.high[k]:.3g}" if hidden else f"{white.density[k]:.4g}"
        interval = "" if hidden else f"{white.low[k]:.4g} .. {white.high[k]:.4g}"
        rows.append([f"{triad} {axis}", value, interval])
    title = f"White floor; {len(found.analysis.vibration.low)} bands of vibration above it"
    common.print_table(["[unit/sqrt(Hz)]", "value", "95 % interval"], rows, title)


def _print_lines(found: Twin) -> None:
    lines = found.analysis.lines
    rows = [
        [f"{f:.4f}", f"{s:.2g}", *(f"{a:.3g} +- {e:.1g}" for a, e in zip(size, error, strict=True))]
        for f, s, size, error in zip(
            lines.frequency,
            lines.frequency_sigma,
            lines.amplitude,
            lines.amplitude_sigma,
            strict=True,
        )
    ]
    if rows:
        names = [f"{triad}{axis}" for triad in "ga" for axis in AXES]
        common.print_table(["line [Hz]", "sigma", *names], rows, "Lines: amplitudes [rad/s, m/s^2]")


def _print_intensity(found: Twin) -> None:
    exponents, edges = found.analysis.exponents, found.analysis.range_edges
    rows = []
    for k in range(len(edges) - 1):
        for triad, name in enumerate(TRIADS):
            if exponents.value[k, triad].any():
                values = zip(exponents.value[k, triad], exponents.sigma[k, triad], strict=True)
                rows.append(
                    [f"{edges[k]:g}-{edges[k + 1]:g} Hz {name}"]
                    + [f"{v:.2f} +- {s:.2f}" if v else "" for v, s in values]
                )
    if rows:
        title = "Intensity follows the motion: exponents"
        common.print_table(["", "rate", "acceleration", "speed"], rows, title)


def _print_check(check: Check) -> None:
    rows = []
    for band, (low, high) in enumerate(comparison.BANDS):
        values = check.decibels[band]
        rows.append(
            [
                f"{low:g}-{high:g} Hz",
                *("" if np.isnan(v) else f"{round(v, 1) + 0.0:+.1f}" for v in values),
            ]
        )
    names = [f"{triad}{axis}" for triad in "ga" for axis in AXES]
    title = f"Twin over real sensor on the {check.seconds:.1f} s it has not seen [dB]"
    common.print_table(["density", *names], rows, title)
    drift = zip((1, 2, 5), check.real_drift, check.simulated_drift, strict=True)
    for seconds, real, simulated in drift:
        print(
            f"dead-reckoned for {seconds} s: median error {simulated:.3g} m, the real sensor's "
            f"{real:.3g} m ({100.0 * (simulated / real - 1.0):+.0f} %)"
        )
    louder = ", ".join(f"{20.0 * np.log10(r):+.1f}" for r in check.truth_noise)
    print(f"noise of the truth itself on this part over that of the fitted one: {louder} dB")
    print(f"a classifier tells windows apart in {100.0 * check.told_apart:.0f} % (50 %: it cannot)")
