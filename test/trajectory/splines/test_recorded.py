# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recorded poses: real files, gaps, signs, repeats, and how the fit is reported."""

from pathlib import Path

import numpy as np
import pytest
from recordings import EUROC, KAIST, TUM, missing

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.records import States
from imu_sim_ros.inputs.poses import read_poses, write_tum
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.recorded import find_recorded_motion

DEG = np.pi / 180
G = np.array([0.0, 0.0, -9.81])


def recording(path, *values):
    """Return a recording as a parameter, which is skipped where the file is missing."""
    absent = pytest.mark.skipif(not path.is_file(), reason=missing(path))
    return pytest.param(path, *values, id=path.name.split("_")[0], marks=absent)


REAL = [recording(path) for path in (EUROC, TUM, KAIST)]


@pytest.fixture
def follow(build, tmp_path):
    """Write poses to a file and build the trajectory that follows them."""

    def write_and_build(t, position, q_wb, **parameters):
        path = tmp_path / "poses.txt"
        t_ns = 1_500_000_000_000_000_000 + np.round(np.asarray(t) * 1e9).astype(np.int64)
        write_tum(path, States(t_ns, position, q_wb))
        return build(type="poses", file=str(path), **parameters)

    return write_and_build


def smooth_motion(t):
    """Return a smooth motion of 0.5 to 2 rad/s, far below the default cut-off."""
    position = np.column_stack([np.sin(t), np.cos(1.3 * t), 0.5 * np.sin(2 * t)])
    euler = np.column_stack([0.4 * np.sin(1.1 * t), 0.3 * np.cos(0.9 * t), 0.8 * t])
    return position, rotation.from_euler(euler)


def midpoint(t, motion):
    """Integrate ideal readings by the midpoint rule (lecture eqs. 32, 33); slow and plain."""
    dt = np.diff(t)[:, None]
    rate = 0.5 * (motion.angular_velocity[1:] + motion.angular_velocity[:-1])
    turns = np.concatenate([motion.q_wb[:1], rotation.exp(rate * dt)])
    q = rotation.cumulative_product(turns)
    force_b = rotation.rotate_inverse(motion.q_wb, motion.acceleration - G)
    force = rotation.rotate(q, force_b) + G
    mean = 0.5 * (force[1:] + force[:-1])
    v = motion.velocity[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(mean * dt, axis=0)])
    steps = v[:-1] * dt + 0.5 * mean * dt**2
    p = motion.position[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return p, q


@pytest.mark.parametrize(
    ("path", "position_rms", "angle_rms"),
    [
        recording(EUROC, 0.1e-3, 0.03 * DEG),
        recording(TUM, 0.2e-3, 0.1 * DEG),
        # The stamps are times of arrival: up to ten poses, centimetres apart, within 1 ms.
        recording(KAIST, 3.6e-3, 0.1 * DEG),
    ],
)
def test_real_poses_are_passed_closely(build, path, position_rms, angle_rms):
    trajectory = build(type="poses", file=str(path))
    report = find_recorded_motion(trajectory).report
    assert report.rms_position < position_rms
    assert report.rms_angle < angle_rms
    poses = read_poses(path)
    t = (poses.t_ns - poses.t_ns[0]) * 1e-9
    motion = trajectory.sample(t)
    distance = np.linalg.norm(motion.position - poses.position, axis=-1)
    assert np.sqrt(np.mean(distance**2)) == pytest.approx(report.rms_position)
    assert np.max(distance) == pytest.approx(report.max_position)
    assert f"(at {t[np.argmax(distance)]:.2f} s)" in report.lines()[1]
    between = rotation.multiply(rotation.conjugate(motion.q_wb), poses.q_wb)
    angle = np.linalg.norm(rotation.log(between), axis=-1)
    assert np.sqrt(np.mean(angle**2)) == pytest.approx(report.rms_angle)
    assert report.largest_gap == pytest.approx(np.max(np.diff(t)))
    assert trajectory.duration == pytest.approx(t[-1])


@pytest.mark.parametrize("path", REAL)
def test_derivatives_of_real_poses_are_exact(build, assert_exact_derivatives, path):
    trajectory = build(type="poses", file=str(path))
    times = np.random.default_rng(3).uniform(1.0, trajectory.duration - 1.0, 5000)
    assert_exact_derivatives(trajectory, times)


@pytest.mark.parametrize("path", [recording(EUROC)])
def test_velocity_agrees_with_the_file_s_own(build, path):
    velocity = np.loadtxt(path, delimiter=",", usecols=(8, 9, 10))
    poses = read_poses(path)
    motion = build(type="poses", file=str(path)).sample((poses.t_ns - poses.t_ns[0]) * 1e-9)
    rms = np.sqrt(np.mean(np.sum((motion.velocity - velocity) ** 2, axis=-1)))
    assert rms < 0.01  # m/s


@pytest.mark.parametrize("path", REAL)
def test_integrated_readings_converge_with_order_two(build, path):
    trajectory = build(type="poses", file=str(path))
    errors = []
    for rate in (200.0, 400.0, 800.0):
        n = int(min(80.0, np.floor(trajectory.duration)) * rate)
        t = np.arange(n + 1) / rate
        motion = trajectory.sample(t)
        p, q = midpoint(t, motion)
        turned = rotation.log(rotation.multiply(rotation.conjugate(q[-1]), motion.q_wb[-1]))
        errors.append((np.linalg.norm(p[-1] - motion.position[-1]), np.linalg.norm(turned)))
    orders = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    np.testing.assert_allclose(orders[:, 0], 2.0, atol=0.3)


def test_smooth_motion_is_recovered(follow):
    t = np.arange(0.0, 10.0, 0.01)
    trajectory = follow(t, *smooth_motion(t))
    dense = np.linspace(0.2, 9.7, 997)
    m = trajectory.sample(dense)
    position, q_wb = smooth_motion(dense)
    np.testing.assert_allclose(m.position, position, rtol=0, atol=1e-7)
    acceleration = np.column_stack(
        [-np.sin(dense), -1.69 * np.cos(1.3 * dense), -2.0 * np.sin(2 * dense)]
    )
    np.testing.assert_allclose(m.acceleration, acceleration, rtol=0, atol=1e-3)
    angle = rotation.log(rotation.multiply(rotation.conjugate(m.q_wb), q_wb))
    assert np.max(np.abs(angle)) < 1e-6


def test_irregular_stamps_signs_and_gaps(follow):
    random = np.random.default_rng(4)
    t = np.cumsum(random.uniform(0.002, 0.03, 1000))
    t -= t[0]
    t = t[(t < 5.0) | (t > 5.8)]
    position, q_wb = smooth_motion(t)
    q_wb = q_wb * random.choice([-1.0, 1.0], len(t))[:, None]
    trajectory = follow(t, position, q_wb)
    report = find_recorded_motion(trajectory).report
    assert report.rms_position < 1e-4
    assert report.rms_angle < 1e-4
    assert 0.8 <= report.largest_gap < 0.86
    assert report.largest_gap_at == pytest.approx(5.0, abs=0.04)
    gap_t = np.linspace(5.0, 5.8, 50)
    bridged = np.linalg.norm(trajectory.sample(gap_t).position - smooth_motion(gap_t)[0], axis=-1)
    assert np.max(bridged) < 0.01
    assert report.peak_rate < 1.5
    assert report.peak_acceleration < 4.0


def test_repeated_poses_are_left_out_and_counted(tmp_path, build):
    rows = [f"{k / 10:.1f} {k} 0 0 0 0 0 1" for k in range(20)]
    rows.insert(5, rows[5])
    rows.insert(9, rows[9])
    path = tmp_path / "repeats.txt"
    path.write_text("\n".join(rows))
    report = find_recorded_motion(build(type="poses", file=str(path))).report
    assert (report.poses, report.repeated) == (20, 2)
    assert any("2 duplicates" in line for line in report.lines())


def test_white_noise_is_smoothed_as_the_cutoff_says(follow):
    """The filter 1 / (1 + (f/fc)^6) lets as much white noise through as its integral says.

    Of the variance s^2 at rate r it leaves
    s^2 (2/r) integral_0^inf df / (1 + x^6)^2 = s^2 (2 fc / r) (5/6) (pi/6) / sin(pi/6).
    Some 20 s of 5 Hz band: 200 independent values per axis, 3 axes: 4 % of standard error.
    """
    random = np.random.default_rng(5)
    sigma, rate, cutoff = 1e-3, 200.0, 5.0
    t = np.arange(0.0, 20.0, 1 / rate)
    noise = sigma * random.standard_normal((len(t), 3))
    level = np.tile(rotation.IDENTITY, (len(t), 1))
    trajectory = follow(t, noise, level, cutoff=cutoff)
    through = np.sqrt(np.mean(trajectory.sample(t[100:-100]).position ** 2))
    gain = np.sqrt(2 * cutoff / rate * (5 / 6) * (np.pi / 6) / np.sin(np.pi / 6))
    assert through == pytest.approx(sigma * gain, rel=0.12)


def test_rotation_noise_is_smoothed_like_position_noise(follow):
    random = np.random.default_rng(6)
    t = np.arange(0.0, 20.0, 0.005)
    noise = 1e-3 * random.standard_normal((len(t), 3))
    trajectory = follow(t, noise, rotation.exp(noise), cutoff=5.0)
    m = trajectory.sample(t)
    # The same numbers as positions and as small turns: the fits agree up to products of turns.
    np.testing.assert_allclose(rotation.log(m.q_wb), m.position, rtol=0, atol=2e-6)


def test_a_wider_knot_spacing_is_smoother(follow):
    random = np.random.default_rng(7)
    t = np.arange(0.0, 10.0, 0.01)
    position, q_wb = smooth_motion(t)
    position = position + 1e-3 * random.standard_normal(position.shape)
    peaks = [
        find_recorded_motion(
            follow(t, position, q_wb, knot_spacing=h, cutoff=50.0)
        ).report.peak_acceleration
        for h in (0.02, 0.05, 0.2)
    ]
    assert peaks[0] > 2 * peaks[1] > 2 * peaks[2]


def test_sparse_poses_are_met(follow):
    """One pose a second: the spline's knots follow, and it goes through the poses."""
    t = np.arange(0.0, 30.0)
    position, q_wb = smooth_motion(0.3 * t)
    report = find_recorded_motion(follow(t, position, q_wb)).report
    assert report.knot_spacing == pytest.approx(1.0)
    assert report.max_position < 1e-3
    assert report.max_angle < 1e-3


def test_the_report_is_found_below_wrappers(follow):
    t = np.arange(0.0, 5.0, 0.01)
    trajectory = follow(t, *smooth_motion(t), rest_before=1.0, repeat=2,
                        repeat_mode="there_and_back", vibration__noise_rms=0.1)  # fmt: skip
    assert find_recorded_motion(trajectory).report.poses == 500


def test_no_report_without_poses(build):
    assert find_recorded_motion(build(type="lecture")) is None


def test_four_poses_are_enough_and_three_are_not(follow):
    t = np.arange(4) * 0.1
    position, q_wb = smooth_motion(t)
    assert find_recorded_motion(follow(t, position, q_wb)).report.max_position < 1e-3
    with pytest.raises(InputError, match=r"holds 3 poses; a spline needs 4 or more"):
        follow(t[:3], position[:3], q_wb[:3])


def test_a_gap_too_long_is_named(follow):
    t = np.concatenate([np.arange(0.0, 2.0, 0.1), np.arange(9.0, 11.0, 0.1)])
    with pytest.raises(InputError, match=r"a gap of 7.1 s at 1.900 s .*max_gap, 5 s"):
        follow(t, *smooth_motion(t))
    assert find_recorded_motion(
        follow(t, *smooth_motion(t), max_gap=10.0)
    ).report.largest_gap == pytest.approx(7.1)


def test_a_gap_of_too_many_knots_is_named(follow):
    t = np.concatenate([np.arange(0.0, 2.0, 0.01), np.arange(60.0, 62.0, 0.01)])
    with pytest.raises(InputError, match=r"knot_spacing must be at least 0.116 s"):
        follow(t, *smooth_motion(0.05 * t), max_gap=100.0)
    bridged = follow(t, *smooth_motion(0.05 * t), max_gap=100.0, knot_spacing=0.12)
    assert find_recorded_motion(bridged).report.max_position < 1e-3


def test_late_stamps_count_little_on_request(follow):
    """One pose in twenty is stamped 50 ms late, as where messages wait: up to 8 cm off."""
    random = np.random.default_rng(9)
    t = np.arange(0.0, 20.0, 0.02)
    position, q_wb = smooth_motion(t)
    stamps = np.sort(t + 0.05 * (random.random(len(t)) < 0.05) * random.random(len(t)))
    dense = np.linspace(1.0, 19.0, 1000)
    true, _ = smooth_motion(dense)
    errors, peaks = [], []
    for distance in (0.0, 0.002):
        trajectory = follow(stamps, position, q_wb, outlier_distance=distance)
        errors.append(np.sqrt(np.mean((trajectory.sample(dense).position - true) ** 2)))
        peaks.append(find_recorded_motion(trajectory).report.peak_acceleration)
    assert errors[1] < 0.3 * errors[0]
    assert peaks[1] < 0.3 * peaks[0]


@pytest.mark.parametrize("path", [recording(KAIST)])
def test_real_late_stamps_are_overcome(build, path):
    """The drone of KAIST's file flies at no more than 1.3 m/s."""
    report = find_recorded_motion(
        build(type="poses", file=str(path), cutoff=6.0, outlier_distance=0.002)
    ).report
    assert report.peak_speed < 1.4
    assert report.peak_acceleration < 10.0


@pytest.mark.parametrize("path", [recording(EUROC), recording(TUM)])
def test_a_file_without_late_stamps_is_followed_as_before(build, path):
    plain, robust = (
        find_recorded_motion(build(type="poses", file=str(path), outlier_distance=distance)).report
        for distance in (0.0, 0.002)
    )
    assert robust.rms_position == pytest.approx(plain.rms_position, rel=0.05)


def test_a_low_cutoff_gets_wider_knots(follow):
    t = np.arange(0.0, 20.0, 0.01)
    assert find_recorded_motion(
        follow(t, *smooth_motion(t), cutoff=2.0)
    ).report.knot_spacing == pytest.approx(0.1, rel=1e-3)


def test_knots_too_dense_for_the_cutoff_are_refused(build):
    with pytest.raises(ConfigurationError) as caught:
        build(type="poses", knot_spacing=0.001, cutoff=10.0)
    assert caught.value.problems == (
        "trajectory.file = '': must name a file of poses",
        "trajectory.knot_spacing = 0.001: must be 0 or at least 0.02 / trajectory.cutoff, 0.002 s",
    )


def test_a_file_must_be_named(build):
    with pytest.raises(ConfigurationError, match=r"trajectory\.file = '': must name a file"):
        build(type="poses")


def test_the_reader_gets_the_topic_only_where_there_is_one():
    from imu_sim_ros.simulation.parameters import load_simulation

    calls = []

    def reader(*arguments):
        calls.append(arguments)
        t = np.arange(10) * 100_000_000
        return States(t, np.zeros((10, 3)), np.tile(rotation.IDENTITY, (10, 1)))

    base = {"trajectory.type": "poses", "trajectory.file": "flight.mcap"}
    for extra in ({}, {"trajectory.topic": "odom"}):
        build_trajectory(load_simulation(base, extra).trajectory, reader)
    assert calls == [(Path("flight.mcap"),), (Path("flight.mcap"), "odom")]


def test_a_step_of_exactly_max_gap_is_no_gap(follow):
    """0.3 s in floats is more than 0.3: stamps are compared in whole nanoseconds."""
    t = np.arange(0.0, 12.0, 0.3)
    follow(t, *smooth_motion(t), max_gap=0.3)
    with pytest.raises(InputError, match="longer than trajectory.max_gap"):
        follow(t, *smooth_motion(t), max_gap=0.299)
