# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.simulation.parameters import load_simulation

CORNERS = [0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 4.0, 4.0, 0.5, 0.0, 4.0, 1.0]
HEADINGS = [0.0, 0.8, 2.4, 3.9]


def test_every_waypoint_is_met_at_its_time(build):
    times = [0.0, 3.0, 5.0, 9.0]
    trajectory = build(type="waypoints", positions=CORNERS, headings=HEADINGS, times=times)
    m = trajectory.sample(np.array(times))
    np.testing.assert_allclose(m.position, np.reshape(CORNERS, (4, 3)), rtol=0, atol=1e-12)
    level = np.column_stack([np.zeros((4, 2)), HEADINGS])
    alignment = np.abs(np.sum(m.q_wb * rotation.from_euler(level), axis=-1))
    np.testing.assert_allclose(alignment, 1.0, rtol=0, atol=1e-14)
    assert trajectory.duration == 9.0


def test_it_rests_at_both_ends(build):
    trajectory = build(type="waypoints", positions=CORNERS, headings=HEADINGS)
    ends = trajectory.sample(np.array([0.0, trajectory.duration]))
    for still in (ends.velocity, ends.acceleration, ends[4], ends[5]):
        np.testing.assert_allclose(still, 0.0, atol=1e-11)


@pytest.mark.parametrize(
    ("limits", "binding"),
    [
        ({"speed_limit": 0.5, "acceleration_limit": 9.0, "heading_rate_limit": 9.0}, "speed"),
        ({"speed_limit": 9.0, "acceleration_limit": 0.5, "heading_rate_limit": 9.0}, "force"),
        ({"speed_limit": 9.0, "acceleration_limit": 90.0, "heading_rate_limit": 0.2}, "rate"),
    ],
)
def test_the_limits_are_kept_and_one_is_reached(build, limits, binding):
    trajectory = build(type="waypoints", positions=CORNERS, headings=HEADINGS, **limits)
    m = trajectory.sample(np.linspace(0.0, trajectory.duration, 20001))
    used = {
        "speed": np.max(np.linalg.norm(m.velocity, axis=-1)) / limits["speed_limit"],
        "force": np.max(np.linalg.norm(m.acceleration, axis=-1)) / limits["acceleration_limit"],
        "rate": np.max(np.abs(m.angular_velocity)) / limits["heading_rate_limit"],
    }
    assert used[binding] == pytest.approx(1.0, abs=1e-4)
    assert max(used.values()) < 1.0001


def test_turning_on_the_spot(build):
    trajectory = build(
        type="waypoints", positions=[1.0, 2.0, 3.0] * 2, headings=[0.0, 6.283185307179586]
    )
    m = trajectory.sample(np.linspace(0.0, trajectory.duration, 1001))
    np.testing.assert_allclose(m.position, [[1.0, 2.0, 3.0]] * 1001, rtol=0, atol=1e-12)
    # The rate vanishes at both ends: the trapezoidal rule is a sum.
    angle = np.sum(m.angular_velocity[:, 2]) * trajectory.duration / 1000
    assert angle == pytest.approx(2 * np.pi, rel=1e-5)


def problems(**values):
    layer = {f"trajectory.{name}": value for name, value in values.items()}
    with pytest.raises(ConfigurationError) as caught:
        load_simulation({"trajectory.type": "waypoints", **layer})
    return caught.value.problems


def test_colliding_times_are_all_named():
    lines = problems(positions=CORNERS, times=[0.0, 2.0, 2.0, 1.0])
    assert lines == (
        "trajectory.times: waypoint 3 at 2 s: must be after waypoint 2 at 2 s",
        "trajectory.times: waypoint 4 at 1 s: must be after waypoint 3 at 2 s",
    )


def test_bad_waypoints_times_and_headings_are_told_in_lines():
    assert "waypoints 1 and 2 are the same" in problems(positions=[0.0, 0.0, 0.0] * 2)[0]
    assert "at least two waypoints" in problems(positions=[0.0, 0.0, 0.0])[0]
    assert "at least two waypoints" in problems(positions=[])[0]
    assert "3 for each entry" in problems(positions=[0.0, 0.0, 0.0, 1.0])[0]
    assert "waypoint 1 at 1 s: must be at 0" in problems(times=[1.0, 2.0])[0]
    assert "1 entries; must be empty or one for each of the 2" in problems(headings=[1.0])[0]
    assert "3 entries" in problems(times=[0.0, 1.0, 2.0])[0]
    both = problems(headings=[1.0], times=[0.0, 0.0])
    assert len(both) == 2
