# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration runs: what is up, what turns, and how long."""

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.simulation.parameters import load_simulation

UP = [[0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]


def up_in_body(motion):
    return rotation.rotate_inverse(motion.q_wb, [0.0, 0.0, 1.0])


def test_six_positions_rest_with_each_axis_up_and_down(build):
    trajectory = build(type="six_position", soak=5.0, settle=1.0, dwell=4.0, transition=2.0)
    assert trajectory.duration == 5.0 + 6 * 7.0
    for k, axis in enumerate(UP):
        t = 5.0 + 7.0 * k + np.linspace(0.0, 5.0, 101)
        m = trajectory.sample(t)
        np.testing.assert_allclose(up_in_body(m), [axis] * 101, rtol=0, atol=1e-14)
        np.testing.assert_array_equal(m.angular_velocity, 0.0)
        turning = trajectory.sample(5.0 + 7.0 * k + 5.0 + np.linspace(0.1, 1.9, 10))
        assert np.all(np.linalg.norm(turning.angular_velocity, axis=-1) > 0.01)
    ends = trajectory.sample(np.array([0.0, trajectory.duration]))
    assert abs(np.sum(ends.q_wb[0] * ends.q_wb[1])) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("upside_down", [False, True])
def test_turntable_turns_each_axis_at_each_rate_both_ways(build, upside_down):
    rates = [0.5, 2.0]
    trajectory = build(
        type="turntable", rates=rates, settle=1.0, dwell=4.0, ramp=1.5, transition=2.0,
        upside_down=upside_down,
    )  # fmt: skip
    axes = UP if upside_down else UP[::2]
    start = 0.0
    for axis in axes:
        still = trajectory.sample(start + np.linspace(0.0, 5.0, 11))
        np.testing.assert_allclose(up_in_body(still), [axis] * 11, rtol=0, atol=1e-13)
        np.testing.assert_array_equal(still.angular_velocity, 0.0)
        start += 5.0
        for rate in rates:
            for sign in (1.0, -1.0):
                m = trajectory.sample(start + 1.5 + np.linspace(0.001, 3.999, 11))
                expected = [sign * rate * np.array(axis)] * 11
                np.testing.assert_allclose(m.angular_velocity, expected, rtol=0, atol=1e-14)
                np.testing.assert_allclose(up_in_body(m), [axis] * 11, rtol=0, atol=1e-13)
                np.testing.assert_array_equal(m.angular_acceleration, 0.0)
                start += 1.5 + 4.0 + 1.5
                m = trajectory.sample(start + np.linspace(0.0, 1.0, 5))
                np.testing.assert_array_equal(m.angular_velocity, 0.0)
                start += 1.0
        start += 2.0
    assert trajectory.duration == pytest.approx(start, abs=1e-9)


def test_a_tilted_table_turns_gravity_in_the_body(build):
    tilt = 0.5
    m = build(type="turntable", tilt=tilt).sample(np.linspace(14.5, 23.5, 50))
    np.testing.assert_allclose(up_in_body(m)[:, 2], np.cos(tilt), rtol=0, atol=1e-14)
    assert np.ptp(up_in_body(m)[:, 0]) > 0.4


def test_soak_steps_begin_with_each_round(build):
    p = load_simulation({"trajectory.type": "temperature_soak"})
    round_s = build(type="temperature_soak", repeat=1).duration
    steps = np.array(p.temperature.profile[::2])
    np.testing.assert_allclose(
        steps, round_s * np.arange(1, p.trajectory.repeat), rtol=0, atol=1e-9
    )
    assert build(type="temperature_soak").duration == pytest.approx(round_s * p.trajectory.repeat)
    assert p.trajectory.soak > 5 * p.temperature.time_constant


def test_ramp_lasts_as_long_as_its_profile(build):
    p = load_simulation({"trajectory.type": "temperature_ramp"})
    duration = build(type="temperature_ramp").duration
    assert duration == pytest.approx(p.temperature.profile[-2])


def test_a_table_without_rates_is_refused():
    with pytest.raises(ConfigurationError, match=r"trajectory\.rates = \[\]: must have at least"):
        load_simulation({"trajectory.type": "turntable", "trajectory.rates": []})
