# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks: exact without noise, white with it, and the same whatever the block."""

import numpy as np
import pytest

from imu_sim_ros.core import rotation

LAWNMOWER = {"cam0__camera__preset": "euroc_cam0", "cam0__camera__body_axes": "flu"}


def together(rig, block=64, name="cam0"):
    parts = list(rig.tracks(name, block))
    frame = np.concatenate([part.frames.number[part.frame] for part in parts])
    columns = {
        key: np.concatenate([getattr(part, key) for part in parts])
        for key in ("id", "landmark", "uv", "uv_true", "depth", "wrong")
    }
    return frame, columns


def reprojected(rig, frame, landmark):
    """Project features one by one with homogeneous matrices and OpenCV's distortion."""
    import cv2

    p = rig.parameters.camera("cam0")
    t_bc = np.eye(4)
    t_bc[:3, :3], t_bc[:3, 3] = p.pose()
    fx, fy, cx, cy = p.intrinsics
    k = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    result = []
    for number, row in zip(frame, landmark, strict=True):
        motion = rig.trajectory.sample(np.array([number / p.rate]))
        t_wb = np.eye(4)
        t_wb[:3, :3], t_wb[:3, 3] = rotation.to_matrix(motion.q_wb[0]), motion.position[0]
        local = np.linalg.inv(t_wb @ t_bc) @ np.append(rig.scene.landmarks[row], 1.0)
        uv, _ = cv2.projectPoints(local[:3], np.zeros(3), np.zeros(3), k, np.array(p.distortion))
        result.append([*uv[0, 0], local[2]])
    return np.array(result)


def test_tracks_without_noise_are_the_reprojection(make_rig):
    rig = make_rig(**LAWNMOWER, camera__pixel_noise=0.0)
    frame, t = together(rig)
    assert np.array_equal(t["uv"], t["uv_true"])
    rows = np.linspace(0, len(frame) - 1, 300).astype(int)
    expected = reprojected(rig, frame[rows], t["landmark"][rows])
    assert np.abs(t["uv"][rows] - expected[:, :2]).max() < 1e-9
    assert np.abs(t["depth"][rows] - expected[:, 2]).max() < 1e-12


def test_noise_has_the_stated_deviation_and_is_white(make_rig):
    rig = make_rig(**LAWNMOWER, camera__pixel_noise=0.7, duration=20.0, scene__landmarks=3000)
    frame, t = together(rig)
    error = (t["uv"] - t["uv_true"]) / 0.7
    n = len(error)
    # The relative deviation of a standard deviation is 1 / sqrt(2 n): 5 of it are under 2 %.
    assert n > 40_000
    assert np.abs(error.std(axis=0) - 1.0).max() < 5.0 / np.sqrt(2.0 * n)
    assert np.abs(error.mean(axis=0)).max() < 5.0 / np.sqrt(n)
    assert abs((error[:, 0] * error[:, 1]).mean()) < 5.0 / np.sqrt(n)
    # White over time: the same landmark in consecutive frames.
    order = np.lexsort((frame, t["landmark"]))
    e, f, landmark = error[order], frame[order], t["landmark"][order]
    next_one = (np.diff(f) == 1) & (np.diff(landmark) == 0)
    product = (e[1:] * e[:-1])[next_one]
    assert len(product) > n // 2
    assert np.abs(product.mean(axis=0)).max() < 5.0 / np.sqrt(len(product))


EVERYTHING = {
    "camera__outlier_probability": 0.05,
    "camera__mismatch_probability": 0.05,
    "camera__track_lifetime": 7,
    "camera__dropout_probability": 0.1,
    "camera__jitter": 1e-3,
    "camera__row_time": 3e-5,
}


def test_tracks_do_not_depend_on_the_block(make_rig):
    rig = make_rig(**LAWNMOWER, **EVERYTHING, duration=5.0)
    frame, once = together(rig, 1000)
    for block in (1, 7):
        blockwise_frame, again = together(make_rig(**LAWNMOWER, **EVERYTHING, duration=5.0), block)
        assert np.array_equal(frame, blockwise_frame)
        for key, values in once.items():
            assert np.array_equal(values, again[key]), key
    stamps = [
        np.concatenate([part.frames.t_ns for part in rig.tracks("cam0", block)])
        for block in (3, 100)
    ]
    assert np.array_equal(*stamps)


def test_each_source_has_its_own_stream(make_rig):
    _, plain = together(make_rig(**LAWNMOWER))
    _, wrong = together(make_rig(**LAWNMOWER, camera__outlier_probability=0.1))
    correct = ~wrong["wrong"]
    # More than 900 observations: 5 of the deviations sqrt(0.1 * 0.9 / 900) = 0.01.
    assert len(correct) > 900
    assert 0.85 < correct.mean() < 0.95
    assert np.array_equal(plain["uv"][correct], wrong["uv"][correct])
    _, other_seed = together(make_rig(**LAWNMOWER, seed=4))
    assert not np.array_equal(plain["uv"][:100], other_seed["uv"][:100])


def test_outliers_mismatches_and_lost_frames_come_as_often_as_asked(make_rig):
    frame, t = together(make_rig(**LAWNMOWER, duration=30.0, camera__outlier_probability=0.1))
    n = len(frame)
    assert abs(t["wrong"].mean() - 0.1) < 5.0 * np.sqrt(0.09 / n)
    rig = make_rig(**LAWNMOWER, camera__mismatch_probability=0.2, camera__pixel_noise=0.0)
    frame, t = together(rig)
    for number in np.unique(frame[t["wrong"]])[:50]:
        mixed = (frame == number) & t["wrong"]
        pixels = {tuple(uv) for uv in t["uv_true"][mixed]}
        assert pixels == {tuple(uv) for uv in t["uv"][mixed]}
        assert (t["uv"][mixed] != t["uv_true"][mixed]).any(axis=1).all()
    rig = make_rig(**LAWNMOWER, duration=50.0, camera__dropout_probability=0.2)
    delivered = np.concatenate([part.frames.delivered for part in rig.tracks("cam0")])
    assert abs(delivered.mean() - 0.8) < 5.0 * np.sqrt(0.16 / 1000)
    frame, _ = together(rig)
    assert not set(frame) & set(np.flatnonzero(~delivered))


def test_a_grid_and_a_cap_spread_the_features(make_rig):
    everything = make_rig(**LAWNMOWER, camera__max_features=0, scene__landmarks=3000)
    capped = make_rig(
        **LAWNMOWER,
        scene__landmarks=3000,
        camera__max_features=40,
        camera__grid_rows=2,
        camera__grid_columns=4,
    )
    all_frame, all_tracks = together(everything)
    frame, t = together(capped)
    assert (np.bincount(frame)[np.bincount(all_frame) >= 40] == 40).all()
    for number in range(0, 200, 20):
        cells = {}
        for key, f, rows in (("all", all_frame, all_tracks), ("some", frame, t)):
            uv = rows["uv_true"][f == number]
            place = ((uv + 0.5) / (752 / 4, 480 / 2)).astype(int)
            cells[key] = np.bincount(place[:, 1] * 4 + place[:, 0], minlength=8)
        # No cell has two more than another one that still had some to give.
        starved = cells["some"] < cells["all"]
        if starved.any():
            assert cells["some"].max() - cells["some"][starved].min() <= 1
    # A landmark stays chosen while it can: tracks are long.
    assert np.bincount(t["landmark"]).max() > 30


def test_a_lifetime_gives_landmarks_new_ids(make_rig):
    rig = make_rig(**LAWNMOWER, camera__track_lifetime=10)
    frame, t = together(rig)
    count = len(rig.scene.landmarks)
    assert np.array_equal(t["id"] % count, t["landmark"])
    for identity in np.unique(t["id"])[:200]:
        assert np.ptp(frame[t["id"] == identity]) < 10
    starts = {int(frame[t["id"] == i].min()) % 10 for i in np.unique(t["id"])[-300:]}
    assert len(starts) == 10  # not all at the same time


def test_hidden_landmarks_are_not_seen(make_rig):
    """Brute force: points along the line of sight, none of them inside a box."""
    rig = make_rig(**LAWNMOWER, scene__boxes=8, camera__max_features=0, scene__landmarks=1500)
    boxes = [
        np.stack([s.min(axis=0), s.max(axis=0)])
        for s in (
            rig.scene.surfaces.origin[k : k + 6, None]
            + rig.scene.surfaces.across[k : k + 6, None] * [[0], [1], [0], [1]]
            + rig.scene.surfaces.up[k : k + 6, None] * [[0], [0], [1], [1]]
            for k in range(6, 54, 6)
        )
        for s in [s.reshape(-1, 3)]
    ]
    p = rig.parameters.camera("cam0")
    for number in (0, 60, 120):
        t = rig.tracker("cam0").tracks(number, 1)
        pose = rig.views["cam0"].poses(rig.trajectory, np.array([number / p.rate]))
        local = rotation.rotate_inverse(pose.q_wc[0], rig.scene.landmarks - pose.position[0])
        model = rig.views["cam0"].model
        uv, valid = model.project(local)
        expected = valid & model.inside(uv) & (local[:, 2] > p.min_depth)
        steps = np.linspace(0.001, 0.999, 2000)[:, None, None]
        between = pose.position[0] + steps * (rig.scene.landmarks[expected] - pose.position[0])
        blocked = np.zeros(between.shape[1], dtype=bool)
        for low, high in boxes:
            margin = 1e-6
            in_box = ((between > low + margin) & (between < high - margin)).all(axis=2)
            blocked |= in_box.any(axis=0)
        expected[expected] = ~blocked
        tracked = np.zeros(len(expected), dtype=bool)
        tracked[t.landmark] = True
        # A line of sight that grazes an edge between two of the 2000 places may differ.
        assert (tracked != expected).sum() <= 2
        assert blocked.sum() > 20


def test_a_rolling_shutter_sees_each_row_at_its_time(make_rig):
    rig = make_rig(**LAWNMOWER, camera__row_time=5e-5, camera__pixel_noise=0.0)
    view = rig.views["cam0"]
    t = rig.tracker("cam0").tracks(40, 3)
    times = view.seconds(t.frames.true_t_ns)[t.frame] + 5e-5 * (t.uv[:, 1] - 239.5)
    poses = view.poses(rig.trajectory, times)
    local = rotation.rotate_inverse(poses.q_wc, rig.scene.landmarks[t.landmark] - poses.position)
    assert np.abs(view.model.project(local).uv - t.uv).max() < 1e-9
    still = make_rig(**LAWNMOWER, camera__pixel_noise=0.0).tracker("cam0").tracks(40, 3)
    both = np.isin(t.landmark + 10_000 * t.frame, still.landmark + 10_000 * still.frame)
    common = np.isin(still.landmark + 10_000 * still.frame, t.landmark + 10_000 * t.frame)
    assert np.abs(t.uv[both] - still.uv[common]).max() > 1.0


def test_stamps_say_what_stacks_estimate(make_rig):
    """kalibr: t_imu = t_cam + shift; so the stamp is early by a positive offset."""
    rig = make_rig(camera__time_offset=0.005, camera__rate=20.0, camera__phase=0.01)
    frames = rig.views["cam0"].frames(0, 3)
    assert (frames.true_t_ns - frames.t_ns == 5_000_000).all()
    assert frames.true_t_ns.tolist() == [1_010_000_000, 1_060_000_000, 1_110_000_000]
    assert rig.views["cam0"].total == 200


def test_lines_are_seen_where_both_ends_are(make_rig):
    rig = make_rig("lecture", duration=5.0, scene__type="house", camera__pixel_noise=0.5)
    lines = rig.tracker("cam0").lines(0, 150)
    view = rig.views["cam0"]
    times = view.seconds(view.frames(0, 150).true_t_ns)
    poses = view.poses(rig.trajectory, times[lines.frame])
    for end in (0, 1):
        points = rig.scene.lines[lines.id, end]
        uv = view.model.project(rotation.rotate_inverse(poses.q_wc, points - poses.position)).uv
        assert np.abs(uv - lines.ends_true[:, end]).max() < 1e-9
    error = (lines.ends - lines.ends_true).ravel()
    assert abs(error.std() / 0.5 - 1.0) < 5.0 / np.sqrt(2.0 * len(error))
    assert len(lines.frame) > 1000


@pytest.mark.parametrize("block", [1, 50])
def test_the_span_without_landmarks_is_told(make_rig, block):
    from imu_sim_ros.datasets.tracks import Blindness

    points = "0, 0, 1000"  # straight up: never seen from a level body that looks along x
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "one.csv"
        file.write_text(f"x,y,z\n{points}\n", encoding="utf-8")
        rig = make_rig(**LAWNMOWER, scene__type="file", scene__file=str(file))
    blindness = Blindness("cam0")
    for tracks in rig.tracks("cam0", block):
        blindness.record(tracks, 1_000_000_000)
    assert blindness.warnings() == ["cam0: no landmark in view from 0.00 to 9.95 s"]
