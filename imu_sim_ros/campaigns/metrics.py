# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Metrics of a run."""

import re
from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.names import short_repr
from imu_sim_ros.navigation.comparison import Comparison

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
ESTIMATED: Final = "estimated_share"
"""The share of the truth's time that is estimated, without an allowance for the start."""
COVERED: Final = ("coverage", ESTIMATED, "time_to_failure_s")
"""Metrics of the time that a trajectory covers; failed runs have them, too."""
SUCCESS: Final = "success"
"""Share of the runs that are done, comparable like a metric."""
LOWER, HIGHER = "lower", "higher"
Better = str | float
"""Direction of a metric: ``lower`` or ``higher`` values are better, or those near a number."""
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
"""Polynomials, whose coefficients differ in unit: their metric is the error in sigmas alone."""


def calibration_names(kinds: Collection[str]) -> tuple[str, ...]:
    """Return the names of the metrics of calibrations."""
    names: list[str] = []
    if "allan" in kinds:
        quantities = [f"{triad}_{key}" for triad in TRIADS for key in NOISE]
        names += [f"{quantity}_{kind}" for quantity in quantities for kind in ("ratio", "covered")]
    if {"six_position", "turntable", "temperature"} & set(kinds):
        names += [f"{quantity}_{kind}" for quantity in CALIBRATED for kind in ("error", "sigmas")]
    if "temperature" in kinds:
        names += [f"{quantity}_sigmas" for quantity in THERMAL]
    return tuple(names)


def better_values(metric: str, custom: Mapping[str, Better]) -> Better:
    """Return which values of a metric are better.

    :param custom: directions of the plan's own metrics.
    """
    if metric in custom:
        return custom[metric]
    if metric in (SUCCESS, *COVERED, "real_time_factor"):
        return HIGHER
    if metric == "scale_error":
        return 0.0
    if metric.startswith("nees_"):
        return 3.0
    if metric.endswith(("_ratio", "_sigmas")):
        return 1.0
    return 0.95 if metric.endswith("_covered") else LOWER


def is_share(metric: str) -> bool:
    """Return whether a metric lies between 0 and 1."""
    return metric in (SUCCESS, "coverage", ESTIMATED) or metric.endswith("_covered")


def grows_with_time(metric: str) -> bool:
    """Return whether a metric is one of the errors that depend on how long an estimate lasts."""
    return depends_on_alignment(metric) or metric == "scale_error"


def depends_on_alignment(metric: str) -> bool:
    """Return whether a metric is computed after the trajectory was aligned with the truth."""
    return metric in POSE or metric.startswith("rpe_") or metric == "final_velocity_error_m_s"


def parse_custom(content: object, reserved: Collection[str]) -> dict[str, Better]:
    """Return the ``metrics`` of a plan: names, and which values are better.

    :param reserved: names of other metrics and columns.
    :raises ConfigurationError: with a line for each problem.
    """
    if content is None:
        return {}
    if not isinstance(content, Mapping):
        raise ConfigurationError(
            f"metrics = {short_repr(content)}: must hold names and lower, higher or a number"
        )
    problems = []
    for name, value in content.items():
        if not re.fullmatch(r"[A-Za-z]\w{0,63}", str(name)) or str(name) in reserved:
            problems.append(
                f"metrics: {short_repr(name)}: a name may contain letters, digits and _ only, at "
                "most 64, and must not be another metric's"
            )
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value not in (LOWER, HIGHER) and not (number and np.isfinite(value)):
            problems.append(
                f"metrics.{name} = {short_repr(value)}: must be lower, higher, or the number near "
                "which values are best"
            )
    if problems:
        raise ConfigurationError(problems)
    return {str(name): value for name, value in content.items()}


class Tolerance(NamedTuple):
    """A difference that does not matter."""

    value: float
    relative: bool

    def __str__(self) -> str:
        return f"{100.0 * self.value:.3g} %" if self.relative else f"{self.value:.3g}"


def parse_tolerance(content: object, name: str = "tolerance") -> Tolerance:
    """Return a share such as ``2 %``, or a number in the metric's unit.

    :raises ConfigurationError: for anything else.
    """
    match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*(%?)\s*", str(content))
    value = float(match[1] + (match[2] or "")) if match and not isinstance(content, bool) else None
    if match is None or value is None or not value < 1e9:
        raise ConfigurationError(
            f"{name} = {short_repr(content)}: must be a share such as 2 %, or a number in the "
            "metric's unit, at least 0"
        )
    return Tolerance(0.01 * value, True) if match[3] else Tolerance(value, False)


class Relative(NamedTuple):
    """A distance or time that relative errors are taken over."""

    delta: float
    unit: str
    """Unit of ``delta``: s or m."""

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
        raise ConfigurationError(f"rpe = {short_repr(content)}: must be a list such as [1s, 10m]")
    lengths, problems = [], []
    for entry in content:
        match = re.fullmatch(r"(\d+\.?\d*|\.\d+) ?(s|m)", str(entry))
        if match is None or not float(match[1]) > 0:
            problems.append(
                f"rpe: {short_repr(entry)}: must be a time or distance such as 1s or 10m"
            )
        else:
            lengths.append(Relative(float(match[1]), match[2]))
    if problems:
        raise ConfigurationError(problems)
    return tuple(dict.fromkeys(lengths))


def metric_names(relative: tuple[Relative, ...]) -> tuple[str, ...]:
    """Return the names of all metrics in the order of the results' columns."""
    relative_names = (name for length in relative for name in length.names)
    return (*POSE, *COVERED, *relative_names, *STATE, *COMMAND)


def pose_metrics(errors: Comparison, relative: tuple[Relative, ...]) -> Metrics:
    """Return the metrics of the poses of an estimate."""
    distance, final = errors.distance, errors.final_position
    metrics: Metrics = {
        "ate_rmse_m": errors.rms_position,
        "ate_rmse_rad": errors.rms_attitude,
        "final_position_error_m": final,
        "final_attitude_error_rad": errors.final_attitude,
        "drift_percent": 100.0 * final / distance if distance > 0.0 else None,
    }
    for length in relative:
        metrics.update(zip(length.names, _relative(errors, length), strict=True))
    return metrics


def _relative(errors: Comparison, length: Relative) -> tuple[float | None, float | None]:
    """Return the root mean squares of the relative errors; None without pairs of this length."""
    try:
        pairs = errors.relative(length.delta, length.unit)
    except InputError:
        return None, None
    if not len(pairs.length):
        return None, None
    return (
        float(np.sqrt(np.mean(np.square(pairs.translation)))),
        float(np.sqrt(np.mean(np.square(pairs.rotation)))),
    )
