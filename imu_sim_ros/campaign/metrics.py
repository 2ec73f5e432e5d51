# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbers that a run is judged by."""

import re
from collections.abc import Collection
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import shown
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.navigation.comparison import absolute_errors, distances, pairs, relative_errors
from imu_sim_ros.poses import PoseSequence

Array = NDArray[np.float64]
Metrics = dict[str, float | None]

POSE: Final = (
    "ate_rmse_m",
    "ate_rmse_rad",
    "final_position_error_m",
    "final_attitude_error_rad",
    "drift_percent",
)
STATE: Final = (
    "final_velocity_error_m_s",
    "nees_position",
    "nees_attitude",
    "nees_velocity",
    "attitude_sigma_rad",
)
COMMAND: Final = ("scale_error", "initialisation_s", "wall_s", "real_time_factor", "peak_memory_mb")
"""Metrics of programs that describe the execution and are not reproducible."""

NOISE: Final = ("noise_density", "random_walk", "bias_instability", "rate_ramp", "quantisation")
"""Metrics of campaigns of ``allan``, for each triad."""
CALIBRATED: Final = (
    "accelerometer_scale_misalignment",
    "accelerometer_bias",
    "gyroscope_scale_misalignment",
    "gyroscope_bias",
    "gyroscope_g_sensitivity",
)
"""Metrics of campaigns of ``calibrate``."""
THERMAL: Final = tuple(
    f"{triad}_temperature_{kind}" for triad in TRIADS for kind in ("bias", "scale")
)
"""Polynomials: their coefficients have different units, so that only their sigmas are."""


def calibration_names(kinds: Collection[str]) -> tuple[str, ...]:
    """Return the names of the metrics of calibrations."""
    names: list[str] = []
    if "allan" in kinds:
        quantities = [f"{triad}_{key}" for triad in TRIADS for key in NOISE]
        names += [f"{one}_{kind}" for one in quantities for kind in ("ratio", "covered")]
    if {"six_position", "turntable", "temperature"} & set(kinds):
        names += [f"{one}_{kind}" for one in CALIBRATED for kind in ("error", "sigmas")]
    if "temperature" in kinds:
        names += [f"{one}_sigmas" for one in THERMAL]
    return tuple(names)


class Relative(NamedTuple):
    """A distance or time that relative errors are taken over."""

    delta: float
    unit: str
    """s or m."""

    @property
    def names(self) -> tuple[str, str]:
        """The metrics: translation and rotation."""
        return f"rpe_{self.delta:g}{self.unit}_m", f"rpe_{self.delta:g}{self.unit}_rad"


def parse_relative(content: object) -> tuple[Relative, ...]:
    """Return the ``rpe`` of a plan: a list such as ``[1s, 10m]``.

    :raises ConfigurationError: with a line for each problem.
    """
    if content is None:
        return ()
    if not isinstance(content, list):
        raise ConfigurationError(f"rpe = {shown(content)}: must be a list such as [1s, 10m]")
    found, problems = [], []
    for entry in content:
        match = re.fullmatch(r"(\d+\.?\d*|\.\d+) ?(s|m)", str(entry))
        if match is None or not float(match[1]) > 0:
            problems.append(f"rpe: {shown(entry)}: must be a time or distance such as 1s or 10m")
        else:
            found.append(Relative(float(match[1]), match[2]))
    if problems:
        raise ConfigurationError(problems)
    return tuple(dict.fromkeys(found))


def metric_names(relative: tuple[Relative, ...]) -> tuple[str, ...]:
    """Return the names of all metrics in the order of the results' columns."""
    return (*POSE, *(name for one in relative for name in one.names), *STATE, *COMMAND)


def pose_metrics(
    estimate: PoseSequence, truth: PoseSequence, relative: tuple[Relative, ...]
) -> Metrics:
    """Return the metrics of poses; both (n,) at the same times, the estimate aligned."""
    errors = absolute_errors(estimate, truth)
    lengths = np.sqrt(np.einsum("ij,ij->i", errors.position, errors.position))
    angles = np.sqrt(np.einsum("ij,ij->i", errors.attitude, errors.attitude))
    distance = float(distances(truth.position)[-1])
    final = float(lengths[-1])
    result: Metrics = {
        "ate_rmse_m": float(np.sqrt(np.mean(np.square(lengths)))),
        "ate_rmse_rad": float(np.sqrt(np.mean(np.square(angles)))),
        "final_position_error_m": final,
        "final_attitude_error_rad": float(angles[-1]),
        "drift_percent": 100.0 * final / distance if distance > 0.0 else None,
    }
    for one in relative:
        translation, turn = _relative(estimate, truth, one)
        result.update(zip(one.names, (translation, turn), strict=True))
    return result


def _relative(
    estimate: PoseSequence, truth: PoseSequence, one: Relative
) -> tuple[float | None, float | None]:
    """Return the root mean squares of the relative errors; None where the path is too short."""
    try:
        first, second = pairs(truth, one.delta, one.unit)
    except InputError:
        return None, None
    errors = relative_errors(estimate, truth, first, second)
    return (
        float(np.sqrt(np.mean(np.square(errors.translation)))),
        float(np.sqrt(np.mean(np.square(errors.rotation)))),
    )
