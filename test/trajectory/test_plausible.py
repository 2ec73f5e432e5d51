# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import math

import numpy as np
import pytest

from imu_sim_ros.sensors.imu.model import range_warnings
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.sensors import mount_sensors

G = (0.0, 0.0, -9.81)


def implausible(trajectory, gyroscope_range, accelerometer_range, gravity, duration):
    """Return what an IMU of these ranges at 200 Hz says of a motion."""
    parameters = load_simulation(
        {
            "imu.preset": "perfect",
            "imu.gyroscope_range": gyroscope_range,
            "imu.accelerometer_range": accelerometer_range,
            "gravity": gravity,
            "rate": 200.0,
        }
    )
    return range_warnings(
        mount_sensors(parameters)["imu"], World(trajectory, parameters, 0), duration
    )


def test_a_motion_within_the_ranges_is_not_remarked(build):
    assert implausible(build(type="lecture"), 0.4, 25.0, G, 60.0) == []


def test_no_range_is_no_limit(build):
    assert implausible(build(type="lecture"), 0.0, 0.0, G, math.inf) == []


def test_each_triad_s_worst_axis_is_named(build):
    circle = build(type="circle", time_scale=4.0)  # 2 rad/s, 20 m/s^2
    lines = implausible(circle, (0.0, 0.0, 1.5), (0.0, 10.0, 0.0), G, 60.0)
    assert len(lines) == 2
    assert "gyroscope's range: rate 2 rad/s on z" in lines[0]
    assert "accelerometer's range: specific force 20 m/s^2 on y" in lines[1]
    assert "range 10 m/s^2" in lines[1]


def test_rest_with_the_force_of_gravity_is_plausible_only_with_that_gravity(build):
    assert implausible(build(type="static"), 0.0, 9.0, G, 1.0)
    assert not implausible(build(type="static"), 0.0, 9.0, (0.0, 0.0, 0.0), 1.0)


def test_the_time_of_the_peak_is_told(build):
    trajectory = build(type="harmonic", yaw__amplitude=[1.0], yaw__angular_frequency=[0.1],
                       yaw__phase=[-np.pi / 2])  # fmt: skip
    (line,) = implausible(trajectory, 0.05, 0.0, G, 60.0)
    peak_time = float(line.split(" at ")[1].split(" s")[0])
    assert peak_time == pytest.approx(5 * np.pi, abs=0.05) or peak_time == pytest.approx(
        15 * np.pi, abs=0.05
    )
