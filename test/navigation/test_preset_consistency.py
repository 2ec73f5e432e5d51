# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every sensor's errors against the covariance that its own data sheet's numbers predict.

A body rests, is levelled, and its gyroscope is averaged, as the integrator and dead_reckon do
with initial_state level; then it moves. Turn-on biases, scales, 1/f noise, walks, white noise and
rounding are all as the simulator draws them; the covariance knows their sizes alone.
"""

import dataclasses

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.navigation import initialisation
from imu_sim_ros.navigation.covariance import ATTITUDE, POSITION, VELOCITY, propagate
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.evaluation import anees_band, nees
from imu_sim_ros.navigation.parameters import load_integrator
from imu_sim_ros.navigation.state import states_of
from imu_sim_ros.parameters import files
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

RATE = 200.0
REST = 10.0
FIRST_SEED = 1000
PLACES = {
    "attitude": ATTITUDE,
    "velocity": VELOCITY,
    "position": POSITION,
}
PRESETS = [name for name in files.names("imus") if name != "perfect"]
TRAJECTORIES = ("lecture", "figure_eight")


def mean_nees(settings, trajectory, runs, duration):
    """Return the mean NEES of attitude, velocity and position at the end of the runs."""
    shape = {"trajectory.type": trajectory, "trajectory.rest_before": REST, "rate": RATE}
    count, rest = round((REST + duration) * RATE) + 1, round(REST * RATE)
    parameters = load_simulation(settings, {**shape, "duration": count / RATE})
    integrator = load_integrator({**settings, "level_time": REST})
    errors = []
    for seed in range(runs):
        block = Body(dataclasses.replace(parameters, seed=FIRST_SEED + seed)).next(count)["imu"]
        motion = block.motion
        truth = states_of(
            *(x[rest:] for x in (block.t_ns, motion.position, motion.velocity, motion.q_wb))
        )
        gyro, accel = block.gyro, block.accel
        true_errors = {
            "position": truth.position[0],
            "yaw": float(rotation.to_euler(truth.q_wb[0])[2]),
        }
        start = initialisation.from_rest(
            integrator, gyro[: rest + 1], accel[: rest + 1], **true_errors
        )
        if not seed:  # what is expected of all runs: along the truth, from the true attitude on
            ideal = block.ideal_gyro[: rest + 1], block.ideal_accel[: rest + 1]
            covariance = initialisation.from_rest(integrator, *ideal, **true_errors).covariance
            predicted = propagate(truth, block.ideal_accel[rest:], integrator.imu, covariance)[0]
        states = dead_reckon(
            truth.t_ns, gyro[rest:], accel[rest:], start.state, correction=start.correction
        )
        back = rotation.conjugate(states.q_wb[-1])
        errors.append(
            (
                rotation.log(rotation.multiply(truth.q_wb[-1], back)),
                truth.velocity[-1] - states.velocity[-1],
                truth.position[-1] - states.position[-1],
            )
        )
    return {
        name: float(nees(np.array(error), predicted[place, place]).mean())
        for (name, place), error in zip(PLACES.items(), zip(*errors, strict=True), strict=True)
    }


def check(mean_nees_values, runs, checks):
    """Assert a NEES in its band: all of the checks lie in theirs with 95 % (Bonferroni)."""
    low, high = anees_band(3, runs, 1.0 - 0.05 / checks)
    assert all(low <= mean <= high for mean in mean_nees_values.values()), (
        mean_nees_values,
        low,
        high,
    )


FEW = {
    "every term": {
        "imu.preset": "tactical",
        "imu.gyroscope_random_walk": 3e-6,
        "imu.accelerometer_random_walk": 1e-4,
        "imu.gyroscope_gauss_markov_sigma": 2e-4,
        "imu.gyroscope_correlation_time": 5.0,
        "imu.accelerometer_gauss_markov_density": 2e-3,
        "imu.accelerometer_correlation_time": 20.0,
        "imu.gyroscope_turn_on_bias_sigma": 0.01,
    },
    "1/f alone": {
        "imu.preset": "perfect",
        "imu.gyroscope_bias_instability": 3.4e-5,
        "imu.accelerometer_bias_instability": 5.3e-4,
    },
    "scale alone": {
        "imu.preset": "perfect",
        "imu.gyroscope_turn_on_scale_sigma": 3e-3,
        "imu.accelerometer_turn_on_scale_sigma": 5e-3,
    },
}


@pytest.mark.parametrize("name", FEW)
def test_errors_of_sixty_runs_are_as_large_as_predicted(name):
    """A sigma that is wrong by sqrt(2) is a mean of 6 or 1.5; the band is 2.1 to 4.0.

    Without the terms for 1/f, Gauss-Markov and scale the means are infinite, or 10 to 1000.
    """
    check(mean_nees(FEW[name], "figure_eight", 60, 20.0), 60, 3 * len(FEW))


@pytest.mark.slow
@pytest.mark.parametrize("trajectory", TRAJECTORIES)
@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_is_consistent(preset, trajectory):
    """200 runs of 60 s; means of 3 +- 0.17 are expected."""
    mean_nees_values = mean_nees({"imu.preset": preset}, trajectory, 200, 60.0)
    print(
        f"NEES {preset:12s} {trajectory:12s}", {k: round(v, 2) for k, v in mean_nees_values.items()}
    )
    check(mean_nees_values, 200, 3 * len(PRESETS) * len(TRAJECTORIES))
