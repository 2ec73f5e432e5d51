# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of a gyroscope on a rate table (lecture eq. 7 with known rates)."""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.deterministic.positions import (
    face_vectors,
    nearest_faces,
    observations,
)
from imu_sim_ros.calibration.deterministic.response import fit_axis, is_distinguishable
from imu_sim_ros.calibration.deterministic.steady import Steady
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array, Integers

_TURNING: Final = 0.05
"""Smallest rate of the table [rad/s]."""
_NEAR: Final = 0.15
"""Largest relative difference between a reading and the table's rate."""
_DRIFT_ORDER: Final = 3
"""Highest power of the temperature in the drift of the readings at rest."""
_REWEIGHTINGS: Final = 60
"""Largest number of reweighted fits."""
_SMALL: Final = 1e-4
"""Residuals below which all weights are equal [rad/s]."""


class Turntable(NamedTuple):
    """The gyroscope's deterministic errors."""

    scale_misalignment: Array
    """(3, 3) S of ``reading = S omega + G f + b``."""
    scale_misalignment_sigma: Array
    """(3, 3) standard errors."""
    bias: Array
    """(3,) bias at the start of the record [rad/s]."""
    bias_sigma: Array
    """(3,) standard errors."""
    g_sensitivity: Array | None
    """(3, 3) g-sensitivity [(rad/s)/(m/s^2)]; None if it cannot be separated from the bias."""
    g_sensitivity_sigma: Array | None
    """(3, 3) standard errors."""
    stretches: Steady
    """m stretches that were used."""
    rate: Array
    """(m, 3) true angular rate [rad/s]."""
    residuals: Array
    """(m, 3) reading minus model [rad/s]."""


def calibrate_turntable(steady: Steady, rate: Array, gravity: float) -> Turntable:
    """Return bias, scale and misalignment, and the g-sensitivity if it can be determined.

    It can, if gravity is seen along and against every axis.

    :param steady: stretches at rest and at constant rates.
    :param rate: (m, 3) true angular rates of the pieces, from :func:`match_table_rates` or a truth.
    :param gravity: magnitude of gravity [m/s^2].
    :raises InputError: if an axis is not turned in both directions or nothing is at rest.
    """
    missing = [
        f"{sign}{name}"
        for k, name in enumerate("xyz")
        for sign, factor in (("+", 1.0), ("-", -1.0))
        if not np.any(factor * rate[:, k] > _TURNING)
    ]
    if missing:
        raise InputError(
            f"no steady rotation about {', '.join(missing)}: each axis must turn at a constant "
            "rate in both directions"
        )
    force = specific_force(steady, gravity)
    inputs = np.concatenate([rate, force], axis=1)
    with_force = is_distinguishable(inputs)
    used = inputs if with_force else rate
    axes = [
        fit_axis(observations(steady, used, steady.gyro, steady.gyro_sigma, k)) for k in range(3)
    ]
    gain = np.array([axis.gain for axis in axes])
    sigma = np.array([axis.gain_sigma for axis in axes])
    return Turntable(
        scale_misalignment=gain[:, :3],
        scale_misalignment_sigma=sigma[:, :3],
        bias=np.array([axis.bias[0] for axis in axes]),
        bias_sigma=np.array([axis.bias_sigma[0] for axis in axes]),
        g_sensitivity=gain[:, 3:] if with_force else None,
        g_sensitivity_sigma=sigma[:, 3:] if with_force else None,
        stretches=steady,
        rate=rate,
        residuals=np.array([axis.residuals for axis in axes]).T,
    )


def specific_force(steady: Steady, gravity: float) -> Array:
    """Return (m, 3) the mean specific force: exact if an axis points up, else measured."""
    faces, aligned = nearest_faces(steady.accel)
    return np.where(aligned[:, None], gravity * face_vectors(faces), steady.accel)


class TableRates(NamedTuple):
    """Pieces at rest or at one of a table's rates."""

    steady: Steady
    """The m pieces at rest or at a rate."""
    rate: Array
    """(m, 3) true angular rates [rad/s]."""
    unknown: Array
    """(k,) magnitudes of measured rates that the table does not have [rad/s]."""
    missing: Array
    """(r,) rates of the table without a piece [rad/s]."""


def match_table_rates(steady: Steady, rates: Array, temperature: Array | None = None) -> TableRates:
    """Return the stretches at rest or at one of the table's rates, and their true angular rates.

    :param rates: magnitudes of the table's rates [rad/s]; empty: all rotations are unknown.
    :param temperature: (m,) temperatures of the pieces [degC], with which the bias may drift.
    :raises InputError: if no stretch is at rest.
    """
    at_rest = _typical(steady.gyro, temperature)  # stretches turn both ways
    noise = np.linalg.norm(steady.gyro_sigma, axis=1)
    still = np.linalg.norm(steady.gyro - at_rest, axis=1) < _TURNING + 6.0 * noise
    if not still.any():
        raise InputError("no stretch at rest: the table must rest between the rates")
    excess = steady.gyro - at_rest - np.mean((steady.gyro - at_rest)[still], axis=0)
    axis = np.argmax(np.abs(excess), axis=1)
    along = np.take_along_axis(excess, axis[:, None], axis=1)[:, 0]
    candidates = rates if len(rates) else np.array([np.inf])
    nearest = candidates[np.argmin(np.abs(np.abs(along)[:, None] - candidates), axis=1)]
    turning = ~still & (np.abs(np.abs(along) - nearest) < _NEAR * nearest)
    true_rate = np.zeros((len(along), 3))
    true_rate[np.arange(len(along)), axis] = np.where(turning, np.sign(along) * nearest, 0.0)
    used = still | turning
    return TableRates(
        steady.rows(used),
        true_rate[used],
        np.abs(along[~used]),
        rates[~np.isin(rates, nearest[turning])],
    )


def _typical(gyro: Array, temperature: Array | None) -> Array:
    """Return the readings at rest: medians (3,), or (m, 3) polynomials of the temperature.

    The polynomials have the least sum of absolute residuals, as medians have, by iteratively
    reweighted least squares.

    :param gyro: (m, 3) readings, most of them at rest or as many one way as the other.
    :param temperature: (m,) temperatures of the pieces [degC].
    """
    median = np.asarray(np.median(gyro, axis=0))
    if temperature is None or (span := float(np.ptp(temperature))) == 0.0:
        return median
    distinct = len(np.unique(np.round(temperature)))
    middle = 0.5 * (temperature.min() + temperature.max())
    order = min(_DRIFT_ORDER, distinct - 1)
    powers = (2.0 * (temperature - middle) / span)[:, None] ** np.arange(order + 1)
    baseline = np.tile(median, (len(gyro), 1))
    for axis, column in enumerate(gyro.T):
        for _ in range(_REWEIGHTINGS):
            residual = np.abs(column - baseline[:, axis])
            root = np.sqrt(1.0 / np.maximum(residual, _SMALL))
            solution = np.linalg.lstsq(powers * root[:, None], column * root, rcond=None)[0]
            baseline[:, axis] = powers @ solution
    return baseline


def true_rates(steady: Steady, t_ns: Integers, angular_velocity: Array) -> tuple[Steady, Array]:
    """Return the pieces that a truth covers, and the truth's mean rates in them (m, 3).

    :param t_ns: (n,) stamps of the truth.
    :param angular_velocity: (n, 3) angular velocities in the body frame [rad/s].
    :raises InputError: if the truth covers no piece.
    """
    begin = np.searchsorted(t_ns, steady.begin_ns)
    end = np.searchsorted(t_ns, steady.end_ns)
    covered = end > begin
    if not covered.any():
        raise InputError("the truth in the bag covers none of the steady stretches")
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(angular_velocity, axis=0)])
    count = np.maximum(end - begin, 1)[:, None]
    mean = (sums[end] - sums[begin]) / count
    return steady.rows(covered), mean[covered]
