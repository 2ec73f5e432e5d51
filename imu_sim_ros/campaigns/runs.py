# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The runs of one cell: simulate with a seed, estimate, compare with the truth."""

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import numpy as np

import imu_sim_ros
from imu_sim_ros.campaigns.cells import Cell, word
from imu_sim_ros.campaigns.comparison import EstimatedTrack, estimate_metrics
from imu_sim_ros.campaigns.metrics import Metrics, pose_metrics
from imu_sim_ros.campaigns.parameters import CommandEstimator, DeadReckonEstimator
from imu_sim_ros.campaigns.plan import Plan
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.errors import ImuSimError, InputError
from imu_sim_ros.navigation.association import align
from imu_sim_ros.navigation.covariance import (
    ATTITUDE,
    POSITION,
    VELOCITY,
    Covariance,
    initial_covariance,
    propagate,
)
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.evaluation import LARGEST_SIGMA, Truth, attitude_errors, nees
from imu_sim_ros.navigation.parameters import noise_of
from imu_sim_ros.navigation.state import NavigationStates
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.types import Array

DONE: Final = "done"
_USED: Final = ("wall_s", "peak_memory_mb")
"""Metrics that a failed run has, too."""


class CellRuns:
    """The runs of a cell; data shared by all its seeds are computed once."""

    def __init__(self, plan: Plan, cell: Cell) -> None:
        """Set up trajectory and sensor.

        :raises ImuSimError: for a cell that cannot be simulated.
        """
        self.plan, self.cell = plan, cell
        self.simulated = SimulatedCell(plan, cell)
        self._dead_reckoning = DeadReckoning(self.simulated)
        parameters, rig = self.simulated.parameters, self.simulated.rig
        self.digests = {name: plan.digest(parameters, rig, name) for name in plan.estimators}

    def rows(
        self, seeds: Sequence[int], estimators: Sequence[str], folder: Path
    ) -> Iterator[dict[str, Any]]:
        """Yield one row of results for each seed and estimator."""
        for seed in seeds:
            # A calibration takes its record in blocks: one of hours would not fit.
            block = cache(partial(self.simulated.block, seed))
            for name in estimators:
                metrics: Metrics = {}
                try:
                    self._estimate(name, seed, block, folder, metrics)
                    _check(metrics, self.plan.options.diverged_above)
                except Exception as error:  # an estimator may write anything
                    used: Metrics = {key: metrics.get(key) for key in _USED}
                    yield self._row(seed, name, f"failed: {_reason(error)}", used)
                else:
                    yield self._row(seed, name, DONE, metrics)

    def _estimate(
        self, name: str, seed: int, block: Callable[[], ImuBlock], folder: Path, metrics: Metrics
    ) -> None:
        """Fill in the metrics of one run; of one that fails, the time and memory it has taken."""
        estimator = self.plan.estimators[name]
        if isinstance(estimator, DeadReckonEstimator):
            metrics.update(self._dead_reckoning.metrics(name, estimator, block()))
        elif isinstance(estimator, CommandEstimator):
            from imu_sim_ros.campaigns.command_estimator import run_command

            run_command(self.simulated, estimator, name, seed, block(), folder, metrics)
        else:
            from imu_sim_ros.campaigns.calibrations import run_calibration

            metrics.update(run_calibration(self.simulated, estimator, seed))

    def _row(self, seed: int, name: str, status: str, metrics: Metrics) -> dict[str, Any]:
        return {
            "cell": self.cell.name,
            "seed": seed,
            "estimator": name,
            "status": " ".join(status.split())[:300],
            **{key: _plain(value) for key, value in self.cell.values.items()},
            **{key: metrics.get(key) for key in self.plan.metrics},
            "align": self.plan.alignment(name),
            "digest": self.digests[name],
            "version": imu_sim_ros.__version__,
        }


def _reason(error: Exception) -> str:
    if isinstance(error, ImuSimError):
        return error.problems[0]
    return f"unexpected: {type(error).__name__}: {error}"


def _check(metrics: Metrics, diverged_above: float) -> None:
    """Refuse numbers that are not finite, and an error above the limit."""
    for name, value in metrics.items():
        if value is not None and not np.isfinite(value):
            raise InputError(f"{name} is not finite")
    final = metrics.get("final_position_error_m")
    if diverged_above and final is not None and final > diverged_above:
        raise InputError(f"diverged: {final:.4g} m at the end")


def _plain(value: object) -> object:
    """Return a grid's value as results hold it: a number, a boolean or a string."""
    return value if isinstance(value, int | float | str) else word(value)


_NEES: Final = {"position": POSITION, "attitude": ATTITUDE, "velocity": VELOCITY}


class DeadReckoning:
    """Dead reckoning of a cell's runs; the covariance is that along the truth, of all seeds."""

    def __init__(self, cell: SimulatedCell) -> None:
        self._cell = cell
        self._covariances: tuple[dict[str, Array | None], float] | None = None

    def metrics(self, name: str, estimator: DeadReckonEstimator, block: ImuBlock) -> Metrics:
        """Return the metrics of one run.

        :param name: of the estimator in the plan.
        :param block: all samples of the run's seed.
        :raises InputError: for readings that cannot be integrated.
        """
        plan = self._cell.plan
        alignment = str(plan.alignment(name))
        readings, (truth, truth_poses) = self._cell.readings(block), self._cell.truth(block)
        if len(readings.t_ns) < 2:
            raise InputError(f"{len(readings.t_ns)} readings were delivered")
        at_stamps = np.array_equal(readings.t_ns, truth.t_ns)
        start = (
            truth.at(0)
            if at_stamps
            else Truth(truth_poses, truth.velocity).at(
                max(int(readings.t_ns[0]), int(truth.t_ns[0]))
            )
        )
        states = dead_reckon(
            *readings,
            start,
            estimator.method,
            estimator.attitude_update,
            self._cell.parameters.gravity,
        )
        estimate = PoseSequence(states.t_ns, states.position, states.q_wb)
        if not at_stamps:
            found = EstimatedTrack(estimate, states.velocity)
            return estimate_metrics(found, block, alignment, plan.relative)
        velocity = states.velocity
        if alignment != "none":
            aligned = align(estimate.position, truth.position, alignment)
            estimate, velocity = aligned.apply(estimate), aligned.scale * velocity @ aligned.r.T
        metrics = pose_metrics(estimate, truth_poses, plan.relative)
        metrics["final_velocity_error_m_s"] = float(
            np.linalg.norm(truth.velocity[-1] - velocity[-1])
        )
        metrics.update(self._consistency(truth, block, states))
        return metrics

    def _consistency(
        self, truth: NavigationStates, block: ImuBlock, states: NavigationStates
    ) -> Metrics:
        """Return the NEES of the final state; the covariance is that along the truth.

        It is the same for all seeds of a cell, so it is propagated only once.
        """
        if self._covariances is None:
            self._covariances = self._final_covariances(truth, block)
        covariances, sigma = self._covariances
        errors = {
            "position": truth.position[-1] - states.position[-1],
            "velocity": truth.velocity[-1] - states.velocity[-1],
            "attitude": attitude_errors(states.q_wb[-1:], truth.q_wb[-1:])[0],
        }
        found: Metrics = {
            f"nees_{name}": None if matrix is None else float(nees(errors[name][None], matrix)[0])
            for name, matrix in covariances.items()
        }
        return {**found, "attitude_sigma_rad": sigma}

    def _final_covariances(
        self, truth: NavigationStates, block: ImuBlock
    ) -> tuple[dict[str, Array | None], float]:
        """Return those of the final state that are valid, and the attitude's largest sigma."""
        imu = self._cell.parameters.imu
        initial = initial_covariance(
            gyroscope_bias=imu.gyroscope.turn_on_bias_sigma,
            accelerometer_bias=imu.accelerometer.turn_on_bias_sigma,
        )
        covariance = Covariance(noise_of(imu), initial)
        matrix = propagate(truth, block.ideal_accel, noise_of(imu), covariance)[0]
        valid = covariance.largest_attitude_sigma <= LARGEST_SIGMA
        found: dict[str, Array | None] = {}
        for name, place in _NEES.items():
            part = matrix[place, place]
            regular = valid and np.linalg.matrix_rank(part, hermitian=True) == 3
            found[name] = part if regular else None
        return found, covariance.largest_attitude_sigma
