# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The lead-in: rest, a jerk and the motion, each exact, before any trajectory."""

import numpy as np
import pytest


@pytest.mark.parametrize("kind", ["harmonic", "waypoints", "static"])
def test_its_derivatives_are_exact(build, assert_exact_derivatives, kind):
    values = {"x__amplitude": [2.0], "x__angular_frequency": [0.7]} if kind == "harmonic" else {}
    lead = {"lead_in__rest": 2.0, "lead_in__jerk": [0.1, -0.2, 0.3], "rest_transition": 0.5}
    trajectory = build(type=kind, **values, **lead)
    assert_exact_derivatives(trajectory, np.linspace(0.01, 4.2, 400), tolerance=1e-7)


def test_the_body_rests_then_jerks_then_flies(build):
    values = {"x__amplitude": [2.0], "x__angular_frequency": [0.7], "rest_transition": 1.0}
    flight = build(type="harmonic", rest_before=1.0, **values)
    led = build(type="harmonic", rest_before=1.0, lead_in__rest=2.0, **values)
    motion = led.sample(np.array([0.0, 1.0, 1.999, 2.5, 3.0, 3.5]))
    start = flight.sample(np.array([0.0])).position
    assert (motion.position[[0, 1, 4, 5]] == start).all()
    assert (motion.velocity[[0, 1, 4, 5]] == 0.0).all()
    assert np.allclose(motion.position[3] - start, [0.1, 0.1, 0.2])
    # b'' = 1024 s^2 (3 (1 - 2 x)^2 - 2 s) / T^2 with s = x (1 - x) is -32 / T^2 in the middle.
    assert np.allclose(motion.acceleration[3], np.multiply(-32.0, [0.1, 0.1, 0.2]))
    # After it the flight as it is without, 3 s later.
    t = np.linspace(1.0, 8.0, 50)
    for late, plain in zip(led.sample(t + 3.0), flight.sample(t), strict=True):
        np.testing.assert_allclose(late, plain, rtol=0, atol=1e-12)
    # What OpenVINS waits for: one second's deviation of the accelerometer above 0.5 m/s^2.
    window = led.sample(np.linspace(2.0, 3.0, 200)).acceleration
    assert np.sqrt(((window - window.mean(axis=0)) ** 2).sum(axis=1).mean()) > 1.5
