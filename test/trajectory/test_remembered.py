# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A motion that is sampled once: the same numbers, and nothing may change them."""

import numpy as np
import pytest

from imu_sim_ros.simulation.engine import Simulation
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.motion import RememberedTrajectory


@pytest.fixture
def trajectory():
    return Simulation(load_simulation({"trajectory.type": "lecture"})).trajectory


def test_the_same_times_give_the_same_arrays_which_are_read_only(trajectory):
    kept = RememberedTrajectory(trajectory)
    t = np.arange(100) * 0.01
    first = kept.sample(t)
    assert all(a is b for a, b in zip(first, kept.sample(t.copy()), strict=True))
    with pytest.raises(ValueError, match="read-only"):
        first.position[0] = 1.0
    t[5] = 7.0  # the caller's array is the caller's
    other, alone = kept.sample(t), trajectory.sample(t)
    assert all(np.array_equal(a, b) for a, b in zip(other, alone, strict=True))
    assert not np.array_equal(first.position[5], other.position[5])


def test_what_it_keeps_is_limited(trajectory):
    kept = RememberedTrajectory(trajectory)
    t = np.arange(100_001) * 1e-4
    assert kept.sample(t).position is not kept.sample(t).position
    few = t[:100]
    assert kept.sample(few).position is kept.sample(few).position


def test_motion_after_delays_is_kept_too(trajectory):
    """Else means of a campaign's run would differ in the last digit from those of a run alone."""
    kept, t, delays = RememberedTrajectory(trajectory), np.arange(100) * 0.01, np.array([0.002])
    rows, every = slice(0, 60), slice(0, 1)
    motion, later = kept.delayed(t, delays)
    again, later_again = kept.delayed(t.copy(), delays.copy())
    assert again is motion
    first = later(rows, every, True)
    assert later_again(rows, every, True) is first
    alone = trajectory.delayed(t, delays)[1](rows, every, True)
    assert all(np.array_equal(a, b) for a, b in zip(first, alone, strict=True))
    assert len(later(slice(60, 100), every, True).q_wb) == 40
    with pytest.raises(ValueError, match="read-only"):
        first.q_wb[0] = 1.0
    other = kept.delayed(t, 2.0 * delays)[1](rows, every, True)
    assert not np.array_equal(other.q_wb, first.q_wb)


def test_a_motion_without_delays_has_none_when_it_is_remembered():
    still = Simulation(load_simulation({"trajectory.type": "static"})).trajectory
    assert RememberedTrajectory(still).delayed(np.arange(3.0), np.array([0.1])) is None


@pytest.mark.parametrize("kind", ["lecture", "waypoints"])
def test_means_along_a_remembered_motion_are_those_of_the_motion(kind):
    values = {"trajectory.type": kind, "imu.sampling": "averaged", "imu.preset": "perfect"}
    alone = Simulation(load_simulation(values))
    kept = RememberedTrajectory(alone.trajectory)
    for _ in range(2):
        block = Simulation(load_simulation(values), trajectory=kept).next_block(300)
        assert np.array_equal(block.accel, alone.next_block(300).accel)
        alone.reset()
