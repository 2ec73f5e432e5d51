# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Allan deviation that a sensor's parameters say."""

import numpy as np
import pytest

from imu_sim_ros.plots import readings as sensors
from imu_sim_ros.simulation.parameters import load_simulation


def test_deviation_is_that_of_the_parameters() -> None:
    """N / sqrt(tau) where white noise prevails, 0.664 B where 1/f does."""
    imu = load_simulation({"imu.preset": "mpu6000"}).imu
    short, long = sensors.allan_deviation(imu.gyroscope, np.array([0.01, 1e6]))
    assert short == pytest.approx(imu.gyroscope.noise_density[0] / 0.1, rel=1e-3)
    assert long == pytest.approx(0.664 * imu.gyroscope.bias_instability[0], rel=0.01)
