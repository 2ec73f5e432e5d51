# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The estimator that is dead reckoning from the true initial state, with its consistency."""

from typing import Final

import numpy as np

from imu_sim_ros.campaigns.comparison import coverage_metrics, estimate_metrics
from imu_sim_ros.campaigns.metrics import Metrics, pose_metrics
from imu_sim_ros.campaigns.parameters import DeadReckonEstimator
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings, States
from imu_sim_ros.core.types import Array
from imu_sim_ros.navigation.association import interpolate_vectors
from imu_sim_ros.navigation.comparison import compare
from imu_sim_ros.navigation.covariance import (
    ATTITUDE,
    POSITION,
    VELOCITY,
    Covariance,
    initial_covariance,
    propagate,
)
from imu_sim_ros.navigation.coverage import beyond
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.evaluation import LARGEST_SIGMA, absolute_errors, nees, state_at
from imu_sim_ros.navigation.mount import mount_of
from imu_sim_ros.navigation.state import NavigationState, state_of_row
from imu_sim_ros.sensors.gravity import earth_rate_vector, gravity_vector
from imu_sim_ros.sensors.samples import Samples

_NEES: Final = {"position": POSITION, "attitude": ATTITUDE, "velocity": VELOCITY}


def dead_reckoned_states(
    cell: SimulatedCell,
    estimator: DeadReckonEstimator,
    block: Samples,
    readings: Readings,
    start: NavigationState,
) -> States:
    """Return the dead-reckoned states of a run.

    :param block: all samples of the run's seed.
    :param start: the true state at the first reading, or at the first sample if that is later.
    """
    world = cell.parameters
    start_ns = np.array([max(int(readings.t_ns[0]), int(block.true_t_ns[0]))])
    return dead_reckon(
        readings.t_ns,
        *readings.triads(),
        start,
        estimator.method,
        estimator.attitude_update,
        gravity_vector(world).tolist(),
        earth_rate=earth_rate_vector(world).tolist(),
        mount=mount_of(world.imu),
        initial_rate=interpolate_vectors(block.true_t_ns, block.motion.angular_velocity, start_ns)[
            0
        ],
    )


class DeadReckoning:
    """Dead reckoning of a cell's runs; the covariance is that along the truth, of all seeds."""

    def __init__(self, cell: SimulatedCell) -> None:
        self._cell = cell
        self._covariances: tuple[dict[str, Array | None], float] | None = None

    def run(
        self, name: str, estimator: DeadReckonEstimator, block: Samples
    ) -> tuple[Metrics, States]:
        """Return the metrics and the estimate of one run.

        :param name: name of the estimator in the plan.
        :param block: all samples of the run's seed.
        :raises InputError: for readings that cannot be integrated.
        """
        plan = self._cell.plan
        alignment = str(plan.alignment(name))
        readings, truth = self._cell.readings(block), self._cell.truth(block)
        # A message that is delivered twice is integrated once.
        differs = np.diff(readings.t_ns, prepend=-1) != 0
        readings = readings if differs.all() else readings.rows(differs)
        if len(readings.t_ns) < 2:
            raise InputError(f"{len(readings.t_ns)} readings were delivered")
        at_stamps = np.array_equal(readings.t_ns, truth.t_ns)
        start = (
            state_of_row(truth, 0)
            if at_stamps
            else state_at(truth, max(int(readings.t_ns[0]), int(truth.t_ns[0])))
        )
        states = dead_reckoned_states(self._cell, estimator, block, readings, start)
        if not at_stamps:
            how = (alignment, plan.relative, estimator, plan.options.diverged_above)
            return estimate_metrics(states, truth, *how), states
        errors = compare(states, truth, alignment)
        metrics = pose_metrics(errors, plan.relative)
        failed = beyond(errors.position, plan.options.diverged_above)
        metrics.update(coverage_metrics(states.t_ns, truth.t_ns, estimator, failed))
        metrics["final_velocity_error_m_s"] = errors.final_velocity
        metrics.update(self._consistency(truth, block, states))
        return metrics, states

    def _consistency(self, truth: States, block: Samples, states: States) -> Metrics:
        """Return the NEES of the final state; the covariance is that along the truth.

        The covariance is the same for all seeds of a cell, so it is propagated only once.
        """
        if self._covariances is None:
            self._covariances = self._final_covariances(truth, block)
        covariances, sigma = self._covariances
        final, true = states.rows(slice(-1, None)), truth.rows(slice(-1, None))
        position, attitude = absolute_errors(final, true)
        velocity = final.velocities() - true.velocities()
        errors = {"position": position, "velocity": velocity, "attitude": attitude}
        metrics: Metrics = {
            f"nees_{name}": None if matrix is None else float(nees(errors[name], matrix)[0])
            for name, matrix in covariances.items()
        }
        return {**metrics, "attitude_sigma_rad": sigma}

    def _final_covariances(
        self, truth: States, block: Samples
    ) -> tuple[dict[str, Array | None], float]:
        """Return the valid final covariances, and the largest sigma of the attitude [rad]."""
        imu = self._cell.parameters.imu
        initial = initial_covariance(
            gyroscope_bias=imu.gyroscope.turn_on_bias_sigma,
            accelerometer_bias=imu.accelerometer.turn_on_bias_sigma,
        )
        covariance = Covariance(imu, initial)
        mount = mount_of(imu)
        matrix = propagate(truth, block.ideal_accel, imu, covariance, mount=mount)[0]
        valid = covariance.largest_attitude_sigma <= LARGEST_SIGMA
        covariances: dict[str, Array | None] = {}
        for name, rows in _NEES.items():
            part = matrix[rows, rows]
            regular = valid and np.linalg.matrix_rank(part, hermitian=True) == 3
            covariances[name] = part if regular else None
        return covariances, covariance.largest_attitude_sigma
