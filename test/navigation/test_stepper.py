# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0


import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.navigation.state import Correction, NavigationState
from imu_sim_ros.navigation.stepper import Stepper

from .conftest import AT_REST

LEVEL = (0.0, 0.0, 9.81)
STILL = (0.0, 0.0, 0.0)
MS = 1_000_000


def test_first_reading_starts_the_clock():
    stepper = Stepper(AT_REST)
    assert stepper.t_ns is None
    assert not stepper.add(10 * MS, STILL, LEVEL)
    assert stepper.t_ns == 10 * MS
    assert stepper.add(20 * MS, STILL, LEVEL)


def test_a_caller_may_reuse_the_arrays_of_a_reading():
    """With Euler's method, a step has the reading at its start."""
    stepper, rate, force = Stepper(AT_REST, "euler"), np.zeros(3), np.array(LEVEL)
    stepper.add(0, rate, force)
    rate += 1.0
    force += 1.0
    stepper.add(10 * MS, rate, force)
    assert stepper.state.q_wb.tolist() == [1.0, 0.0, 0.0, 0.0]
    assert stepper.state.velocity == pytest.approx([0.0, 0.0, 0.0])


def test_duplicates_steps_back_and_gaps_are_counted_and_passed_over():
    stepper = Stepper(AT_REST, max_gap=0.1)
    moving = (1.0, 0.0, 9.81)
    stamps = [0, 10, 10, 20, 15, 25, 225, 235, 335, 435.000001]
    stepped = [stepper.add(round(t * MS), STILL, moving) for t in stamps]
    assert stepped == [False, True, False, True, False, True, False, True, True, False]
    counts = stepper.counts
    assert (counts.repeated, counts.backward, counts.gaps) == (1, 1, 2)
    # Four steps of 10 ms, and one of exactly max_gap, which is no gap.
    assert stepper.state.velocity[0] == pytest.approx(0.14)
    assert stepper.t_ns == 435 * MS + 1


def test_reset_keeps_counts_and_forgets_the_clock():
    stepper = Stepper(AT_REST)
    for t in (0, 0, 10, 20):
        stepper.add(t * MS, (0.0, 0.0, 1.0), (1.0, 0.0, 9.81))
    start = NavigationState(np.array([1.0, 2.0, 3.0]), np.zeros(3), np.array([0.0, 0, 0, 1.04]))
    stepper.reset(start)
    assert stepper.state.position.tolist() == [1.0, 2.0, 3.0]
    assert stepper.state.q_wb.tolist() == [0.0, 0.0, 0.0, 1.0]
    assert stepper.counts.repeated == 1
    assert not stepper.add(5 * MS, STILL, LEVEL)


def test_a_new_correction_holds_from_the_next_reading_on():
    stepper = Stepper(AT_REST, "euler")
    stepper.add(0, STILL, (0.0, 0.0, 10.0))
    stepper.correction = Correction(accelerometer_bias=(0.0, 0.0, 10.0 - 9.81))
    stepper.add(10 * MS, STILL, (0.0, 0.0, 10.0))
    assert stepper.state.velocity[2] == pytest.approx(0.19 * 0.01)
    stepper.add(20 * MS, STILL, (0.0, 0.0, 10.0))
    assert stepper.state.velocity[2] == pytest.approx(0.19 * 0.01)


def test_near_the_gimbal_lock_steps_are_counted_and_right():
    """A full turn of pitch through both locks, against the exact attitude."""
    stepper = Stepper(AT_REST, "midpoint", "euler_angles", gravity=STILL)
    for k in range(1001):
        stepper.add(k * 5 * MS, (0.0, 2.0, 0.0), STILL)
    turn = rotation.multiply(
        rotation.conjugate(stepper.state.q_wb), rotation.exp([0.0, 2.0 * 5.0, 0.0])
    )
    assert np.linalg.norm(rotation.log(turn)) < 1e-9
    # The margin is two steps of 0.01 rad here, on both sides of the three locks that 10 rad pass.
    assert 3 * 3 <= stepper.counts.gimbal_lock <= 3 * 5


def test_an_unknown_attitude_update_is_refused():
    with pytest.raises(ConfigurationError, match="attitude_update = 'dcm': must be one of"):
        Stepper(AT_REST, attitude="dcm")
