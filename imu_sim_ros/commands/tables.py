# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables that several commands print: calibrations, consistency of covariances."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from imu_sim_ros import program
from imu_sim_ros.calibration.deterministic import correction
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.sensors import auxiliary_sensors
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.types import Array

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
}


def print_all(
    values: correction.Parameters,
    facts: dict[str, Any],
    true: dict[str, Array],
    files: Sequence[Path],
) -> None:
    """Print a calibration's facts, parameters and files."""
    for name, fact in facts.items():
        print(f"{name}: {_shown(fact)}")
    sensors = (*TRIADS, *(sensor.name for sensor in auxiliary_sensors()), "reference")
    for triad in sensors:
        own = {name: found for name, found in values.items() if name.startswith(triad)}
        _print_group(triad, own, true)
    for path in files:
        print(path)


def _print_group(triad: str, values: correction.Parameters, true: dict[str, Array]) -> None:
    """Print the parameters of one sensor, or of both; off: by how many standard errors."""
    header = ["", "value", "sigma", "unit", *(["truth", "off"] if true else [])]
    rows = []
    for name, found in values.items():
        for k, label in enumerate(_labels(len(found.value))):
            short = name.removeprefix(f"{triad}_")
            row = [
                f"{short} {label}",
                f"{found.value[k]:.6g}",
                f"{found.sigma[k]:.2g}" if found.sigma[k] > 0.0 else "",
                _unit(name),
            ]
            if true:
                row += _deviation(found.value[k], found.sigma[k], true[name][k])
            rows.append(row)
    if rows:
        program.print_table(header, rows, f"{triad.capitalize()}; sigma: standard error")


def _unit(name: str) -> str:
    """Return a parameter's unit as declared; for polynomials, the unit of each power k."""
    if name in _UNITS:
        return _UNITS[name]
    declared = parameters(ImuParameters).get(name)
    return declared.unit if declared is not None else "1"


def _shown(fact: object) -> str:
    if isinstance(fact, list):
        return ", ".join(_shown(entry) for entry in fact)
    return f"{fact:.4g}" if isinstance(fact, float) else str(fact)


def _labels(count: int) -> list[str]:
    if count == 9:
        return [f"{row}{column}" for row in "xyz" for column in "xyz"]
    if count == 1:
        return [""]
    orders = count // 3
    return [f"{axis}{k + 1 if orders > 1 else ''}" for k in range(orders) for axis in "xyz"]


def _deviation(value: float, sigma: float, truth: float) -> list[str]:
    """Return the truth and the distance to it in standard errors; a sigma of 0 is exact."""
    if sigma > 0.0:
        shown = f"{abs(value - truth) / sigma:.1f}"
    else:
        shown = "0.0" if np.isclose(value, truth, rtol=_DIGITS, atol=_DIGITS) else ""
    return [f"{truth:.6g}", shown]


def show(result: dict[str, Any]) -> None:
    """Print the table of the NEES."""
    low, high = result["band_95"]
    rows = [
        [name]
        + [f"{result[name][key]:.3g}" for key in ("mean", "final")]
        + [f"{100.0 * result[name]['inside_band']:.0f} %"]
        for name in ("position", "attitude", "velocity")
        if result[name] is not None
    ]
    title = f"NEES, 3 expected; 95 % of the time between {low:.3g} and {high:.3g}"
    if result["gauge"] is not None:
        title += "; yaw and position fixed at the first pose"
    program.print_table(["of", "mean", "final", "inside"], rows, title)
