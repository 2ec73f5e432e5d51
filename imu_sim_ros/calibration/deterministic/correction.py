# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Output of a calibration: parameters for the simulator, a correction for the integrator."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from imu_sim_ros.calibration.deterministic.ellipsoid import Ellipsoid, symmetric_root
from imu_sim_ros.calibration.deterministic.gravity_norm import upper_triangular
from imu_sim_ros.calibration.deterministic.positions import SixPosition
from imu_sim_ros.calibration.deterministic.temperature import Temperature
from imu_sim_ros.calibration.deterministic.turntable import Turntable
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.digits import plus_minus
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import Value
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.imu.parameters import ImuParameters


class Calibrated(NamedTuple):
    """A parameter of the simulator with its standard errors, both flat arrays."""

    value: Array
    sigma: Array

    def __repr__(self) -> str:
        pairs = zip(self.value, self.sigma, strict=True)
        texts = ", ".join(plus_minus(value, sigma) for value, sigma in pairs)
        return f"<Calibrated {texts}; standard errors>"


Parameters = dict[str, Calibrated]

SOFT_IRON = "magnetometer_soft_iron"
HARD_IRON = "magnetometer_hard_iron"
_CORRECTION = (
    "gyroscope_bias",
    "accelerometer_bias",
    "gyroscope_scale_misalignment",
    "accelerometer_scale_misalignment",
    "gyroscope_g_sensitivity",
)


def six_position_parameters(result: SixPosition) -> Parameters:
    """Return the parameters of a six-position run by their names below ``imu.``."""
    return {
        "accelerometer_scale_misalignment": _flat(
            result.scale_misalignment, result.scale_misalignment_sigma
        ),
        "accelerometer_bias": _flat(result.bias, result.bias_sigma),
        "gyroscope_bias": _flat(result.gyroscope_bias, result.gyroscope_bias_sigma),
    }


def turntable_parameters(result: Turntable) -> Parameters:
    """Return the parameters of a run on a rate table."""
    values = {
        "gyroscope_scale_misalignment": _flat(
            result.scale_misalignment, result.scale_misalignment_sigma
        ),
        "gyroscope_bias": _flat(result.bias, result.bias_sigma),
    }
    if result.g_sensitivity is not None and result.g_sensitivity_sigma is not None:
        values["gyroscope_g_sensitivity"] = _flat(result.g_sensitivity, result.g_sensitivity_sigma)
    return values


def magnetometer_parameters(result: Ellipsoid) -> Parameters:
    """Return the parameters of a run with a magnetometer."""
    return {
        SOFT_IRON: _flat(result.soft_iron, result.soft_iron_sigma),
        HARD_IRON: _flat(result.hard_iron, result.hard_iron_sigma),
    }


def temperature_parameters(result: Temperature) -> Parameters:
    """Return the parameters of a soak or ramp run; biases and scales are those at T0."""
    values = {"reference_temperature": _flat(np.array([result.reference]), np.zeros(1))}
    for name, triad in result.triads.items():
        axes = triad.axes
        p = triad.inputs.shape[1]
        values[f"{name}_bias"] = _flat(
            np.array([a.bias[0] for a in axes]), np.array([a.bias_sigma[0] for a in axes])
        )
        if p >= 3:
            gain = np.array([a.gain for a in axes]), np.array([a.gain_sigma for a in axes])
            values[f"{name}_scale_misalignment"] = _flat(gain[0][:, :3], gain[1][:, :3])
        if p == 6:
            values[f"{name}_g_sensitivity"] = _flat(gain[0][:, 3:], gain[1][:, 3:])
        polynomials = {
            "bias": [(a.bias[1:], a.bias_sigma[1:]) for a in axes],
            "scale": [(a.scale, a.scale_sigma) for a in axes],
        }
        for kind, rows in polynomials.items():
            order = max(len(row) for row, _ in rows)
            if order:
                table = [[np.pad(x, (0, order - len(x))) for x in pair] for pair in rows]
                stacked: Array = np.array(table)  # (axis, value or sigma, order)
                values[f"{name}_temperature_{kind}"] = _flat(stacked[:, 0].T, stacked[:, 1].T)
    return values


def _flat(value: Array, sigma: Array) -> Calibrated:
    return Calibrated(np.ravel(value), np.ravel(sigma))


def write_simulator(values: Parameters, path: Path, comment: str) -> None:
    """Write the parameters for ``simulator`` and ``generate``, to be layered over a sensor."""
    files.write({f"imu.{n}": _value(n, v.value) for n, v in values.items()}, path, comment=comment)


def write_correction(values: Parameters, path: Path, comment: str) -> None:
    """Write the correction for ``integrator`` and ``dead_reckon``: x = S^-1 (reading - b).

    The correction of a magnetometer is for other programs: matrix and bias of
    ``field = matrix (reading - bias)``.
    """
    if SOFT_IRON in values:
        matrix = values[SOFT_IRON].value.reshape(3, 3)
        inverse: Array = np.linalg.inv(matrix).astype(np.float64)
        correction = {
            "bias": _value(HARD_IRON, values[HARD_IRON].value),
            "matrix": _value(SOFT_IRON, inverse.ravel()),
        }
        files.write(correction, path, "magnetometer", comment)
        return
    files.write(integrator_parameters(values), path, comment=comment)


def integrator_parameters(values: Parameters) -> dict[str, Value]:
    """Return the correction as parameters of the integrator."""
    return {n: _value(n, v.value) for n, v in values.items() if n in _CORRECTION}


def _value(name: str, value: Array) -> Value:
    """Return numbers with nine significant digits for a parameter file."""
    numbers = tuple(float(f"{x:.9g}") for x in value)
    return numbers[0] if name == "reference_temperature" else numbers


def true_parameters(imu: ImuParameters, values: Mapping[str, Calibrated]) -> dict[str, Array]:
    """Return the truth of each calibrated parameter; percent forms are turned into matrices."""
    truths = flatten(imu)
    for triad in TRIADS:
        truths[f"{triad}_scale_misalignment"] = tuple(imu.triad(triad).response().ravel().tolist())
    m, b = imu.magnetometer.response_and_bias()
    truths |= {SOFT_IRON: tuple(symmetric_root(m).ravel().tolist()), HARD_IRON: tuple(b.tolist())}
    true_values = {}
    for name, calibrated in values.items():
        truth = np.ravel(np.asarray(truths[name], dtype=np.float64))
        size = max(len(calibrated.value), len(truth))
        true_values[name] = np.pad(truth, (0, size - len(truth)))
    return true_values


def turn_to_upper_triangular(true: dict[str, Array]) -> None:
    """Turn the accelerometer's true axes to those of the fit of the norm, in place."""
    name = "accelerometer_scale_misalignment"
    true[name] = upper_triangular(true[name].reshape(3, 3)).ravel()
