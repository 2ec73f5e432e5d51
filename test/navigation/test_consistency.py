# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of many seeded runs of the simulator against the covariance that is predicted for them.

The simulator's noise, dead reckoning or preintegration, and the propagated covariance are three
separate pieces of code: a factor of sqrt(2) in any of them doubles or halves the NEES, far outside
of the bands of some 22 %, which hold 99.9 % of all means.
"""

import dataclasses

import numpy as np
import pytest

from examples.vio_residuals import States, imu_residual
from imu_sim_ros.core import rotation
from imu_sim_ros.navigation.covariance import ATTITUDE, POSITION, VELOCITY, propagate
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.evaluation import anees_band, nees
from imu_sim_ros.navigation.preintegration import StepReadings, preintegrate
from imu_sim_ros.navigation.state import state_of_row, states_of
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

from .conftest import AT_REST

RUNS = 150
BAND = 0.999
NAMES = (
    "imu.gyroscope_noise_density",
    "imu.gyroscope_random_walk",
    "imu.accelerometer_noise_density",
    "imu.accelerometer_random_walk",
)
NOISE = {
    "lecture": (0.015, 5e-5, 0.019, 5e-4),
    "adis16448": (1.6968e-4, 1.9393e-5, 2.0e-3, 3.0e-3),
}


def simulate(noise, trajectory="lecture", rate=200.0, duration=10.0, first_seed=1000):
    """Return many runs of the simulator over the same motion, and the parameters."""
    values = {"imu.preset": "perfect", "trajectory.type": trajectory, "rate": rate}
    values |= {"duration": duration + 1.0 / rate, **dict(zip(NAMES, noise, strict=True))}
    parameters = load_simulation(values)
    blocks = []
    for seed in range(first_seed, first_seed + RUNS):
        simulation = Body(dataclasses.replace(parameters, seed=seed))
        block = simulation.next(round(rate * duration) + 1)["imu"]
        beginning = blocks[0] if blocks else block
        # The motion is the same in all runs: one copy of it is enough.
        shared = {
            name: getattr(beginning, name) for name in ("motion", "ideal_gyro", "ideal_accel")
        }
        blocks.append(block._replace(values={**block.values, **shared}))
    return parameters, blocks


@pytest.fixture(scope="module", params=list(NOISE))
def runs(request):
    return simulate(NOISE[request.param])


def truth_of(block):
    motion = block.motion
    return states_of(block.t_ns, motion.position, motion.velocity, motion.q_wb)


def check(errors, matrices):
    low, high = anees_band(3, RUNS, BAND)
    for name, error, matrix in zip(
        ("attitude", "velocity", "position"), errors, matrices, strict=True
    ):
        mean = nees(error, matrix).mean()
        assert low <= mean <= high, (name, mean)


def test_dead_reckoning_is_consistent(runs):
    """Mean NEES of runs of 10 s in its band, in the world, as a message has it."""
    parameters, blocks = runs
    truth = truth_of(blocks[0])
    mean_square = propagate(truth, blocks[0].ideal_accel, parameters.imu)[0]
    attitude, velocity, position = [], [], []
    for block in blocks:
        states = dead_reckon(block.t_ns, block.gyro, block.accel, state_of_row(truth, 0))
        back = rotation.conjugate(states.q_wb[-1])
        attitude.append(rotation.log(rotation.multiply(truth.q_wb[-1], back)))
        velocity.append(truth.velocity[-1] - states.velocity[-1])
        position.append(truth.position[-1] - states.position[-1])
    errors = [np.array(values) for values in (attitude, velocity, position)]
    places = (ATTITUDE, VELOCITY, POSITION)
    check(errors, [mean_square[place, place] for place in places])


def test_preintegration_is_consistent(runs):
    """The residual of the true states, in the axes of the interval's end, over runs of 10 s."""
    parameters, blocks = runs
    h = np.diff(blocks[0].t_ns) * 1e-9
    readings = StepReadings(
        np.tile(h, (RUNS, 1)),
        np.stack([block.gyro for block in blocks]),
        np.stack([block.accel for block in blocks]),
    )
    ends = [
        States(
            *(np.tile(values[row], (RUNS, 1)) for values in motion_of(blocks[0])),
            np.stack([block.accel_bias[row] for block in blocks]),
            np.stack([block.gyro_bias[row] for block in blocks]),
        )
        for row in (0, -1)
    ]
    pre = preintegrate(readings, None, ends[0].gyro_bias, ends[0].accel_bias)
    residual = imu_residual(pre, ends[0], ends[1], parameters.gravity).residual
    ideal = StepReadings(h[None], blocks[0].ideal_gyro[None], blocks[0].ideal_accel[None])
    exact = preintegrate(ideal, parameters.imu)
    to_end = rotation.to_matrix(exact.gamma[0]).T
    # 2 vec(q) is 2 sin(angle / 2); the vector itself is wanted here.
    vector = 0.5 * residual[:, 3:6]
    w = np.sqrt(1.0 - np.sum(vector**2, axis=1, keepdims=True))
    attitude = rotation.log(np.concatenate([w, vector], axis=1))
    errors = [attitude]
    for rows in (slice(6, 9), slice(0, 3)):
        at_end = rotation.rotate_inverse(pre.gamma, residual[:, rows])
        # Along the arc: a covariance that was propagated along the estimate is in its coordinates.
        along = np.linalg.solve(rotation.right_jacobian(-attitude), at_end[..., None])
        errors.append(along[..., 0])
    p = exact.covariance[0]
    check(errors, [p[3:6, 3:6], *(to_end @ p[s, s] @ to_end.T for s in (slice(6, 9), slice(0, 3)))])
    walked = residual[:, 9:]
    low, high = anees_band(6, RUNS, BAND)
    assert low < nees(walked, p[9:, 9:]).mean() < high


def motion_of(block):
    return block.motion.position, block.motion.q_wb, block.motion.velocity


# Growth over time. The variance of 450 independent values (150 runs, 3 axes) is good to
# sqrt(2 / 450) = 6.7 %; four of these are 27 %.
SAMPLING = 4 * np.sqrt(2 / (3 * RUNS))


@pytest.mark.parametrize(
    ("noise", "velocity_law", "position_law"),
    [
        ((0.0, 0.0, 0.02, 0.0), lambda t: 0.02**2 * t, lambda t: 0.02**2 * t**3 / 3),
        ((0.0, 0.0, 0.0, 1e-3), lambda t: 1e-6 * t**3 / 3, lambda t: 1e-6 * t**5 / 20),
    ],
    ids=["white noise", "random walk"],
)
def test_errors_grow_as_the_closed_forms_say(noise, velocity_law, position_law):
    _, blocks = simulate(noise, "static", 100.0, 20.0)
    rows = [200, 500, 1000, 2000]
    states = [dead_reckon(b.t_ns, b.gyro, b.accel, AT_REST) for b in blocks]
    t = np.array(rows) * 0.01
    for name, law in (("velocity", velocity_law), ("position", position_law)):
        values = np.stack(
            [getattr(s, name)[rows] - getattr(truth_of(blocks[0]), name)[rows] for s in states]
        )
        errors = np.mean(values**2, axis=(0, 2))
        # Steps of 10 ms instead of continuous time: 3 h / 2 t at most, 1 % at 2 s.
        np.testing.assert_allclose(errors / law(t), 1.0, atol=SAMPLING + 0.01)


def test_the_anees_band_is_that_of_the_chi_square_table():
    """Against the table of chi-square: 2.5 % and 97.5 % of 60 degrees of freedom, over 20 runs."""
    low, high = anees_band(3, 20)
    assert low * 20 == pytest.approx(40.482, abs=1e-3)
    assert high * 20 == pytest.approx(83.298, abs=1e-3)


def test_the_mean_nees_of_normal_errors_lies_in_its_band():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(4, 4))
    errors = rng.normal(size=(20_000, 4)) @ root.T
    low, high = anees_band(4, 20_000, 0.9999)
    assert low < nees(errors, root @ root.T).mean() < high
