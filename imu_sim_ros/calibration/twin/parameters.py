# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameters with which ``simulator`` and ``generate`` are the twin."""

from typing import Final

import numpy as np

from imu_sim_ros.calibration.twin.analysis import Analysis
from imu_sim_ros.calibration.twin.fit import Fit
from imu_sim_ros.calibration.twin.model import BIAS
from imu_sim_ros.calibration.twin.spectrum import Bands
from imu_sim_ros.parameters.kinds import SMALLEST, Value
from imu_sim_ros.types import Array

_DIGITS: Final = 9
_BAND_DIGITS: Final = 4
MOTION_FLOOR: Final = 0.2
MOTION_TIME: Final = 0.3
"""[s] of the running means that intensities follow."""


def simulator_parameters(found: Analysis, rate: float, step: Array) -> dict[str, Value]:
    """Return parameters by name.

    :param step: (6,) digital steps of the readings, 0 if there are none.
    """
    errors = found.fit.errors
    unsure = found.fit.sigma[BIAS]
    result: dict[str, Value] = {
        "rate": float(rate),
        "imu.preset": "perfect",
        "imu.mounting": _numbers(_orthonormal(errors.r_ib.T)),
        "imu.lever_arm": _numbers(errors.lever_arm),
        "imu.stamp_offset": clock_offset(found.fit),
        "imu.clock_skew_ppm": round(1e6 * clock_skew(found.fit), 6),
        "imu.gyroscope_bias": _numbers(errors.bias[:3]),
        "imu.gyroscope_turn_on_bias_sigma": _numbers(unsure[:3], 3),
        "imu.gyroscope_scale_misalignment": _numbers(errors.gyroscope),
        "imu.gyroscope_g_sensitivity": _numbers(errors.g_sensitivity),
        "imu.gyroscope_noise_density": _numbers(found.white.density[:3]),
        "imu.accelerometer_bias": _numbers(errors.bias[3:]),
        "imu.accelerometer_turn_on_bias_sigma": _numbers(unsure[3:], 3),
        "imu.accelerometer_scale_misalignment": _numbers(errors.accelerometer),
        "imu.accelerometer_noise_density": _numbers(found.white.density[3:]),
    }
    if step.any():
        result["imu.gyroscope_resolution"] = _numbers(step[:3])
        result["imu.accelerometer_resolution"] = _numbers(step[3:])
    result |= {f"imu.vibration.{name}": value for name, value in _vibration(found).items()}
    return result


def clock_offset(fit: Fit) -> float:
    """Return the stamp's error at the truth's first pose [s]: ``stamp = t + offset + skew t``."""
    skew = fit.errors.skew
    return round((skew * fit.reference - fit.errors.offset) / (1.0 + skew), 9)


def clock_skew(fit: Fit) -> float:
    """Return the rate error of the stamps."""
    return 1.0 / (1.0 + fit.errors.skew) - 1.0


def _vibration(found: Analysis) -> dict[str, Value]:
    result: dict[str, Value] = {}
    lines, bands = found.lines, found.vibration
    if len(lines.frequency):
        result["line_frequency"] = _numbers(lines.frequency)
        result["line_amplitude"] = _numbers(lines.amplitude, 6)
        result["line_phase"] = _numbers(lines.phase, 6)
    if len(bands.low):
        result["band_low"] = _numbers(bands.low)
        result["band_high"] = _numbers(bands.high)
        result["band_density"] = _numbers(bands.density, _BAND_DIGITS)
        result["band_coherence"] = _numbers(coherence(bands), _BAND_DIGITS)
    if found.exponents.value.any() and result:
        result["range_edges"] = _numbers(found.range_edges[1:-1])
        result["gyroscope_exponents"] = _numbers(found.exponents.value[:, 0], 4)
        result["accelerometer_exponents"] = _numbers(found.exponents.value[:, 1], 4)
        result["reference_motion"] = _numbers(found.reference)
        result["motion_floor"] = MOTION_FLOOR
        result["motion_ceiling"] = _numbers(found.largest)
        result["motion_time"] = MOTION_TIME
    return result


def coherence(bands: Bands) -> Array:
    """Return real and imaginary part of the complex coherence of the 15 pairs (m, 15, 2)."""
    rows, columns = np.triu_indices(6, 1)
    size = bands.density
    product = size[:, rows] * size[:, columns]
    cross = bands.matrix[:, rows, columns]
    values = np.divide(cross, product, out=np.zeros_like(cross), where=product > 0.0)
    return np.clip(np.stack([values.real, values.imag], axis=-1), -1.0, 1.0)


def _orthonormal(r: Array) -> Array:
    u, _, vt = np.linalg.svd(r)
    return u @ vt


def _numbers(values: Array, digits: int = _DIGITS) -> tuple[float, ...]:
    """Return them rounded; below what a parameter may be is what rounding left of nothing."""
    sizes = np.where(np.abs(values) < SMALLEST, 0.0, values)
    return tuple(float(f"{value:.{digits}g}") for value in np.ravel(sizes))
