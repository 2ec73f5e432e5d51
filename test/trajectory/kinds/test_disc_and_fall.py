# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np

from imu_sim_ros.core import rotation

G = np.array([0.0, 0.0, -9.81])


def test_disc_has_the_lecture_s_terms_in_the_body(build):
    t = np.linspace(0.0, 20.0, 401)
    m = build(type="rotating_disc").sample(t)
    r, r_dot = 0.1 * t, 0.1
    w = 1.0 + 0.15 * np.cos(0.5 * t)
    w_dot = -0.075 * np.sin(0.5 * t)
    centrifugal, coriolis, euler = r * w**2, 2 * w * r_dot, w_dot * r
    in_body = rotation.rotate_inverse(m.q_wb, m.acceleration)
    np.testing.assert_allclose(in_body[:, 0], -centrifugal, rtol=0, atol=1e-13)
    np.testing.assert_allclose(in_body[:, 1], coriolis + euler, rtol=0, atol=1e-13)
    np.testing.assert_allclose(m.angular_velocity[:, 2], w, rtol=0, atol=1e-14)
    np.testing.assert_allclose(m.angular_acceleration[:, 2], w_dot, rtol=0, atol=1e-14)
    assert np.min(np.max(np.abs([centrifugal, coriolis, euler]), axis=1)) > 0.05


def test_ball_without_friction_goes_straight(build):
    """A ball on a smooth disc keeps its velocity in the world: r = v t, angle = 0."""
    disc = build(type="polar", radius__polynomial=[0.0, 2.0], angle__polynomial=[0.3])
    m = disc.sample(np.linspace(0.0, 5.0, 11))
    np.testing.assert_allclose(m.acceleration, 0.0, atol=1e-15)


def test_free_fall_reads_nothing(build):
    t = np.linspace(0.0, 3.0, 31)
    m = build(type="free_fall").sample(t)
    force = rotation.rotate_inverse(m.q_wb, m.acceleration - G)
    np.testing.assert_array_equal(force, 0.0)
    np.testing.assert_allclose(m.position[:, 2], 1.5 + 10 * t - 4.905 * t**2, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(m.angular_velocity, [[1.0, 2.0, 0.5]] * 31)
