# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files for other programs: CSV, kalibr, imu_utils, and the simulator's own parameters."""

from itertools import product
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.analysis import AllanResult
from imu_sim_ros.calibration.noise.gauss_markov import CORRELATION_TIME, SIGMA
from imu_sim_ros.calibration.noise.terms import WHITE
from imu_sim_ros.core.conventions import AXES, TRIADS
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import Value

KALIBR_NAMES: Final = tuple(
    f"{triad}_{key}" for triad in TRIADS[::-1] for key in ("noise_density", "random_walk")
)
_IMU_UTILS_UNITS: Final = (" rad/s", " m/s^2")
"""Units as imu_utils writes them (imu_an.cpp), for both _n and _w."""
_CONTINUOUS_UNITS: Final = (
    " rad/s/sqrt(Hz) / rad/s^2/sqrt(Hz)",
    " m/s^2/sqrt(Hz) / m/s^3/sqrt(Hz)",
)
_BOUND: Final = "  # upper bound: the record cannot distinguish it from zero"


def write_csv(result: AllanResult, path: Path) -> None:
    """Write the Allan deviation and its 95 % band, a row for each cluster time."""
    deviation = result.deviation
    names = [f"{triad}_{axis}" for triad in TRIADS for axis in AXES]
    header = ["tau_s", "samples"] + [f"{n}{end}" for n in names for end in ("", "_low", "_high")]
    values = np.stack([deviation.deviation, deviation.low, deviation.high], axis=2)
    table = np.column_stack([deviation.tau, deviation.size, values.reshape(len(values), -1)])
    formats = ["%.9g", "%d"] + ["%.9g"] * (table.shape[1] - 2)
    np.savetxt(path, table, fmt=formats, delimiter=",", header=",".join(header), comments="")


def _triad_value(result: AllanResult, triad: int, key: str) -> tuple[float, bool]:
    """Return one value for the three axes of a triad, and whether it is an upper bound.

    The root mean square of the axes, for a filter with one value for three; if an axis
    has a bound only, the largest bound, for a density of zero is not allowed there.
    """
    estimates = [result.estimate(3 * triad + k, key) for k in range(3)]
    values = [e.value for e in estimates if e.value is not None]
    if len(values) == 3:
        return float(np.sqrt(np.mean(np.square(values)))), False
    if values:
        return float(max(values)), False
    return float(max(e.high for e in estimates)), True


def write_kalibr(result: AllanResult, path: Path, topic: str) -> None:
    """Write kalibr's imu.yaml: continuous-time densities, one value for three axes.

    :raises InputError: if an axis is not analysed.
    """
    check_complete(result)
    lines = ["# kalibr imu.yaml: continuous-time noise, root mean square of the three axes"]
    for name in KALIBR_NAMES:
        triad, _, key = name.partition("_")
        value, bound = _triad_value(result, TRIADS.index(triad), key)
        note = _BOUND if bound else ""
        lines.append(f"{name}: {max(value, 1e-12):.6e}{note}")
    lines += [f"rostopic: {topic}", f"update_rate: {result.timing.rate:.6g}"]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_imu_utils(result: AllanResult, path: Path, *, continuous: bool) -> None:
    """Write imu_utils' form in one of the two meanings that are in use.

    :param continuous: densities, N and K, as kalibr's documentation and filters take the names;
        else what the program itself writes: ``*_n`` is the noise of a single sample,
        N * sqrt(rate), and ``*_w`` the minimum of the Allan deviation, which is not a random walk.
    :raises InputError: if an axis is not analysed.
    """
    check_complete(result)
    meaning = (
        "*_n: noise density N; *_w: random walk K; both continuous-time (kalibr's meaning)"
        if continuous
        else "*_n: N * sqrt(rate), noise of one sample; *_w: minimum of the Allan deviation "
        "(what imu_utils itself writes)"
    )
    lines = ["%YAML:1.0", "---", f"# {meaning}", "type: IMU", "name: imu_sim_ros"]
    units = _CONTINUOUS_UNITS if continuous else _IMU_UTILS_UNITS
    for triad, (name, letters) in enumerate((("Gyr", "gyr"), ("Acc", "acc"))):
        axes = [_imu_utils_pair(result, 3 * triad + k, continuous) for k in range(3)]
        values = np.array([[number.value for number in pair] for pair in axes])
        bounds = np.array([[number.bound for number in pair] for pair in axes])
        lines += [f"{name}:", f'   unit: "{units[triad]}"']
        # The average is that of the axes, as imu_utils takes it; of bounds it is a bound.
        for label, pair, bound in zip(
            ("avg-axis", "x-axis", "y-axis", "z-axis"),
            [values.mean(axis=0), *values],
            [bounds.any(axis=0), *bounds],
            strict=True,
        ):
            lines.append(f"   {label}:")
            lines += [
                f"      {letters}_{c}: {v:.16e}{_BOUND if upper else ''}"
                for c, v, upper in zip("nw", pair, bound, strict=True)
            ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


class _Number(NamedTuple):
    """A noise parameter in a configuration file."""

    value: float
    bound: bool
    """The record does not distinguish it from zero: the value is an upper bound."""


def _imu_utils_pair(result: AllanResult, axis: int, continuous: bool) -> tuple[_Number, _Number]:
    """Return the white noise and the walk of an axis in one of imu_utils' two meanings."""
    noise, walk = (
        _Number(e.high, True) if e.value is None else _Number(e.value, False)
        for e in (result.estimate(axis, key) for key in ("noise_density", "random_walk"))
    )
    if continuous:
        return noise, walk
    lowest = float(np.min(result.deviation.deviation[:, axis]))
    return noise._replace(value=noise.value * result.timing.rate**0.5), _Number(lowest, False)


def check_complete(result: AllanResult) -> None:
    """Check that there is a number for every axis.

    :raises InputError: with a line for each axis that is not analysed: a configuration would take
        it for noiseless.
    """
    if result.reasons:
        raise InputError(
            [
                f"{axis} is not analysed ({reason}): no configuration file can be written"
                for axis, reason in result.reasons.items()
            ]
        )


def simulator_parameters(result: AllanResult) -> dict[str, Value]:
    """Return simulator parameters that reproduce this noise.

    White noise hidden by the resolution has its upper bound; other terms without a value stay zero.

    :raises InputError: if an axis is not analysed.
    """
    check_complete(result)
    values: dict[str, Value] = {"rate": round(result.timing.rate, 6), "imu.preset": "perfect"}
    for triad, name in enumerate(TRIADS):
        for key in result.keys:
            if key == "quantisation":
                continue
            estimates = [result.estimate(3 * triad + k, key) for k in range(3)]
            hidden = key == WHITE.key
            entries = [
                (e.high if hidden else 0.0) if e.value is None else e.value for e in estimates
            ]
            if key == "rate_ramp":
                signs = [_sign(result, 3 * triad + k) for k in range(3)]
                entries = [s * e for s, e in zip(signs, entries, strict=True)]
            if any(entries):
                values[f"imu.{name}_{key}"] = tuple(float(f"{e:.6g}") for e in entries)
        _complete_process(values, f"imu.{name}_")
    return values


def _sign(result: AllanResult, axis: int) -> float:
    """Return the sign of the ramp of an axis."""
    noise = result.noise[axis]
    return -1.0 if noise is not None and noise.trend < 0.0 else 1.0


def _complete_process(values: dict[str, Value], prefix: str) -> None:
    """Drop the parameters of a Gauss-Markov process from ``values`` unless both are known."""
    sigma, time = values.get(prefix + SIGMA), values.get(prefix + CORRELATION_TIME)
    if not isinstance(sigma, tuple) or not isinstance(time, tuple):
        values.pop(prefix + SIGMA, None)
        values.pop(prefix + CORRELATION_TIME, None)


def write_parameters(result: AllanResult, path: Path, source: str) -> None:
    """Write a parameter file for ``simulator`` and ``generate --imu``: a twin of this IMU."""
    mean = ", ".join(f"{value:.6g}" for value in result.mean)
    hidden = [
        f"{triad} {axis}"
        for k, (triad, axis) in enumerate(product(TRIADS, AXES))
        if result.estimate(k, WHITE.key).value is None
    ]
    bounds = f"White noise of {', '.join(hidden)}: an upper bound.\n" if hidden else ""
    comment = (
        f"Noise of the IMU in {source}: {result.record}.\n"
        f"Terms that the record cannot distinguish from zero are left out.\n{bounds}"
        f"Mean readings (gyroscope x y z, accelerometer x y z): {mean}"
    )
    files.write(simulator_parameters(result), path, comment=comment)
