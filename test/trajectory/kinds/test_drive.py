# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drives on the ground: no side slip, limits kept, times met or refused, grounds and roads."""

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory import path

BLOCK = [0.0, 0.0, 60.0, 0.0, 60.0, 40.0, 0.0, 40.0]


def body(trajectory, rate=50.0):
    t = np.arange(0.0, trajectory.duration, 1.0 / rate)
    m = trajectory.sample(t)
    return t, m, rotation.rotate_inverse(m.q_wb, m.velocity)


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"slope": [0.1, -0.05]},
        {"laps": 2, "deviation": 4.0},
        {"stops": [2.0, 5.0, 3.0, 2.0]},
        {"times": [0.0, 30.0, 50.0, 80.0]},
    ],
)
def test_the_body_moves_along_its_own_x_axis(build, values):
    _, _, velocity = body(build(type="drive", **values))
    assert np.abs(velocity[:, 1:]).max() < 1e-12 * velocity[:, 0].max() + 1e-13
    assert velocity[:, 0].min() > -1e-9


def test_y_lies_in_the_ground(build):
    _, m, _ = body(build(type="drive", slope=[0.2, 0.1]))
    up = np.array([-0.2, -0.1, 1.0])  # normal to z = 0.2 x + 0.1 y
    for axis in np.eye(3)[:2]:
        axis_world = rotation.rotate(m.q_wb, np.broadcast_to(axis, (len(m.q_wb), 3)))
        assert np.abs(axis_world @ up).max() < 1e-12


def test_limits_are_kept_and_each_is_reached(build):
    limits = {
        "speed_limit": 7.0,
        "acceleration_limit": 1.0,
        "braking_limit": 1.7,
        "lateral_limit": 1.3,
    }
    _, m, velocity = body(build(type="drive", **limits), 500.0)
    force = rotation.rotate_inverse(m.q_wb, m.acceleration)
    used = {
        "speed_limit": velocity[:, 0].max(),
        "acceleration_limit": force[:, 0].max(),
        "braking_limit": -force[:, 0].min(),
        "lateral_limit": np.abs(force[:, 1]).max(),
    }
    for name, limit in limits.items():
        # What is over at one place slows the whole drive, by some thousandths.
        assert 0.97 * limit < used[name] < 1.0001 * limit, name
    assert np.abs(m.angular_velocity[:, 2]).max() < 1.0


def test_heading_rate_and_radius_are_kept(build):
    trajectory = build(type="drive", heading_rate_limit=0.2, turning_radius=6.0)
    _, m, velocity = body(trajectory, 500.0)
    assert 0.19 < np.abs(m.angular_velocity[:, 2]).max() < 0.2001
    moving = velocity[:, 0] > 0.1
    turn = np.abs(m.angular_velocity[moving, 2]) / velocity[moving, 0]
    assert turn.max() < 1.0 / 6.0 * 1.001


def test_it_passes_every_waypoint_or_within_the_deviation(build):
    for deviation in (0.0, 3.0):
        _, m, _ = body(build(type="drive", positions=BLOCK, deviation=deviation), 200.0)
        for place in np.reshape(BLOCK, (-1, 2)):
            away = np.linalg.norm(m.position[:, :2] - place, axis=1).min()
            assert away < deviation + 0.02  # 5 m/s, a sample every 2.5 cm


def test_straight_between_corners(build):
    _, m, _ = body(build(type="drive", positions=BLOCK, deviation=3.0))
    along = (m.position[:, 0] > 20.0) & (m.position[:, 0] < 40.0)
    for side in (np.abs(m.position[along, 1]), np.abs(m.position[along, 1] - 40.0)):
        assert np.sum(side < 1e-12) > 50


def test_times_are_met_and_a_place_twice_is_a_stop(build):
    times = [0.0, 20.0, 30.0, 45.0, 70.0]
    positions = [*BLOCK[:4], *BLOCK[2:4], *BLOCK[4:]]
    trajectory = build(type="drive", positions=positions, times=times)
    assert trajectory.duration == 70.0
    m = trajectory.sample(np.array(times))
    # 1e-9 m along the path, and what the path passes a corner by.
    np.testing.assert_allclose(m.position[:, :2], np.reshape(positions, (-1, 2)), atol=3e-9)
    still = trajectory.sample(np.linspace(20.0, 30.0, 50))
    assert np.abs(still.velocity).max() == np.abs(still.acceleration).max() == 0.0
    assert np.abs(m.velocity[3]).max() > 0.5


def test_a_stop_lasts_as_long_as_said(build):
    t, _, velocity = body(build(type="drive", stops=[2.0, 5.0]), 1000.0)
    still = t[(velocity[:, 0] == 0.0) & (t > 5.0) & (t < t[-1] - 5.0)]
    # Whole steps of smoothing_time / 6, one more at each end at most.
    assert 4.99 < still[-1] - still[0] < 5.0 + 2.0 * 0.6 / 6.0
    assert len(still) == pytest.approx(1000 * (still[-1] - still[0]), abs=2)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_it_rests_at_both_ends(build, share):
    for values in ({}, {"times": [0.0, 30.0, 50.0, 80.0]}):
        trajectory = build(type="drive", **values)
        m = trajectory.sample(np.array([share * trajectory.duration]))
        assert max(np.abs(still).max() for still in (*m[1:3], *m[4:])) < 1e-10


def test_suspension_settles_at_the_acceleration_over_its_stiffness(build):
    """On a long straight drive pitch is -k a; in a long even turn roll is k v^2 / r."""
    straight = [0.0, 0.0, 400.0, 0.0]
    trajectory = build(type="drive", positions=straight, speed_limit=20.0, suspension_pitch=0.01)
    _, m, _ = body(trajectory)
    speeding = (m.velocity[:, 0] > 12.0) & (m.acceleration[:, 0] > 1.0)
    speeding &= m.velocity[:, 0] < 18.0
    pitch = rotation.to_euler(m.q_wb)[speeding, 1]
    np.testing.assert_allclose(pitch, -0.01 * 1.5, rtol=0.02)
    angle = np.linspace(0.0, 4.0 * np.pi, 49)
    circle = np.column_stack([30.0 * np.sin(angle), 30.0 * (1.0 - np.cos(angle))])
    turning = build(type="drive", positions=circle.ravel().tolist(), suspension_roll=0.01)
    t, m, velocity = body(turning)
    middle = (t > 20.0) & (t < t[-1] - 20.0)
    roll = rotation.to_euler(m.q_wb)[middle, 0]
    across = np.mean(velocity[middle, 0] * m.angular_velocity[middle, 2])
    np.testing.assert_allclose(np.mean(roll), 0.01 * across, rtol=0.02)


def test_the_road_shakes_with_the_square_of_the_speed(build):
    """RMS of a sum of lines over many periods; the bands of both speeds hold 100 periods."""
    root = {}
    for speed in (5.0, 10.0):
        road = {"road__noise_rms": [0.0, 0.0, 2.0], "road__noise_low": 5.0}
        trajectory = build(
            type="drive",
            positions=[0.0, 0.0, 800.0, 0.0],
            speed_limit=speed,
            road__noise_high=20.0,
            road_speed=10.0,
            **road,
        )
        _, m, _ = body(trajectory, 200.0)
        even = np.abs(m.velocity[:, 0] - np.median(m.velocity[:, 0])) < 1e-9
        root[speed] = np.sqrt(np.mean(m.acceleration[even, 2] ** 2))
        at_rest = trajectory.sample(np.zeros(1))
        assert np.abs(at_rest.acceleration).max() < 1e-9
    top = {speed: speed * 0.99 for speed in root}
    # 32 lines: mean square within a few percent of the stated one over 80 s.
    assert root[10.0] == pytest.approx(2.0, rel=0.05)
    assert root[10.0] / root[5.0] == pytest.approx((top[10.0] / top[5.0]) ** 2, rel=0.05)


def write_map(path, function, cell=2.0, columns=60, rows=50, corner=(-20.0, -20.0)):
    """Write an ESRI ASCII grid of a function at the centres of its cells."""
    x = corner[0] + cell * (np.arange(columns) + 0.5)
    y = corner[1] + cell * (np.arange(rows) + 0.5)
    heights = function(*np.meshgrid(x, y))
    lines = [
        *(f"ncols {columns}", f"nrows {rows}", f"xllcorner {corner[0]}", f"yllcorner {corner[1]}"),
        *(f"cellsize {cell}", "NODATA_value -9999"),
        *(" ".join(f"{h:.9f}" for h in row) for row in heights[::-1]),
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_map_of_a_plane_is_the_plane(build, tmp_path):
    path = write_map(tmp_path / "plane.asc", lambda x, y: 0.1 * x - 0.05 * y)
    plane = build(type="drive", slope=[0.1, -0.05], deviation=3.0)
    mapped = build(type="drive", height_map=str(path), deviation=3.0)
    t = np.linspace(0.0, plane.duration, 500)
    ours, expected = mapped.sample(t), plane.sample(t)
    # Splines of 2 m are exact to the fourth order: millimetres in a corner of 4 m, else rounding.
    np.testing.assert_allclose(ours.position, expected.position, atol=0.003)
    np.testing.assert_allclose(ours.q_wb, expected.q_wb, atol=0.002)


def test_hills_are_followed(build, assert_exact_derivatives, tmp_path):
    def hills(x, y):
        return 1.5 * np.sin(x / 12.0) * np.cos(y / 15.0)

    path = write_map(tmp_path / "hills.asc", hills)
    trajectory = build(type="drive", height_map=str(path), deviation=3.0)
    _, m, velocity = body(trajectory)
    expected = hills(m.position[:, 0], m.position[:, 1])
    # Bilinear cells cut a bump by cell^2 / 8 times its curvature along x and along y, 2 m:
    # 0.5 * 1.5 * (1 / 144 + 1 / 225) = 0.009 m
    assert np.abs(m.position[:, 2] - expected).max() < 0.012
    assert np.abs(velocity[:, 1:]).max() < 1e-12
    assert_exact_derivatives(trajectory, np.linspace(0.5, trajectory.duration - 0.5, 1000))


def refusal(error=ConfigurationError, **values):
    from imu_sim_ros.trajectory.build import build_trajectory

    layer = {f"trajectory.{name}": value for name, value in values.items()}
    with pytest.raises(error) as caught:
        build_trajectory(load_simulation({"trajectory.type": "drive", **layer}).trajectory)
    return caught.value.problems


def test_times_that_cannot_be_met_are_named_with_what_can():
    lines = refusal(times=[0.0, 1.0, 30.0, 33.0])
    assert len(lines) == 2
    assert "waypoint 2 at 1 s: cannot be reached from waypoint 1 before 1" in lines[0]
    assert "waypoint 4 at 33 s: cannot be reached from waypoint 3 before 4" in lines[1]
    # The time that a line names can be met.
    earliest = float(lines[0].split("before ")[1].split(" s")[0])
    positions = BLOCK[:4]
    refusal(positions=positions, times=[0.0, 1.0])
    later = [0.0, earliest + 30.0]
    load_simulation({"trajectory.type": "drive", "trajectory.times": [*later, 90.0, 120.0]})


def test_corners_that_are_too_tight_are_named():
    (line,) = refusal(turning_radius=50.0)
    assert "trajectory.turning_radius = 50: the path turns with" in line
    (line,) = refusal(positions=[0.0, 0.0, 50.0, 0.0, 1.0, 0.0], turning_radius=4.0)
    assert "near waypoint" in line or "from waypoint" in line


def test_bad_lists_are_named():
    assert "waypoints 1 and 2 are the same" in refusal(positions=[1.0, 1.0] * 2 + [5.0, 5.0])[0]
    assert "at least two waypoints" in refusal(positions=[0.0, 0.0])[0]
    assert (
        "waypoint 3 at 1 s: must be after waypoint 2 at 2 s"
        in (refusal(times=[0.0, 2.0, 1.0, 90.0])[0])
    )
    assert "must be from 2 to 3" in refusal(stops=[1.0, 5.0])[0]
    assert "must be from 2 to 3" in refusal(stops=[2.5, 5.0])[0]
    assert "for more than 0 s" in refusal(stops=[2.0, 0.0])[0]
    assert "speeds: 2 entries; must be empty or 3" in refusal(speeds=[1.0, 2.0])[0]
    assert "slope = [1.0, 2.0, 3.0, 4.0]: must be two" in refusal(slope=[1.0, 2.0, 3.0, 4.0])[0]
    lines = refusal(times=[0.0, 20.0, 40.0, 60.0], stops=[2.0, 5.0], laps=2, deviation=1.0)
    assert len(lines) == 3


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("ncols 3\nnrows 2\n1 2 3\n", "lacks cellsize"),
        ("ncols 3\nnrows 2\ncellsize 1\n1 2 3\n4 5\n", "has 5 heights; must be 2 rows of 3"),
        ("ncols 3\nnrows 2\ncellsize one\n1 2 3\n", "line 3: 'one': must be one number"),
        ("ncols 3\nnrows 2\ncellsize 1\n1 2 x\n", "line 4: not numbers"),
        ("ncols 90000\nnrows 90000\ncellsize 1\n1\n", "at most 25000000 cells"),
        ("ncols 3\nnrows 2\ncellsize 0\n1 2 3\n", "cellsize 0: must be from"),
        ("ncols 3\nnrows 2\ncellsize 10\n1 2 3\n4 5 6\n", "the drive leaves the map at x"),
        ("", "has no heights"),
    ],
)
def test_bad_maps_are_named(tmp_path, text, reason):
    path = tmp_path / "map.asc"
    path.write_text(text)
    (line,) = refusal(InputError, height_map=str(path))
    assert reason in line
    assert str(path) in line


def test_a_hole_in_the_map_is_named(tmp_path):
    path = write_map(
        tmp_path / "hole.asc", lambda x, y: np.where(np.hypot(x - 30.0, y) < 4.0, -9999.0, 0.0 * x)
    )
    (line,) = refusal(InputError, height_map=str(path))
    assert "has no height at x 2" in line


BACK = {
    "positions": [0.0, 0.0, 20.0, 0.0, 20.0, 15.0, 20.0, 5.0, 30.0, 0.0, 40.0, -5.0, 20.0, 5.0],
    "speeds": [3.0, 3.0, -1.0, -1.0, -1.0, 2.0],
    "turning_radius": 1.0,
}


@pytest.mark.parametrize("deviation", [0.0, 1.0])
def test_it_backs_up_without_a_jump(build, assert_exact_derivatives, deviation):
    """Along its own x axis, at the speeds given, and derivatives hold across both turns."""
    trajectory = build(type="drive", deviation=deviation, slope=[0.05, 0.02], **BACK)
    t, m, velocity = body(trajectory)
    assert np.abs(velocity[:, 1:]).max() < 1e-12
    assert_exact_derivatives(trajectory, np.linspace(0.1, trajectory.duration - 0.1, 2000))
    backing = velocity[:, 0] < -1e-3
    assert np.sum(np.diff(backing.astype(int)) == 1) == 1
    assert 0.97 < -velocity[:, 0].min() < 1.002  # the limit holds in the plane; sqrt(1 + 0.05^2)
    heading = rotation.to_euler(m.q_wb)[:, 2]
    reverse_start, reverse_end = t[backing][[0, -1]]
    # It enters the second leg northwards, leaves it southwards still facing north, and turns.
    assert heading[t < reverse_start][-1] == pytest.approx(np.pi / 2, abs=1e-6)
    assert heading[t > reverse_end][0] == pytest.approx(np.arctan2(5.0, -10.0), abs=1e-6)
    place = [m.position[t < reverse_start][-1], m.position[t > reverse_end][0]]
    np.testing.assert_allclose(np.array(place)[:, :2], [[20.0, 15.0], [40.0, -5.0]], atol=1e-3)


def test_the_nose_rises_with_the_acceleration_of_the_body(build):
    """Also where that is to the back and the speed is, too: pitch is -k a but for the springs."""
    springs = {"suspension_pitch": 0.01, "suspension_frequency": 5.0, "suspension_damping": 0.7}
    _, m, velocity = body(build(type="drive", **BACK, **springs))
    along = rotation.rotate_inverse(m.q_wb, m.acceleration)[:, 0]
    backing = velocity[:, 0] < -1e-2
    pitch = rotation.to_euler(m.q_wb)[backing, 1]
    slope = (pitch @ along[backing]) / (along[backing] @ along[backing])
    assert slope == pytest.approx(-0.01, rel=0.05)


def test_wheels_turn_back_when_it_backs_up():
    import imu_sim_ros as ims

    clean = {"ticks": 0, "slip_noise": 0.0, "encoder_noise": 0.0}
    straight = {"type": "drive", "positions": [0.0, 0.0, 20.0, 0.0, 5.0, 0.0], "speeds": [2.0, -1]}
    flight = ims.simulate(trajectory=straight, rate=100.0, sensors=["wheels"], wheels=clean)
    angle, pose = flight.wheels.angle, flight.wheels.pose
    radius = 20.0 / angle.max()
    np.testing.assert_allclose(angle[-1] * radius, 5.0, atol=1e-3)
    np.testing.assert_allclose(pose[-1], [5.0, 0.0, 0.0], atol=1e-3)
    assert flight.wheels.twist[:, 0].min() == pytest.approx(-1.0, abs=0.03)


@pytest.mark.parametrize("grade", [0.1, -0.05])
def test_an_even_grade_of_elevations_is_an_even_pitch(build, assert_exact_derivatives, grade):
    """Elevations in proportion to the way: pitch is -atan(grade) everywhere, corners and all."""
    bare = build(type="drive", deviation=3.0)
    path = bare.path
    u = np.linspace(0.0, path.length, 200_001)
    speed = np.hypot(*path.sample(u, 1)[1])
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) * u[1]
    heights = grade * np.interp(path.waypoint_u, u, way)
    trajectory = build(type="drive", deviation=3.0, elevations=heights.tolist())
    _, m, velocity = body(trajectory)
    angles = rotation.to_euler(m.q_wb)
    np.testing.assert_allclose(angles[:, 1], -np.arctan(grade), atol=1e-7)
    assert np.abs(angles[:, 0]).max() < 1e-12
    assert np.abs(velocity[:, 1:]).max() < 1e-12
    assert m.position[-1, 2] == pytest.approx(heights[-1], abs=1e-6)
    assert_exact_derivatives(trajectory, np.linspace(0.5, trajectory.duration - 0.5, 500))


def test_a_crest_is_spread_over_its_smoothing(build):
    """0.3 h dg below a crest: half the mean distance of a kernel with variance (1/2 + 1/12) h^2."""
    up = {"positions": [0.0, 0.0, 100.0, 0.0, 200.0, 0.0], "elevations": [0.0, 5.0, 0.0]}
    for smoothing in (4.0, 10.0):
        m = body(build(type="drive", elevation_smoothing=smoothing, **up))[1]
        assert 5.0 - m.position[:, 2].max() == pytest.approx(0.03 * smoothing, rel=0.05)
        np.testing.assert_allclose(m.position[[0, -1], 2], 0.0, atol=1e-9)


def test_what_cannot_be_backed_up_is_named():
    corner = [0.0, 0.0, 20.0, 0.0, 20.0, 15.0]
    (line,) = refusal(positions=corner, speeds=[1.0, -1.0])
    assert "at waypoint 2 the vehicle turns back, and the next one is 90 deg off the line" in line
    waypoints = [0.0, 0.0, 20.0, 0.0, 20.0, 5.0, 20.0, 0.0]
    (line,) = refusal(positions=waypoints, speeds=[1.0, 1.0, -1.0], turning_radius=2.0)
    assert "the path is not straight at waypoint 3" in line
    assert "0 m/s: must be above 0" in refusal(positions=corner, speeds=[1.0, 0.0])[0]
    lines = refusal(speeds=[1.0, 1.0, -1.0], elevations=[0.0] * 4, slope=[0.1, 0.0])
    assert "elevations: must be left out with trajectory.slope" in lines[0]
    assert "speeds: must be above 0 with trajectory.elevations" in lines[1]
    assert "elevations: 3 entries" in refusal(elevations=[1.0, 2.0, 3.0])[0]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({}, "longest leg, 890 km, is that from waypoint 4 to 5"),
        ({"deviation": 0.5}, "longest leg, 890 km, is that from waypoint 4 to 5"),
        (
            {"speeds": [2.0, 2.0, 2.0, 2.0, -2.0]},
            "longest leg, 890 km, is that from waypoint 4 to 5",
        ),
    ],
)
def test_one_wrong_waypoint_is_named_before_any_work(build, values, reason, monkeypatch):
    """A point 890 km away took minutes and 3.2 GB; nothing that takes long may have begun."""
    monkeypatch.setattr(path, "UniformSpline", None)
    route = [0.0, 0.0, 20.0, 0.0, 20.0, 20.0, 40.0, 20.0, 890e3, 20.0, 60.0, 20.0]
    with pytest.raises(ConfigurationError, match=reason):
        build(type="drive", positions=route, **values)


def test_a_wrong_time_is_named(build):
    with pytest.raises(ConfigurationError, match="3e\\+07 s are from waypoint 2 to 3"):
        build(type="drive", times=[0.0, 30.0, 3e7, 3e7 + 30.0])
