# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The covariance in the messages against the errors of many seeded runs."""

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import LiveReading, LiveState
from imu_sim_ros.navigation.parameters import load_integrator
from imu_sim_ros.nodes.integrator.odometer import LiveIntegrator
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

RUNS = 24
TURN_ON = {"gyroscope_turn_on_bias_sigma": 2e-3, "accelerometer_turn_on_bias_sigma": 0.05}


PLACES = {
    "aligned": {},
    # So far away that what the attitude's and the rate's errors do there decides.
    "mounted": {
        "imu.lever_arm": [5.0, -4.0, 3.0],
        "imu.mounting": [1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0],
    },
}


def final_errors(seed: int, place: dict[str, list[float]]) -> tuple[float, float]:
    """Return the squared errors of pose and twist after 5 s in units of their covariance."""
    sensor = {f"imu.{name}": value for name, value in TURN_ON.items()} | place
    simulation = Body(
        load_simulation(
            {"imu.preset": "lecture", "trajectory.type": "lecture", **sensor},
            {"rate": 25.0, "duration": 5.0, "seed": seed, "start_time": 1.0},
        )
    )
    block = simulation.next(125)["imu"]
    motion = block.motion
    velocity_b = rotation.rotate_inverse(motion.q_wb, motion.velocity)
    values = {"initial_state": "truth", **sensor}
    odometer = LiveIntegrator(load_integrator(values), lambda _: None, lambda: False)
    initial_values = (motion.position[0], motion.q_wb[0], velocity_b[0], motion.angular_velocity[0])
    rows = list(odometer.add_truth(LiveState(int(block.t_ns[0]), *map(tuple, initial_values))))
    for t_ns, gyro, accel in zip(
        block.t_ns.tolist(), block.gyro.tolist(), block.accel.tolist(), strict=True
    ):
        rows += odometer.add_reading(LiveReading(t_ns, tuple(gyro), tuple(accel)))
    assert len(rows) == 125
    row = rows[-1]
    turn = rotation.multiply(motion.q_wb[-1], rotation.conjugate(row.q_wb))
    pose = np.concatenate([motion.position[-1] - row.position, rotation.log(turn)])
    twist = np.concatenate(
        [
            velocity_b[-1] - row.velocity_b,
            motion.angular_velocity[-1] - row.angular_velocity_b,
        ]
    )
    return (
        float(pose @ np.linalg.solve(row.covariance, pose)),
        float(twist @ np.linalg.solve(row.twist_covariance, twist)),
    )


@pytest.fixture(scope="module", params=list(PLACES))
def squared_errors(request) -> np.ndarray:
    return np.array([final_errors(seed, PLACES[request.param]) for seed in range(RUNS)])


@pytest.mark.parametrize(("column", "what"), [(0, "pose"), (1, "twist")])
def test_errors_are_as_large_as_the_covariance_says(squared_errors, column, what):
    """The sum over the runs is chi-square with 6 per run: mean 6, deviation sqrt(12 / RUNS) = 0.71.

    Three deviations are 35 %; a sigma that is wrong by sqrt(2) would be off by 100 % or 50 %.
    """
    mean = squared_errors[:, column].mean()
    assert abs(mean - 6.0) < 3.0 * np.sqrt(12.0 / RUNS), what
