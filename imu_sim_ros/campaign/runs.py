# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The runs of one cell: simulate with a seed, estimate, compare with the truth."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

import imu_sim_ros
from imu_sim_ros.bags.read import read_poses
from imu_sim_ros.campaign.cells import Cell, word
from imu_sim_ros.campaign.command_estimator import run_command
from imu_sim_ros.campaign.estimators import Estimate, estimate_metrics, run_calibration
from imu_sim_ros.campaign.metrics import Metrics, pose_metrics
from imu_sim_ros.campaign.parameters import (
    CalibrationEstimator,
    CommandEstimator,
    DeadReckonEstimator,
)
from imu_sim_ros.campaign.plan import Plan
from imu_sim_ros.errors import ConfigurationError, ImuSimError, InputError
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
from imu_sim_ros.navigation.noise import noise_of
from imu_sim_ros.navigation.state import NavigationStates
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.simulation.engine import Simulation
from imu_sim_ros.simulation.topics import delivered
from imu_sim_ros.trajectory.motion import RememberedTrajectory

Array = NDArray[np.float64]

DONE: Final = "done"
_NEES: Final = {"position": POSITION, "attitude": ATTITUDE, "velocity": VELOCITY}


class Readings(NamedTuple):
    """The input of an estimator."""

    t_ns: NDArray[np.int64]
    gyro: Array
    accel: Array


class CellRuns:
    """The runs of a cell; data shared by all its seeds are computed once."""

    def __init__(self, plan: Plan, cell: Cell) -> None:
        """Set up trajectory and sensor.

        :raises ImuSimError: for a cell that cannot be simulated.
        """
        self.plan, self.cell = plan, cell
        self.parameters = plan.simulation(cell)
        self.rig = plan.rig(cell)
        self._base = Simulation(self.parameters, pose_reader=read_poses)
        if self._base.total is None:
            raise ConfigurationError(
                f"cell {cell.name}: duration = 0: this trajectory has no end; give a duration in "
                "parameters"
            )
        self.total = self._base.total
        # It is sampled at the same times whatever the seed.
        self._base.trajectory = RememberedTrajectory(self._base.trajectory)
        self.digests = {
            name: plan.digest(self.parameters, self.rig, name) for name in plan.estimators
        }
        self._covariances: tuple[dict[str, Array | None], float] | None = None

    def rows(
        self, seeds: Sequence[int], estimators: Sequence[str], folder: Path
    ) -> Iterator[dict[str, Any]]:
        """Yield one row of results for each seed and estimator."""
        for seed in seeds:
            block = None
            for name in estimators:
                estimator = self.plan.estimators[name]
                try:
                    if isinstance(estimator, CalibrationEstimator):
                        # It takes the record in blocks: one of hours would not fit.
                        metrics = run_calibration(self, estimator, seed)
                    else:
                        block = self.block(seed) if block is None else block
                        metrics = self._navigated(estimator, name, seed, block, folder)
                    _check(metrics, self.plan.options.diverged_above)
                except Exception as error:  # an estimator may write anything
                    yield self._row(seed, name, f"failed: {_reason(error)}", {})
                else:
                    yield self._row(seed, name, DONE, metrics)

    def block(self, seed: int) -> ImuBlock:
        """Return all samples of a seed."""
        return self.simulation(seed).next_block(self.total)

    def simulation(self, seed: int) -> Simulation:
        """Return a simulation of this cell at its first sample, with the plan's faults."""
        simulation = self._base.with_seed(seed)
        for timed in self.plan.faults:
            simulation.inject(timed.fault, timed.at)
        return simulation

    def _navigated(
        self,
        estimator: CommandEstimator | DeadReckonEstimator,
        name: str,
        seed: int,
        block: ImuBlock,
        folder: Path,
    ) -> Metrics:
        if isinstance(estimator, CommandEstimator):
            return run_command(self, estimator, name, seed, block, folder)
        return self._dead_reckon(estimator, str(self.plan.alignment(name)), block)

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

    def truth(self, block: ImuBlock) -> NavigationStates:
        """Return the true states at the true times."""
        motion = block.motion
        return NavigationStates(block.true_t_ns, motion.position, motion.velocity, motion.q_wb)

    def readings(self, block: ImuBlock) -> Readings:
        """Return the delivered readings, each stamp once and in order."""
        t_ns, gyro, accel = delivered(block)
        if len(t_ns) and bool(np.all(t_ns[1:] > t_ns[:-1])):
            return Readings(t_ns, gyro, accel)
        first = np.unique(t_ns, return_index=True)[1]
        return Readings(t_ns[first], gyro[first], accel[first])

    def _dead_reckon(
        self, estimator: DeadReckonEstimator, alignment: str, block: ImuBlock
    ) -> Metrics:
        readings, truth = self.readings(block), self.truth(block)
        if len(readings.t_ns) < 2:
            raise InputError(f"{len(readings.t_ns)} readings were delivered")
        at_stamps = len(readings.t_ns) == len(truth.t_ns) and bool(
            np.array_equal(readings.t_ns, truth.t_ns)
        )
        truth_poses = PoseSequence(truth.t_ns, truth.position, truth.q_wb)
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
            self.parameters.gravity,
        )
        estimate = PoseSequence(states.t_ns, states.position, states.q_wb)
        if not at_stamps:
            found = Estimate(estimate, states.velocity)
            return estimate_metrics(found, block, alignment, self.plan.relative)
        velocity = states.velocity
        if alignment != "none":
            aligned = align(estimate.position, truth.position, alignment)
            estimate, velocity = aligned.apply(estimate), aligned.scale * velocity @ aligned.r.T
        metrics = pose_metrics(estimate, truth_poses, self.plan.relative)
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
        imu = self.parameters.imu
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
