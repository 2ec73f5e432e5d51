# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameters with which ``simulator`` and ``generate`` are the twin."""

from typing import Final

import numpy as np

from imu_sim_ros.calibration.twin.analysis import Analysis
from imu_sim_ros.calibration.twin.fit import Fit
from imu_sim_ros.calibration.twin.model import BIAS
from imu_sim_ros.calibration.twin.spectrum import Bands
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.kinds import SMALLEST, Value

_DIGITS: Final = 9
"""Significant digits of a parameter."""
_BAND_DIGITS: Final = 4
"""Significant digits of the bands' densities and coherences."""
MOTION_FLOOR: Final = 0.2
"""Smallest size of the motion over the reference for which intensities are computed."""
MOTION_TIME: Final = 0.3
"""Time of the running means that intensities depend on [s]."""


def simulator_parameters(analysis: Analysis, rate: float, step: Array) -> dict[str, Value]:
    """Return the parameters of the twin by their ROS names.

    :param step: (6,) digital steps of the readings, 0 if there are none.
    """
    errors = analysis.fit.errors
    bias_sigma = analysis.fit.sigma[BIAS]
    values: dict[str, Value] = {
        "rate": float(rate),
        "imu.preset": "perfect",
        "imu.mounting": _numbers(_orthonormal(errors.r_ib.T)),
        "imu.lever_arm": _numbers(errors.lever_arm),
        "imu.stamp_offset": clock_offset(analysis.fit),
        "imu.clock_skew_ppm": round(1e6 * clock_skew(analysis.fit), 6),
        "imu.gyroscope_bias": _numbers(errors.bias[:3]),
        "imu.gyroscope_turn_on_bias_sigma": _numbers(bias_sigma[:3], 3),
        "imu.gyroscope_scale_misalignment": _numbers(errors.response[:3, :3]),
        "imu.gyroscope_g_sensitivity": _numbers(errors.response[:3, 3:]),
        "imu.gyroscope_noise_density": _numbers(analysis.white.density[:3]),
        "imu.accelerometer_bias": _numbers(errors.bias[3:]),
        "imu.accelerometer_turn_on_bias_sigma": _numbers(bias_sigma[3:], 3),
        "imu.accelerometer_scale_misalignment": _numbers(errors.response[3:, 3:]),
        "imu.accelerometer_noise_density": _numbers(analysis.white.density[3:]),
    }
    if step.any():
        values["imu.gyroscope_resolution"] = _numbers(step[:3])
        values["imu.accelerometer_resolution"] = _numbers(step[3:])
    values |= {f"imu.vibration.{name}": value for name, value in _vibration(analysis).items()}
    return values


def clock_offset(fit: Fit) -> float:
    """Return the stamp's error at the truth's first pose [s]: ``stamp = t + offset + skew t``."""
    skew = fit.errors.skew
    return round((skew * fit.reference - fit.errors.offset) / (1.0 + skew), 9)


def clock_skew(fit: Fit) -> float:
    """Return the relative error of the stamps' rate; above 0: their clock is fast."""
    return 1.0 / (1.0 + fit.errors.skew) - 1.0


def _vibration(analysis: Analysis) -> dict[str, Value]:
    """Return the parameters of the vibration that the residuals show."""
    values: dict[str, Value] = {}
    lines, bands = analysis.lines, analysis.vibration
    if len(lines.frequency):
        values["line_frequency"] = _numbers(lines.frequency)
        values["line_amplitude"] = _numbers(lines.amplitude, 6)
        values["line_phase"] = _numbers(lines.phase, 6)
    if len(bands.low):
        values["band_low"] = _numbers(bands.low)
        values["band_high"] = _numbers(bands.high)
        values["band_density"] = _numbers(bands.density, _BAND_DIGITS)
        values["band_coherence"] = _numbers(coherence(bands), _BAND_DIGITS)
    if analysis.exponents.value.any() and values:
        values["range_edges"] = _numbers(analysis.range_edges[1:-1])
        values["gyroscope_exponents"] = _numbers(analysis.exponents.value[:, 0], 4)
        values["accelerometer_exponents"] = _numbers(analysis.exponents.value[:, 1], 4)
        values["reference_motion"] = _numbers(analysis.reference)
        values["motion_floor"] = MOTION_FLOOR
        values["motion_ceiling"] = _numbers(analysis.largest)
        values["motion_time"] = MOTION_TIME
    return values


def coherence(bands: Bands) -> Array:
    """Return real and imaginary part of the complex coherence of the 15 pairs (m, 15, 2)."""
    rows, columns = np.triu_indices(6, 1)
    size = bands.density
    product = size[:, rows] * size[:, columns]
    cross = bands.matrix[:, rows, columns]
    values = np.divide(cross, product, out=np.zeros_like(cross), where=product > 0.0)
    return np.clip(np.stack([values.real, values.imag], axis=-1), -1.0, 1.0)


def _orthonormal(r: Array) -> Array:
    """Return the rotation matrix nearest to a matrix (3, 3)."""
    u, _, vt = np.linalg.svd(r)
    return u @ vt


def _numbers(values: Array, digits: int = _DIGITS) -> tuple[float, ...]:
    """Return rounded numbers; those below the smallest value of a parameter become 0."""
    sizes = np.where(np.abs(values) < SMALLEST, 0.0, values)
    return tuple(float(f"{value:.{digits}g}") for value in np.ravel(sizes))
