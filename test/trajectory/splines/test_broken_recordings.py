# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings that no body flew: a real flight with what goes wrong in recordings done to it."""

import functools
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from recordings import EUROC, TUM, missing

import imu_sim_ros as ims
from imu_sim_ros.commands.generate import main
from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import States
from imu_sim_ros.inputs.poses import read_poses, write_tum
from imu_sim_ros.recordings.repair import repair_poses
from imu_sim_ros.trajectory.recorded import RecordedMotion

RATE = 100.0


def bad_pose(t, p, q, rng):
    """Move one pose by a third of a metre and 13 degrees, as in EuRoC's MH_04."""
    p[len(t) // 4] += [0.3, -0.1, 0.05]
    q[len(t) // 4] = rotation.multiply(q[len(t) // 4], rotation.exp(np.array([0.2, 0.0, 0.1])))
    return t, p, q


def spike(t, p, q, rng):
    p[len(t) // 3] += [0.0, 0.0, 100.0]
    return t, p, q


def jump(t, p, q, rng):
    p[len(t) // 2 :] += [3.0, 4.0, 0.0]
    return t, p, q


def stretch(t, p, q, rng):
    """Move six poses in a row by half a metre."""
    p[len(t) // 5 : len(t) // 5 + 6] += [0.5, 0.0, 0.0]
    return t, p, q


def updates(t, p, q, rng):
    """Add jumps of 2 to 17 mm and some hundredths of a degree, as all over EuRoC's MH_04."""
    for row in range(500, len(t) - 500, 600):
        step = rng.normal(size=3)
        p[row:] += rng.uniform(2e-3, 17e-3) * step / np.linalg.norm(step)
        q[row:] = rotation.multiply(q[row:], rotation.exp(3e-4 * rng.normal(size=3)))
    return t, p, q


def arrival(t, p, q, rng):
    """Stamp poses at their arrival, in order, 1 ms late on average."""
    late = np.maximum.accumulate(t + rng.exponential(1e-3, len(t)))
    return late + np.arange(len(t)) * 2e-9, p, q


def late_with_losses(t, p, q, rng):
    """Lose one pose in two hundred, and stamp the others late."""
    late, p, q = arrival(t, p, q, rng)
    keep = rng.random(len(t)) > 0.005
    keep[0] = True
    return late[keep], p[keep], q[keep]


def everything(t, p, q, rng):
    for harm in (bad_pose, spike, jump, stretch, arrival):
        t, p, q = harm(t, p, q, rng)
    return t, p, q


HARMS = (bad_pose, spike, jump, stretch, updates, arrival, late_with_losses, everything)


@functools.cache
def read_once(path):
    """Return a file's poses, which nobody changes."""
    return read_poses(path)


@functools.cache
def velocities_of_file():
    return np.loadtxt(EUROC, delimiter=",", skiprows=1, usecols=(8, 9, 10))


class Recording(NamedTuple):
    """A real motion, and how closely the velocity of each pose is to be found again."""

    path: Path
    velocity: float  # m/s
    acceleration: float  # m/s^2, the most that remains
    rows: slice  # of the file

    def poses(self):
        poses = read_once(self.path)
        t_ns, position, q_wb = (
            column[self.rows] for column in (poses.t_ns, poses.position, poses.q_wb)
        )
        return (t_ns - t_ns[0]) * 1e-9, position.copy(), rotation.unwrap_signs(q_wb)


# A drone of up to 8.3 m/s^2: unharmed, the spline's velocities are within 0.043 m/s of the file's
# at every pose; 40 s with its fastest and its hardest turn. A hand of up to 0.59 m/s and 2.97
# m/s^2, whose file has no velocities: those of the spline through the unharmed poses take their
# place.
FLIGHT = Recording(EUROC, 0.1, 12.0, slice(4000, 12000))
HAND = Recording(TUM, 0.04, 3.5, slice(None))
real = pytest.mark.parametrize(
    "recording",
    [
        pytest.param(
            FLIGHT,
            id="euroc",
            marks=pytest.mark.skipif(not EUROC.is_file(), reason=missing(EUROC)),
        ),
        pytest.param(HAND, id="tum"),
    ],
)


def write_poses(path, t, p, q):
    t_ns = 1_400_000_000_000_000_000 + np.round(t * 1e9).astype(np.int64)
    write_tum(path, States(t_ns, p, q))
    return path


@pytest.fixture
def follow(build, tmp_path):
    def write_and_build(t, p, q, **parameters):
        path = write_poses(tmp_path / "poses.txt", t, p, q)
        trajectory = build(type="poses", file=str(path), **parameters)
        assert isinstance(trajectory, RecordedMotion)
        return trajectory

    return write_and_build


@real
@pytest.mark.parametrize("harm", HARMS, ids=lambda harm: harm.__name__)
def test_robust_velocities_are_those_of_the_unharmed_motion(build, follow, harm, recording):
    t, p, q = recording.poses()
    if recording is FLIGHT:
        velocity = velocities_of_file()[recording.rows]
    else:
        velocity = build(type="poses", file=str(recording.path)).sample(t).velocity
    trajectory = follow(*harm(t.copy(), p, q, np.random.default_rng(3)), robust=True)
    # Arrival is late by a constant as well, which nothing in the file tells.
    late = 1e-3 if harm in (arrival, late_with_losses, everything) else 0.0
    times = t[(t + late > 0.0) & (t + late < trajectory.duration)]
    estimate = trajectory.sample(times + late).velocity
    error = np.linalg.norm(estimate - velocity[np.searchsorted(t, times)], axis=1)
    assert error.max() < recording.velocity, (error.max(), times[error.argmax()])
    assert trajectory.report.peak_acceleration < recording.acceleration
    assert trajectory.repairs
    assert not trajectory.warnings


@real
@pytest.mark.parametrize("harm", HARMS, ids=lambda harm: harm.__name__)
def test_without_the_option_everything_is_warned_of(follow, harm, recording):
    t, p, q = recording.poses()
    trajectory = follow(*harm(t, p, q, np.random.default_rng(3)))
    assert not trajectory.repairs
    assert "robust=True (trajectory.robust)" in "".join(trajectory.warnings)


@real
def test_a_clean_motion_is_left_alone(build, recording):
    plain, robust = (
        build(type="poses", file=str(recording.path), robust=robust) for robust in (False, True)
    )
    assert not plain.warnings
    assert not robust.repairs
    t = np.linspace(0.0, plain.duration, 500)
    for expected, actual in zip(plain.sample(t), robust.sample(t), strict=True):
        np.testing.assert_array_equal(expected, actual)


def motion(n=1500):
    t = np.arange(n) / RATE
    p = np.column_stack([np.sin(t), np.cos(1.3 * t), 0.5 * np.sin(2 * t)])
    euler = np.column_stack([0.4 * np.sin(1.1 * t), 0.3 * np.cos(0.9 * t), 0.8 * t])
    return t, p, rotation.from_euler(euler)


def test_line_and_time_are_named(follow):
    t, p, q = motion()
    p[700] += [0.0, 0.5, 0.0]
    line = follow(t, p, q).warnings[0]
    # One line of header, and lines count from 1.
    assert "1 pose lies off the motion of the neighbours: line 702 (7.000 s) by 0.5 m" in line


def test_a_jump_that_turns_is_joined(follow):
    """A corrected map turns all that follows: the way from there on is the same, turned back."""
    t, p, q = motion()
    turn = rotation.exp(np.array([0.0, 0.0, 0.4]))
    moved, turned = p.copy(), q.copy()
    moved[900:] = rotation.rotate(turn, p[900:]) + np.array([1.0, 2.0, 0.0])
    turned[900:] = rotation.multiply(turn, q[900:])
    line = follow(t, moved, turned).warnings[0]
    assert "the motion jumps at line 902 (9.000 s) by" in line
    assert "and 22.9 deg" in line
    robust = follow(t, moved, turned, robust=True)
    clean = follow(t, p, q)
    times = np.linspace(0.5, 14.5, 300)
    np.testing.assert_allclose(
        np.linalg.norm(robust.sample(times).velocity, axis=1),
        np.linalg.norm(clean.sample(times).velocity, axis=1),
        atol=0.02,
    )
    np.testing.assert_allclose(
        robust.sample(times).angular_velocity, clean.sample(times).angular_velocity, atol=0.02
    )


def test_the_largest_jumps_are_named(follow):
    """Seven, the smallest first."""
    t, p, q = motion()
    for k in range(7):
        p[200 * (k + 1) :] += [0.0, 0.0, 0.01 + 0.02 * k]
    (line,) = follow(t, p, q).warnings
    assert "the motion jumps at line 602 (6.000 s) by 0.05 m" in line
    assert "line 1402 (14.000 s) by 0.13 m" in line
    assert "and 2 smaller ones; robust=True" in line
    assert len(follow(t, p, q, robust=True).repairs) == 1


def test_noise_alone_is_no_outlier(follow):
    """Normal noise of a millimetre and a milliradian: ten deviations are not reached."""
    t, p, q = motion()
    rng = np.random.default_rng(8)
    p += 1e-3 * rng.normal(size=p.shape)
    q = rotation.multiply(q, rotation.exp(1e-3 * rng.normal(size=p.shape)))
    assert not follow(t, p, q).warnings


def test_the_last_digit_of_a_file_is_no_outlier(follow):
    """Millimetres at 200 Hz, nearly at rest: now and then all three coordinates change by one."""
    t = np.arange(4000) / 200.0
    p = np.round(np.repeat(3.7e-4 * t[:, None], 3, axis=1), 3)
    q = np.tile([1.0, 0.0, 0.0, 0.0], (4000, 1))
    assert len(np.unique(p)) == 8
    assert not follow(t, p, q).warnings


def test_generate_warns_even_when_quiet_and_mends_on_request(tmp_path, capsys):
    t, p, q = motion()
    p[700:] += [5.0, 0.0, 0.0]
    poses = write_poses(tmp_path / "poses.txt", t, p, q)
    arguments = ["--trajectory", str(poses), "--duration", "10s"]
    assert main([*arguments, "-o", str(tmp_path / "a.mcap"), "--quiet"]) == 0
    output = capsys.readouterr()
    assert output.out == ""
    assert "generate: warning: " in output.err
    assert "the motion jumps at line 702 (7.000 s) by 5 m" in output.err
    assert "--robust (trajectory.robust) joins the pieces" in output.err
    assert "more than a body carrying an IMU reaches" in output.err
    assert main([*arguments, "-o", str(tmp_path / "b.mcap"), "--robust"]) == 0
    output = capsys.readouterr()
    assert all(line.startswith("generate: note: ") for line in output.err.splitlines())
    assert "all later poses were moved to continue the motion" in output.err


def test_a_shaken_end_is_no_jump_behind_it() -> None:
    """The last 3 s of a drive on a rough road: single poses are suspicious, also the last one."""
    drive = ims.simulate(imu="perfect", trajectory="town", duration=60, rate=200)
    rows = slice(-600, None)
    mending = repair_poses(drive.truth.rows(rows))
    assert all(0 <= jump.row < 600 for jump in mending.disturbances.jumps)
    assert len(mending.poses) > 500
