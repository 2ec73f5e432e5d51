# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A motion that is sampled once: the same numbers, and nothing may change them."""

import numpy as np
import pytest

from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.motion import RememberedTrajectory


@pytest.fixture
def trajectory():
    return Body(load_simulation({"trajectory.type": "lecture"})).trajectory


def test_the_same_times_give_the_same_arrays_which_are_read_only(trajectory):
    remembered = RememberedTrajectory(trajectory)
    t = np.arange(100) * 0.01
    original = remembered.sample(t)
    assert all(a is b for a, b in zip(original, remembered.sample(t.copy()), strict=True))
    with pytest.raises(ValueError, match="read-only"):
        original.position[0] = 1.0
    t[5] = 7.0  # the caller's array is the caller's
    changed, alone = remembered.sample(t), trajectory.sample(t)
    assert all(np.array_equal(a, b) for a, b in zip(changed, alone, strict=True))
    assert not np.array_equal(original.position[5], changed.position[5])


def test_what_it_keeps_is_limited(trajectory):
    remembered = RememberedTrajectory(trajectory)
    t = np.arange(100_001) * 1e-4
    assert remembered.sample(t).position is not remembered.sample(t).position
    few = t[:100]
    assert remembered.sample(few).position is remembered.sample(few).position


@pytest.mark.parametrize("kind", ["lecture", "waypoints"])
def test_means_along_a_remembered_motion_are_those_of_the_motion(kind):
    values = {"trajectory.type": kind, "imu.sampling": "averaged", "imu.preset": "perfect"}
    alone = Body(load_simulation(values))
    remembered = RememberedTrajectory(alone.trajectory)
    for _ in range(2):
        block = Body(load_simulation(values), trajectory=remembered).next(300)["imu"]
        assert np.array_equal(block.accel, alone.next(300)["imu"].accel)
        alone.reset()
