# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimators that are ``allan`` and ``calibrate``: their results next to the sensor."""

import dataclasses
from collections.abc import Iterator
from typing import Final

import numpy as np

from imu_sim_ros.calibration.deterministic import correction
from imu_sim_ros.calibration.deterministic.positions import NORM, calibrate_six_position
from imu_sim_ros.calibration.deterministic.steady import Steady, find_steady
from imu_sim_ros.calibration.deterministic.temperature import calibrate_temperature, temperatures_at
from imu_sim_ros.calibration.deterministic.turntable import (
    calibrate_turntable,
    specific_force,
    true_rates,
)
from imu_sim_ros.calibration.noise import truth
from imu_sim_ros.calibration.noise.analysis import analyse
from imu_sim_ros.campaigns.metrics import CALIBRATED, NOISE, THERMAL, Metrics
from imu_sim_ros.campaigns.parameters import CalibrationEstimator
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.records import Readings
from imu_sim_ros.core.types import Array
from imu_sim_ros.sensors.errors.realised import realise_imu
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.simulation.parameters import SimulationParameters
from imu_sim_ros.simulation.topics import delivered_readings

_BLOCK: Final = 50_000
"""Samples in a block: a record of hours is never in memory as a whole."""


def run_calibration(cell: SimulatedCell, estimator: CalibrationEstimator, seed: int) -> Metrics:
    """Return the errors of the result of a seed's record.

    :raises InputError: for a record that yields no result.
    """
    parameters = dataclasses.replace(cell.parameters, seed=seed)
    if estimator.type == "allan":
        return _allan(_blocks(cell, seed), parameters, estimator.model)
    return _deterministic(cell, parameters, estimator.type)


def _blocks(cell: SimulatedCell, seed: int) -> Iterator[Readings]:
    """Yield the delivered readings of a run, in blocks."""
    for window in cell.simulation(seed).windows(_BLOCK):
        yield Readings(*delivered_readings(window[IMU]))


def _allan(blocks: Iterator[Readings], parameters: SimulationParameters, model: str) -> Metrics:
    """Return the errors of the estimated noise parameters of one run."""
    analysis = analyse([blocks], model=model)
    metrics: Metrics = {}
    comparisons = truth.compare(analysis, realise_imu(parameters.imu, parameters.seed))
    for key in NOISE:
        for number, triad in enumerate(TRIADS):
            axes = [
                comparison
                for comparison in comparisons
                if comparison.key == key and comparison.axis // 3 == number
            ]
            ratios = [
                comparison.estimate.value / comparison.truth
                for comparison in axes
                if comparison.estimate.value and comparison.truth
            ]
            name = f"{triad}_{key}"
            metrics[f"{name}_ratio"] = float(np.mean(ratios)) if ratios else None
            metrics[f"{name}_covered"] = float(np.mean([a.covered for a in axes])) if axes else None
    return metrics


def _deterministic(cell: SimulatedCell, parameters: SimulationParameters, kind: str) -> Metrics:
    """Return the errors of the calibrated parameters of one run."""
    block = cell.block(parameters.seed)
    gravity = float(np.linalg.norm(parameters.gravity))
    imu = realise_imu(parameters.imu, parameters.seed)
    by_norm = False
    if kind == "six_position":
        steady = find_steady(*delivered_readings(block))
        positions = calibrate_six_position(steady, gravity)
        values = correction.six_position_parameters(positions)
        by_norm = positions.fixture == NORM
    elif kind == "turntable":
        steady, rate = _steady(block, rotating=True)
        table = calibrate_turntable(steady, rate, gravity)
        values = correction.turntable_parameters(table)
    else:
        steady, rate = _steady(block, rotating=False)
        temperatures = temperatures_at(steady, block.true_t_ns, block.temperature)
        force = specific_force(steady, gravity)
        soak = calibrate_temperature(steady, temperatures, rate, force, imu.reference_temperature)
        values = correction.temperature_parameters(soak)
    truth = correction.true_parameters(imu, values)
    if by_norm:
        correction.turn_to_upper_triangular(truth)
    return _deviations(values, truth)


def _steady(block: Samples, *, rotating: bool) -> tuple[Steady, Array]:
    """Return the steady pieces and their true rates (m, 3)."""
    steady = find_steady(*delivered_readings(block), rotating=rotating)
    return true_rates(steady, block.true_t_ns, block.motion.angular_velocity)


def _deviations(values: correction.Parameters, truth: dict[str, Array]) -> Metrics:
    """Return the error of each calibrated parameter, and its ratio to the standard error."""
    metrics: Metrics = {}
    for name in (*CALIBRATED, *THERMAL):
        if name in values:
            value, sigma = (np.asarray(part, dtype=np.float64) for part in values[name])
            error = value - truth[name][: len(value)]
            has_sigma = sigma > 0.0
            if name in CALIBRATED:
                metrics[f"{name}_error"] = _rms(error)
            metrics[f"{name}_sigmas"] = (
                _rms(error[has_sigma] / sigma[has_sigma]) if has_sigma.any() else None
            )
    return metrics


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
