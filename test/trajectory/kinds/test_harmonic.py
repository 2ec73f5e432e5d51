# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.simulation.parameters import load_simulation

G = np.array([0.0, 0.0, -9.81])


def specific_force(motion):
    return rotation.rotate_inverse(motion.q_wb, motion.acceleration - G)


def test_lecture_is_the_lecture_s_equation(build):
    t = np.linspace(0.0, 20.0, 501)
    m = build(type="lecture").sample(t)
    k = np.pi / 10
    c, s = np.cos(k * t), np.sin(k * t)
    expected = [
        np.column_stack([15 * c + 5, 20 * s + 5, np.sin(10 * k * t) + 5]),
        np.column_stack([-15 * k * s, 20 * k * c, 10 * k * np.cos(10 * k * t)]),
        np.column_stack([-15 * k**2 * c, -20 * k**2 * s, -100 * k**2 * np.sin(10 * k * t)]),
    ]
    for actual, reference in zip(m[:3], expected, strict=True):
        np.testing.assert_allclose(actual, reference, rtol=0, atol=1e-13)
    euler = np.column_stack([0.1 * np.cos(t), 0.2 * np.sin(t), k * t])
    rates = np.column_stack([-0.1 * np.sin(t), 0.2 * np.cos(t), np.full_like(t, k)])
    eq_37 = rotation.euler_rates_to_body_rates(euler) @ rates[..., None]
    np.testing.assert_allclose(m.angular_velocity, eq_37[..., 0], rtol=0, atol=1e-14)
    alignment = np.abs(np.sum(m.q_wb * rotation.from_euler(euler), axis=-1))
    np.testing.assert_allclose(alignment, 1.0, rtol=0, atol=1e-14)


def test_at_rest_gravity_is_read_upwards(build):
    m = build(type="static", position=[1.0, 2.0, 3.0]).sample(np.arange(4.0))
    np.testing.assert_array_equal(m.position, [[1.0, 2.0, 3.0]] * 4)
    np.testing.assert_allclose(specific_force(m), [[0.0, 0.0, 9.81]] * 4, rtol=0, atol=1e-15)
    tilted = build(type="static", roll_pitch_yaw=[np.pi / 2, 0.0, 1.0]).sample(np.zeros(1))
    np.testing.assert_allclose(specific_force(tilted), [[0.0, 9.81, 0.0]], rtol=0, atol=1e-14)


def test_circle_reads_the_centripetal_acceleration_inwards(build):
    m = build(type="circle").sample(np.linspace(0.0, 30.0, 301))
    expected = [0.0, 5.0 * 0.5**2, 9.81]
    np.testing.assert_allclose(specific_force(m), [expected] * 301, rtol=0, atol=1e-13)
    np.testing.assert_allclose(m.angular_velocity, [[0.0, 0.0, 0.5]] * 301, rtol=0, atol=1e-15)
    forward = rotation.rotate_inverse(m.q_wb, m.velocity)
    np.testing.assert_allclose(forward, [[2.5, 0.0, 0.0]] * 301, rtol=0, atol=1e-13)


def test_coning_turns_the_gyroscope_s_z_axis_on_average(build):
    # One period; mean of omega_z = yaw' cos cos - pitch' sin(roll) = -beta w cos(wt) sin(beta cos)
    # is -w (beta^2 / 2 - beta^4 / 16) to fourth order.
    beta, w = np.pi / 180, 20 * np.pi
    m = build(type="coning").sample(np.arange(400) * (0.1 / 400))
    mean = np.mean(m.angular_velocity[:, 2])
    assert mean == pytest.approx(-w * (beta**2 / 2 - beta**4 / 16), rel=1e-8)


def test_sculling_rectifies_in_the_body(build):
    # a_y = -A sin(wt) and roll = beta sin(wt): the mean of the body's f_y vanishes, the mean of
    # f_z = g cos(roll) - a_y sin(roll) exceeds g cos by A beta / 2 to first order.
    beta, w, amplitude = np.pi / 180, 20 * np.pi, 10.0
    m = build(type="sculling").sample(np.arange(400) * (2 * np.pi / w / 400))
    roll = rotation.to_euler(m.q_wb)[:, 0]
    excess = np.mean(specific_force(m)[:, 2] - 9.81 * np.cos(roll))
    assert excess == pytest.approx(amplitude * beta / 2, rel=1e-3)


def test_excitation_moves_every_axis_well(build):
    m = build(type="excitation").sample(np.arange(0.0, 60.0, 0.01))
    assert np.all(np.std(m.angular_velocity, axis=0) > 0.4)
    assert np.all(np.std(m.acceleration, axis=0) > 1.0)
    assert np.all(np.max(np.abs(m.angular_velocity), axis=0) < 2.0)
    # No two axes alike: correlations of the six readings stay small.
    readings = np.column_stack([m.angular_velocity, m.acceleration])
    off_diagonal = np.corrcoef(readings.T) - np.eye(6)
    assert np.max(np.abs(off_diagonal)) < 0.3


def test_sinusoids_of_one_frequency_add_up(build):
    t = np.linspace(0.0, 5.0, 101)
    m = build(
        type="harmonic",
        x__polynomial=[1.0, 2.0, 3.0, 4.0],
        x__amplitude=[1.0, 0.5, 2.0],
        x__angular_frequency=[2.0, 3.0, 2.0],
        x__phase=[0.1, 0.2, 0.3],
    ).sample(t)
    waves = np.sin(2 * t + 0.1) + 0.5 * np.sin(3 * t + 0.2) + 2 * np.sin(2 * t + 0.3)
    expected = 1 + 2 * t + 3 * t**2 + 4 * t**3 + waves
    np.testing.assert_allclose(m.position[:, 0], expected, rtol=1e-13)


def test_all_bad_values_are_reported_together():
    with pytest.raises(ConfigurationError) as caught:
        load_simulation(
            {
                "trajectory.type": "harmonic",
                "trajectory.w.polynomial": [1.0],
                "trajectory.x.amplitude": [float("nan")],
                "trajectory.y.angular_frequency": [-1.0],
                "trajectory.roll.phase": "x",
            }
        )
    text = str(caught.value)
    for name in ("trajectory.w.polynomial: unknown", "x.amplitude", "y.angular", "roll.phase"):
        assert name in text


def test_lists_of_different_lengths_are_named():
    with pytest.raises(ConfigurationError) as caught:
        load_simulation(
            {
                "trajectory.type": "harmonic",
                "trajectory.x.amplitude": [1.0, 2.0],
                "trajectory.x.angular_frequency": [1.0],
                "trajectory.yaw.amplitude": [1.0],
                "trajectory.yaw.angular_frequency": [1.0],
                "trajectory.yaw.phase": [1.0, 2.0],
            }
        )
    assert [p.split(" = ")[0] for p in caught.value.problems] == [
        "trajectory.x.angular_frequency",
        "trajectory.yaw.phase",
    ]
