# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``allan`` and ``calibrate`` as estimators: their results beside the sensor that made the record.

Of a noise parameter there is the mean ratio of estimate to truth over the axes that have both
(``_ratio``, 1 is right) and the share of axes whose 95 % interval holds the truth (``_covered``,
0.95 over many seeds). Of a calibrated parameter there is the root mean square of its errors
(``_error``) and of the errors over their standard errors (``_sigmas``, 1 is right).
"""

import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration import deterministic, noise
from imu_sim_ros.calibration.deterministic import correction
from imu_sim_ros.campaign.metrics import CALIBRATED, NOISE, THERMAL, Metrics
from imu_sim_ros.config import CalibrationEstimator, SimulationParameters
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.sensor import ImuBlock, realised_imu
from imu_sim_ros.topics import delivered

if TYPE_CHECKING:
    from imu_sim_ros.campaign.runs import CellRuns

Array = NDArray[np.float64]

_BLOCK: Final = 50_000
"""Samples in a block: a record of hours never lies in memory."""


class _Readings(NamedTuple):
    t_ns: NDArray[np.int64]
    gyro: Array
    accel: Array


def run_calibration(runs: "CellRuns", estimator: CalibrationEstimator, seed: int) -> Metrics:
    """Return how far the result of a seed's record lies from the sensor.

    :raises InputError: for a record that yields no result.
    """
    parameters = dataclasses.replace(runs.parameters, seed=seed)
    if estimator.type == "allan":
        return _allan(_blocks(runs, seed), parameters, estimator.model)
    return _deterministic(runs, parameters, estimator.type)


def _blocks(runs: "CellRuns", seed: int) -> Iterator[_Readings]:
    simulation = runs.simulation(seed)
    for first in range(0, runs.total, _BLOCK):
        block = simulation.next_block(min(_BLOCK, runs.total - first))
        yield _Readings(*delivered(block))


def _allan(blocks: Iterator[_Readings], parameters: SimulationParameters, model: str) -> Metrics:
    result = noise.analyse([blocks], model=model)
    found: Metrics = {}
    compared = noise.truth.compare(result, realised_imu(parameters.imu, parameters.seed))
    for key in NOISE:
        for number, triad in enumerate(TRIADS):
            axes = [one for one in compared if one.key == key and one.axis // 3 == number]
            ratios = [
                one.estimate.value / one.truth for one in axes if one.estimate.value and one.truth
            ]
            name = f"{triad}_{key}"
            found[f"{name}_ratio"] = float(np.mean(ratios)) if ratios else None
            found[f"{name}_covered"] = float(np.mean([a.covered for a in axes])) if axes else None
    return found


def _deterministic(runs: "CellRuns", parameters: SimulationParameters, kind: str) -> Metrics:
    block = runs.block(parameters.seed)
    gravity = float(np.linalg.norm(parameters.gravity))
    imu = realised_imu(parameters.imu, parameters.seed)
    by_norm = False
    if kind == "six_position":
        steady = deterministic.find_steady(*delivered(block))
        positions = deterministic.calibrate_six_position(steady, gravity)
        values = correction.six_position_parameters(positions)
        by_norm = positions.fixture == deterministic.NORM
    elif kind == "turntable":
        steady, rate = _steady(block, rotating=True)
        table = deterministic.calibrate_turntable(steady, rate, gravity)
        values = correction.turntable_parameters(table)
    else:
        steady, rate = _steady(block, rotating=False)
        at = deterministic.temperatures_at(steady, block.true_t_ns, block.temperature)
        force = deterministic.specific_force(steady, gravity)
        soak = deterministic.calibrate_temperature(
            steady, at, rate, force, imu.reference_temperature
        )
        values = correction.temperature_parameters(soak)
    truth = correction.true_parameters(imu, values)
    if by_norm:
        correction.turn_to_upper_triangular(truth)
    return _deviations(values, truth)


def _steady(block: ImuBlock, *, rotating: bool) -> tuple[deterministic.Steady, Array]:
    """Return the steady pieces and their true rates (m, 3)."""
    steady = deterministic.find_steady(*delivered(block), rotating=rotating)
    return deterministic.true_rates(steady, block.true_t_ns, block.motion.angular_velocity)


def _deviations(values: correction.Parameters, truth: dict[str, Array]) -> Metrics:
    found: Metrics = {}
    for name in (*CALIBRATED, *THERMAL):
        if name in values:
            value, sigma = (np.asarray(part, dtype=np.float64) for part in values[name])
            error = value - truth[name][: len(value)]
            known = sigma > 0.0
            if name in CALIBRATED:
                found[f"{name}_error"] = _rms(error)
            found[f"{name}_sigmas"] = _rms(error[known] / sigma[known]) if known.any() else None
    return found


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
