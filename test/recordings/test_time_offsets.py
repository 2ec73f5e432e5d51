# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time offsets between two IMUs, and between an IMU and poses, from their rotation."""

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import replace_fields
from imu_sim_ros.recordings.tracks import TrackedFrame, rotation_between_frames

MOUNT = rotation.exp(np.array([0.3, 1.2, -2.0]))


def flown(trajectory, seed, imu="bmi088"):
    return ims.simulate(imu=imu, trajectory=trajectory, duration=23, rate=200, seed=seed)


def tracked(truth, offset, seed, step=4):
    """Return poses of a tracker that is turned against the body, with noise and late stamps."""
    rng = np.random.default_rng(seed)
    rows = truth.rows(slice(None, None, step))
    q_wb = rotation.multiply(rows.q_wb, rotation.exp(2e-3 * rng.standard_normal((len(rows), 3))))
    q_wb = rotation.multiply(q_wb, MOUNT)
    t_ns = rows.t_ns - round(offset * 1e9)
    return ims.States(t_ns, rows.position, q_wb, source="tracker")


def test_the_offset_of_a_tracker_is_in_its_interval():
    """A 95 % interval misses one of twelve in 46 % of the cases, three or more in 2 %."""
    misses = 0
    for trajectory in ("tour", "excitation", "yard"):
        for seed in range(4):
            flight, offset = flown(trajectory, seed), 0.04 * (seed - 1.7)
            inspection = ims.inspect([flight.readings, tracked(flight.truth, offset, seed)])
            (interval,) = inspection.offsets
            assert (interval.source, interval.reference) == ("tracker", flight.readings.source)
            assert interval.high_s - interval.low_s < 0.04
            misses += not interval.low_s <= offset <= interval.high_s
    assert misses <= 2


def test_the_offset_of_two_imus_is_told_to_a_fraction_of_a_sample():
    flight, readings = flown("excitation", 1), flown("excitation", 2, "mpu6000").readings
    gyro = rotation.rotate_inverse(MOUNT, readings.gyro)
    late = replace_fields(readings, t_ns=readings.t_ns + 7_300_000, gyro=gyro, source="second")
    (interval,) = ims.inspect([flight.readings, late]).offsets
    assert interval.low_s <= -0.0073 <= interval.high_s
    assert interval.high_s - interval.low_s < 1e-3


@pytest.mark.parametrize("trajectory", ["static", "circle", "lecture"])
def test_a_motion_that_does_not_tell_an_offset_says_nothing(trajectory):
    """A rest, a uniform turn and a single frequency, where misalignment looks alike."""
    flight = flown(trajectory, 1)
    inspection = ims.inspect([flight.readings, tracked(flight.truth, 0.1, 1)])
    assert inspection.offsets == ()
    (unknown,) = inspection.unknown_offsets
    assert unknown.source == "tracker"
    assert "turn" in unknown.reason or "rotation" in unknown.reason


def test_noise_that_hides_the_motion_is_the_reason():
    """Rates of 0.3 rad/s below a noise of 0.1: the best offset is a chance resemblance."""
    flight = flown("figure_eight", 1, "lecture")
    (unknown,) = ims.inspect([flight.readings, flight.truth]).unknown_offsets
    assert "noise" in unknown.reason


def test_two_bodies_and_two_times_have_no_offset():
    flight, tour = flown("excitation", 1), flown("tour", 1)
    assert ims.inspect([flight.readings, tracked(tour.truth, 0.0, 1)]).offsets == ()
    apart = tracked(flight.truth, 1000.0, 1)
    assert ims.inspect([flight.readings, apart]).offsets == ()
    (unknown,) = ims.inspect([flight.readings, apart]).unknown_offsets
    assert "too little time in common" in unknown.reason


def test_clean_flights_have_no_offset():
    """White noise draws no offset to the middle between two stamps: 0 is in its interval.

    A 95 % interval misses three or more of twelve in 2 % of the cases.
    """
    misses = 0
    for trajectory in ("figure_eight", "excitation"):
        for seed in range(6):
            flight = flown(trajectory, seed)
            (interval,) = ims.inspect([flight.readings, flight.truth]).offsets
            assert interval.high_s - interval.low_s < 5e-3
            misses += not interval.low_s <= 0.0 <= interval.high_s
    assert misses <= 2


def test_the_offset_of_two_trajectories_is_in_its_interval():
    """Two trackers of one body, without an IMU; two of four 95 % intervals miss in 1.4 %."""
    misses = 0
    for seed in range(4):
        truth, offset = flown("excitation", seed).truth, 0.03 * (seed - 1.3)
        pair = tracked(truth, 0.0, seed, 2), tracked(truth, offset, seed + 9, 5)
        reference, tracker = (
            replace_fields(poses, source=name) for poses, name in zip(pair, "ab", strict=True)
        )
        (interval,) = ims.inspect([reference, tracker]).offsets
        assert (interval.source, interval.reference) == ("b", "a")
        misses += not interval.low_s <= offset <= interval.high_s
    assert misses <= 1


def test_tracked_features_tell_the_offset_of_their_camera(tmp_path):
    """Kalibr's sign: the IMU's time is that of the camera plus ``camera.time_offset``."""
    offset = 0.021
    ims.generate(
        tmp_path / "tracks.mcap",
        trajectory="excitation",
        imu="bmi088",
        rate=200,
        duration=12,
        seed=1,
        cameras="euroc_cam0",
        features={"layout": "fusion"},
        camera={"time_offset": offset, "pixel_noise": 0.1},
        topics=["imu/data_raw", "feature_tracker/feature"],
    )
    (interval,) = ims.inspect(tmp_path / "tracks.mcap").offsets
    assert interval.source.endswith("/feature_tracker/feature")
    assert interval.low_s <= offset <= interval.high_s
    assert interval.high_s - interval.low_s < 0.012


def test_a_translation_of_a_camera_is_no_rotation():
    """Without noise the epipolar constraint has no residual at the rotation, whatever moves."""
    rng = np.random.default_rng(1)
    points = rng.uniform([-3.0, -2.0, 3.0], [3.0, 2.0, 8.0], (80, 3))
    for turn, move in (
        ([0.02, -0.03, 0.01], [0.3, 0.0, 0.0]),
        ([0.0, 0.0, 0.0], [0.0, 0.1, 0.2]),
        ([0.1, 0.05, -0.2], [0.0, 0.0, 0.0]),
    ):
        later = rotation.rotate_inverse(rotation.exp(np.array(turn)), points - move)
        frames = [
            TrackedFrame(0, np.arange(80), seen / np.linalg.norm(seen, axis=1)[:, None])
            for seen in (points, later)
        ]
        np.testing.assert_allclose(rotation_between_frames(*frames), turn, atol=1e-6)
    few = frames[0]._replace(ids=frames[0].ids + 70)
    assert rotation_between_frames(few, frames[1]) is None
