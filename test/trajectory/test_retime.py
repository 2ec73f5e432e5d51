# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rest, repetition and time scale, as seen from outside."""

import math

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.profile import Phase, RateProfile, smooth_step

CIRCLE = 4 * np.pi  # s for one round


def test_smooth_step_and_its_integral():
    x = np.linspace(0.0, 1.0, 2001)
    step = smooth_step(x)
    assert (step.value[0], step.value[-1], step.integral[-1]) == (0.0, 1.0, 0.5)
    np.testing.assert_allclose(np.gradient(step.value, x)[1:-1], step.slope[1:-1], atol=2e-5)
    np.testing.assert_allclose(np.gradient(step.integral, x)[1:-1], step.value[1:-1], atol=1e-6)


def test_profile_joins_phases():
    profile = RateProfile([Phase(2.0, 0.0, 0.0), Phase(1.0, 0.0, 4.0), Phase(math.inf, 4.0, 4.0)])
    value, rate, acceleration = profile.sample(np.array([1.0, 2.0, 2.5, 3.0, 5.0]))
    np.testing.assert_allclose(value[[0, 1, 3, 4]], [0.0, 0.0, 2.0, 10.0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(rate, [0.0, 0.0, 2.0, 4.0, 4.0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(acceleration, [0, 0, 7.5, 0, 0], rtol=0, atol=1e-12)
    assert profile.duration == math.inf


def test_rest_smooth_start_motion_smooth_stop_rest(build):
    plain = build(type="circle")
    trajectory = build(
        type="circle", length=10.0, rest_before=3.0, rest_after=2.0, rest_transition=1.0
    )
    # Each transition of 1 s takes the motion 0.5 s further.
    assert trajectory.duration == pytest.approx(3.0 + 1.0 + 9.0 + 1.0 + 2.0)
    resting = trajectory.sample(np.array([0.0, 1.0, 3.0, 14.0, 15.0, 16.0]))
    np.testing.assert_allclose(resting.velocity, 0.0, atol=1e-15)
    np.testing.assert_allclose(resting.acceleration, 0.0, atol=1e-14)
    np.testing.assert_allclose(resting.angular_velocity, 0.0, atol=1e-15)
    ends = plain.sample(np.array([0.0, 10.0]))
    np.testing.assert_allclose(resting.position[[0, 5]], ends.position, rtol=0, atol=1e-13)
    t = np.linspace(4.0, 13.0, 91)
    for actual, expected in zip(trajectory.sample(t), plain.sample(t - 3.5), strict=True):
        np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-12)


def test_the_start_from_rest_is_c2(build):
    """Acceleration and its own derivative are continuous where rest ends."""
    trajectory = build(type="circle", rest_before=3.0, rest_transition=1.0)
    for edge in (3.0, 4.0):
        for h in (1e-3, 1e-4):
            m = trajectory.sample(edge + np.array([-h, 0.0, h]))
            jerk = np.diff(m.acceleration, axis=0) / h
            # The jerk changes by its own derivative times h: at most 60 * 2.5 m/s^4 here.
            assert np.max(np.abs(np.diff(jerk, axis=0))) < 300 * h


def test_time_scale_is_the_chain_rule(build):
    plain, fast = build(type="lecture"), build(type="lecture", time_scale=2.0)
    t = np.linspace(0.0, 5.0, 51)
    m, expected = fast.sample(t), plain.sample(2 * t)
    np.testing.assert_allclose(m.position, expected.position, rtol=1e-14)
    np.testing.assert_allclose(m.velocity, 2 * expected.velocity, rtol=1e-14)
    np.testing.assert_allclose(m.acceleration, 4 * expected.acceleration, rtol=1e-14)
    np.testing.assert_allclose(m.angular_velocity, 2 * expected.angular_velocity, rtol=1e-14)
    np.testing.assert_allclose(m[5], 4 * expected.angular_acceleration, rtol=1e-14)


@pytest.mark.parametrize("repeat", [3, 0])
def test_a_closed_motion_loops(build, repeat):
    plain = build(type="circle")
    looped = build(type="circle", length=CIRCLE, repeat=repeat)
    assert looped.duration == (pytest.approx(3 * CIRCLE) if repeat else math.inf)
    t = np.linspace(0.0, 3 * CIRCLE, 301)
    actual, expected = looped.sample(t), plain.sample(t)
    np.testing.assert_allclose(actual.position, expected.position, rtol=0, atol=1e-12)
    alignment = np.abs(np.sum(actual.q_wb * expected.q_wb, axis=-1))
    np.testing.assert_allclose(alignment, 1.0, rtol=0, atol=1e-13)


@pytest.mark.parametrize("repeat", [4, 0])
def test_there_and_back_turns_at_both_ends_without_a_step_of_velocity(build, repeat):
    # 1 m/s along x for 5 s; a turn of 1 s overlaps the motion by 0.34375 s on each side.
    trajectory = build(
        type="harmonic", x__polynomial=[0.0, 1.0], length=5.0, repeat=repeat,
        repeat_mode="there_and_back", rest_transition=1.0,
    )  # fmt: skip
    period = 5.0 - 2 * 0.34375 + 1.0
    assert trajectory.duration == (pytest.approx(3 * period + 5.0) if repeat else math.inf)
    turns = 5.0 - 0.34375 + 0.5 + period * np.arange(3)
    m = trajectory.sample(turns)
    np.testing.assert_allclose(m.position[:, 0], [5.0, 0.0, 5.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(m.velocity, 0.0, atol=1e-12)
    t = np.linspace(0.0, 3 * period + 4.9, 20001)
    m = trajectory.sample(t)
    assert np.max(m.position[:, 0]) <= 5.0 + 1e-12
    assert np.min(m.position[:, 0]) >= -1e-12
    step = t[1]
    slope = np.gradient(m.velocity[:, 0], step)
    np.testing.assert_allclose(slope[1:-1], m.acceleration[1:-1, 0], rtol=0, atol=60 * step**2)


def test_thirty_days_are_exact(build):
    """The circle's angle after 30 days, at times that are exact in binary."""
    t = np.array([30 * 86400.0])
    m = build(type="circle", length=CIRCLE, repeat=0).sample(t)
    # 2.6e6 s are 206,265 rounds of a length rounded to 9e-16 s, in a float good to 5e-10 s.
    np.testing.assert_allclose(m.position, build(type="circle").sample(t).position, atol=1e-8)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"repeat": 2}, r"trajectory\.repeat = 2: the motion has no end; trajectory\.length"),
        ({"rest_after": 1.0}, r"trajectory\.rest_after = 1: the motion has no end"),
        ({"length": 5.0, "repeat": 2}, r"the motion ends 9.\d+ m, .* there_and_back repeats"),
        ({"length": 1.0, "rest_before": 1.0, "rest_transition": 3.0}, r"rest_transition = 3: must"),
        (
            {"length": 1.0, "repeat": 2, "repeat_mode": "there_and_back", "rest_transition": 2.0},
            r"rest_transition = 2: must be shorter for a motion that lasts 1 s",
        ),
    ],
)
def test_motions_that_cannot_be_retimed(build, values, line):
    with pytest.raises(ConfigurationError, match=line):
        build(type="circle", **values)


def test_more_than_there_is_cannot_be_taken(build):
    with pytest.raises(ConfigurationError, match=r"length = 300: the motion lasts 210 s"):
        build(type="six_position", length=300.0)


def test_bad_values_are_reported_together():
    with pytest.raises(ConfigurationError) as caught:
        load_simulation(
            {
                "trajectory.time_scale": 0.0,
                "trajectory.repeat": -1,
                "trajectory.rest_before": -1.0,
                "trajectory.repeat_mode": "back",
                "trajectory.length": math.nan,
            }
        )
    assert len(caught.value.problems) == 5


def test_vibration_goes_on_at_rest(build):
    m = build(type="static", vibration__noise_rms=1.0).sample(np.arange(100) * 0.001)
    assert np.std(m.acceleration) > 0.1
    still = rotation.IDENTITY
    np.testing.assert_allclose(m.q_wb, [still] * 100, rtol=0, atol=0)


def test_no_wrapper_without_need():
    parameters = load_simulation({"trajectory.type": "circle"}).trajectory
    assert type(build_trajectory(parameters)).__name__ == "Harmonic"
