# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.records import States
from imu_sim_ros.navigation.association import (
    align,
    common_rows,
    interpolate_vectors,
    poses_at,
)
from imu_sim_ros.navigation.comparison import compare
from imu_sim_ros.navigation.evaluation import (
    PosePairs,
    absolute_errors,
    distances,
    pairs,
    relative_errors,
    state_at,
    statistics,
    tilt_and_heading_errors,
)
from imu_sim_ros.navigation.state import states_of

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def truth(record):
    motion = record("lecture", 20.0, 15.0)
    return States(motion.t_ns, motion.truth.position, motion.truth.q_wb)


@pytest.fixture(scope="module")
def estimate(truth):
    """Return the truth, turned, moved, scaled and with noise."""
    rng = np.random.default_rng(6)
    n = len(truth.t_ns)
    turn = rotation.from_euler([0.05, -0.03, 1.1])
    position = 1.1 * rotation.rotate(turn, truth.position) + [3.0, -2.0, 1.0]
    noise = rotation.exp(0.01 * rng.normal(size=(n, 3)))
    q_wb = rotation.multiply(rotation.multiply(turn, truth.q_wb), noise)
    return States(truth.t_ns, position + 0.05 * rng.normal(size=(n, 3)), q_wb)


@pytest.mark.parametrize("kind", ["yaw", "se3", "sim3"])
def test_alignment_finds_what_was_done(truth, kind):
    angles = [0.0, 0.0, 2.5] if kind == "yaw" else [0.7, -0.5, 2.5]
    turn = rotation.from_euler(angles)
    scale = 0.4 if kind == "sim3" else 1.0
    moved = rotation.rotate(turn, truth.position) / scale - [5.0, 1.0, -2.0]
    alignment = align(moved, truth.position, kind)
    assert alignment.scale == pytest.approx(scale, rel=1e-12)
    np.testing.assert_allclose(alignment.r, rotation.to_matrix(turn).T, atol=1e-12)
    moved_poses = States(truth.t_ns, moved, rotation.multiply(turn, truth.q_wb))
    back = alignment.apply(moved_poses)
    np.testing.assert_allclose(back.position, truth.position, atol=1e-11)
    np.testing.assert_allclose(absolute_errors(back, truth)[1], 0.0, atol=1e-7)


def test_alignment_is_the_best_of_its_kind(truth, estimate):
    """Each freedom more lies closer, and no small turn, shift or scale lies closer still."""
    sums = []
    for kind in ("none", "yaw", "se3", "sim3"):
        alignment = align(estimate.position, truth.position, kind)
        aligned = alignment.apply(estimate).position
        sums.append(np.sum((aligned - truth.position) ** 2))
    assert sums == sorted(sums, reverse=True)
    turned = rotation.rotate(rotation.exp([0.0, 0.0, 1e-4]), aligned)
    for neighbour in (aligned + np.array([1e-4, 0, 0]), aligned * (1 + 1e-4), turned):
        assert np.sum((neighbour - truth.position) ** 2) > sums[-1]


def test_alignment_needs_more_than_a_line():
    line = np.outer(np.arange(5.0), [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="on a line or in one place"):
        align(line, line, "se3")
    assert align(line, line, "yaw").r == pytest.approx(np.eye(3))
    with pytest.raises(ConfigurationError, match="alignment 'posyaw': must be one of none, yaw"):
        align(line, line, "posyaw")


def test_mirrored_points_are_not_matched_by_a_reflection():
    rng = np.random.default_rng(7)
    points = rng.normal(size=(20, 3))
    alignment = align(points, points * [1.0, 1.0, -1.0], "se3")
    assert np.linalg.det(alignment.r) == pytest.approx(1.0)


def test_interpolation_is_exact_on_a_screw():
    """Constant velocity and constant rate are what is assumed between stamps."""
    t_ns = np.array([0, 100, 400, 1000]) * 1_000_000
    at_ns = np.array([0, 50, 399, 400, 750, 1000]) * 1_000_000

    def poses(t_ns):
        t = t_ns[:, None] * 1e-9
        return States(t_ns, t * [1.0, 2.0, 3.0], rotation.exp(t * [0.3, -0.8, 1.2]))

    interpolated, exact = poses_at(poses(t_ns), at_ns), poses(at_ns)
    np.testing.assert_allclose(interpolated.position, exact.position, atol=1e-14)
    np.testing.assert_allclose(interpolated.q_wb, exact.q_wb, atol=1e-14)
    np.testing.assert_allclose(
        interpolate_vectors(t_ns, poses(t_ns).position, at_ns), exact.position, atol=1e-14
    )


def test_stamps_outside_and_in_gaps_of_the_truth_are_left_out():
    truth_ns = np.array([10, 11, 12, 15, 16]) * SECOND
    estimate_ns = np.array([9, 10, 11.5, 12, 13.5, 15, 15.5, 16, 17]) * SECOND
    rows = common_rows(estimate_ns.astype(np.int64), truth_ns, max_gap=1.0)
    assert rows.tolist() == [1, 2, 3, 5, 6, 7]


def test_estimate_and_truth_of_different_times_are_refused():
    with pytest.raises(InputError, match=r"estimate lasts from 1.000 s to 2.000 s, the truth from"):
        common_rows(np.array([1, 2]) * SECOND, np.array([3, 4]) * SECOND)
    with pytest.raises(InputError, match="1 poses of the truth"):
        common_rows(np.array([1, 2]) * SECOND, np.array([3]) * SECOND)


@pytest.mark.parametrize(("delta", "unit", "expected"), [(0.5, "s", 10), (7, "frames", 7)])
def test_pairs_of_constant_length(truth, delta, unit, expected):
    starts, second, left_out = pairs(truth, delta, unit)
    assert left_out == 0
    assert set(second - starts) == {expected}
    assert len(starts) == len(truth.t_ns) - expected
    starts, second, _ = pairs(truth, delta, unit, overlapping=False)
    np.testing.assert_array_equal(starts[1:], second[:-1])


def test_pairs_over_distances(truth):
    starts, second, _ = pairs(truth, 5.0, "m")
    along = distances(truth.position)
    assert np.all(along[second] - along[starts] >= 5.0)
    assert np.all(along[second - 1] - along[starts] < 5.0)


def test_pairs_longer_than_the_trajectory(truth):
    with pytest.raises(InputError, match="delta = 16 s: the trajectory has only 15 s"):
        pairs(truth, 16.0, "s")
    with pytest.raises(ConfigurationError, match="unit 'h': must be one of s, m, frames"):
        pairs(truth, 1.0, "h")
    with pytest.raises(ConfigurationError, match="delta = 0.0: must be above 0 s"):
        pairs(truth, 0.0, "s")


def test_errors_have_the_sign_that_they_say(truth):
    """Estimate minus truth, about the world's axes."""
    moved = truth.position + np.array([1.0, 2.0, 3.0])
    turned = rotation.multiply(rotation.exp([0.0, 0.0, 0.1]), truth.q_wb)
    velocity = np.zeros((301, 3))
    with_velocity = States(truth.t_ns, truth.position, truth.q_wb, velocity)
    errors = compare(
        States(truth.t_ns, moved, turned, velocity + np.array([0.0, 0.5, 0.0])), with_velocity
    )
    np.testing.assert_allclose(errors.position, np.tile([1.0, 2.0, 3.0], (301, 1)))
    np.testing.assert_allclose(errors.attitude, np.tile([0.0, 0.0, 0.1], (301, 1)), atol=1e-12)
    np.testing.assert_allclose(errors.velocity, np.tile([0.0, 0.5, 0.0], (301, 1)))
    assert tilt_and_heading_errors(turned, truth.q_wb)[1] == pytest.approx(0.1)


def test_drift_of_known_errors(record):
    motion = record("lecture", 100.0, 5.0)
    shift = np.linspace(0.0, 3.0, 501)[:, None] * [1.0, 0.0, 0.0]
    truth = motion.truth
    states = states_of(
        motion.t_ns, motion.truth.position + shift, motion.truth.velocity, motion.truth.q_wb
    )
    errors = compare(states, truth)
    assert errors.final_position == pytest.approx(3.0)
    # The mean of a square from 0 to 3 over 501 points.
    assert errors.rms_position == pytest.approx(np.sqrt(3.0 * (1 + 0.5 / 500)), rel=1e-5)
    assert errors.final_velocity < 1e-15
    assert errors.rms_attitude < 1e-7
    assert errors.distance == pytest.approx(distances(motion.truth.position)[-1])
    start = state_at(truth, int(motion.t_ns[3]))
    np.testing.assert_array_equal(start.velocity, motion.truth.velocity[3])


# Oracle: evo, with the same stamps in both trajectories.


def as_evo(poses):
    trajectory = pytest.importorskip("evo.core.trajectory")
    return trajectory.PoseTrajectory3D(poses.position, poses.q_wb, poses.t_ns * 1e-9)


@pytest.mark.parametrize(("kind", "scale"), [("none", False), ("se3", False), ("sim3", True)])
def test_ate_equals_evo(truth, estimate, kind, scale):
    metrics = pytest.importorskip("evo.core.metrics")
    reference, neighbour = as_evo(truth), as_evo(estimate)
    if kind != "none":
        neighbour.align(reference, correct_scale=scale)
    aligned = align(estimate.position, truth.position, kind).apply(estimate)
    position, attitude = absolute_errors(aligned, truth)
    for relation, lengths in (
        (metrics.PoseRelation.translation_part, np.linalg.norm(position, axis=1)),
        (metrics.PoseRelation.rotation_angle_rad, np.linalg.norm(attitude, axis=1)),
    ):
        ape = metrics.APE(relation)
        ape.process_data((reference, neighbour))
        theirs = ape.get_all_statistics()
        ours = statistics(lengths)._asdict()
        for name, value in ours.items():
            assert value == pytest.approx(theirs[name], abs=1e-9), name


@pytest.mark.parametrize("overlapping", [True, False])
@pytest.mark.parametrize(("delta", "unit"), [(1, "frames"), (10, "frames")])
def test_rpe_over_frames_equals_evo(truth, estimate, delta, unit, overlapping):
    metrics = pytest.importorskip("evo.core.metrics")
    errors = relative_errors(estimate, truth, pairs(truth, delta, unit, overlapping))
    for relation, ours in (
        (metrics.PoseRelation.translation_part, errors.translation),
        (metrics.PoseRelation.rotation_angle_rad, errors.rotation),
    ):
        rpe = metrics.RPE(relation, delta, metrics.Unit.frames, all_pairs=overlapping)
        rpe.process_data((as_evo(truth), as_evo(estimate)))
        np.testing.assert_allclose(ours, rpe.error, atol=1e-9)


def test_rpe_over_the_pairs_of_evo_in_metres(truth, estimate):
    """evo chooses other pairs over distances, along the estimate too; over its pairs all agree."""
    metrics = pytest.importorskip("evo.core.metrics")
    rpe = metrics.RPE(metrics.PoseRelation.translation_part, 5.0, metrics.Unit.meters)
    rpe.process_data((as_evo(truth), as_evo(estimate)))
    second = np.array(rpe.delta_ids)
    starts = np.concatenate([[0], second[:-1]])
    errors = relative_errors(estimate, truth, PosePairs(starts, second, 0))
    np.testing.assert_allclose(errors.translation, rpe.error, atol=1e-9)


def test_pairs_that_are_much_longer_than_asked_are_left_out_and_counted(truth):
    """Poses each 2.5 s, drifting by 0.1 m/s: no pair of 1 s; 2 s and 2.5 s have their own error."""
    sparse = truth.rows(slice(None, None, 50))
    drift = 0.1 * (sparse.t_ns - sparse.t_ns[0])[:, None] * 1e-9 * [1.0, 0.0, 0.0]
    errors = compare(States(sparse.t_ns, sparse.position + drift, sparse.q_wb), truth)
    short = errors.relative(1.0, "s")
    assert (len(short.length), short.left_out) == (0, len(sparse) - 1)
    fitting = errors.relative(2.0, "s")
    assert (len(fitting.length), fitting.left_out) == (len(sparse) - 1, 0)
    np.testing.assert_allclose(fitting.translation, 0.25, rtol=1e-9)
