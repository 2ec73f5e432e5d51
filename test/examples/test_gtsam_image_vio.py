# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Odometry on images: what the corner tracker follows, and that gtsam's errors are as it says."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scripts import load_script

from imu_sim_ros.commands import generate
from imu_sim_ros.inputs.poses import read_poses
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.parameters import CameraParameters

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module", name="example")
def load_example():
    pytest.importorskip("gtsam")
    pytest.importorskip("cv2")
    return load_script(EXAMPLES / "gtsam_image_vio.py")


def speckled(seed, size=(240, 320)):
    """Return smooth speckles, several pixels wide."""
    import cv2

    noise = np.random.default_rng(seed).integers(0, 256, size).astype(np.uint8)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2.5).astype(float)
    stretched = 128.0 + 45.0 * (smooth - smooth.mean()) / smooth.std()
    return np.clip(stretched, 0, 255).astype(np.uint8)


def test_corners_follow_the_image_and_those_of_another_are_dropped(example):
    """The left half moves by (-4, 3) pixels, the right half becomes something else."""
    camera = CameraParameters(width=320, height=240, intrinsics=(200.0, 200.0, 160.0, 120.0))
    tracker = example.CornerTracker(CameraModel(camera), 200.0)
    image = speckled(1)
    successor = np.roll(image, (3, -4), axis=(0, 1))
    successor[:, 160:] = speckled(2)[:, 160:]
    tracker.look(image)
    start = dict(zip(tracker.ids.tolist(), tracker.uv.tolist(), strict=True))
    assert len(start) > 60
    tracker.look(successor)
    tracks = [(start[k], uv) for k, uv in zip(tracker.ids.tolist(), tracker.uv, strict=True)
           if k in start]  # fmt: skip
    moved = np.array([end - np.array(begin) for begin, end in tracks])
    assert np.abs(np.median(moved, axis=0) - [-4.0, 3.0]).max() < 0.05
    assert (np.array([begin for begin, _ in tracks])[:, 0] < 165.0).mean() > 0.9
    assert tracker.counts == [len(tracks)]
    corner_count = len(tracker.ids)
    tracker.drop(set(tracker.ids[:5].tolist()))
    assert len(tracker.ids) == corner_count - 5


def test_a_tour_in_dim_light_is_estimated_within_its_covariance(
    example, tmp_path, capsys, monkeypatch
):
    """A corridor with bare walls, image noise multiplied by automatic exposure, small images.

    Neighbouring key frames have nearly the same error, so a run has few independent values of three
    degrees of freedom. The mean of at least three degrees is below 3.8 in 99 of 100 runs. The pose
    at the start is exact, though trusted to 1 mm and 1 mrad: no lower limit near 1. Corners
    followed without checks, with a noise of 1 px, give 14 and 0.17 m over 8 s of large images.
    """
    arguments = (
        f"-o {tmp_path}/tour/mav0 --format euroc --imu adis16448 --trajectory tour --duration 6s "
        "--set trajectory.place=corridor --set trajectory.rest_before=2 --scene corridor "
        "--camera euroc_cam0 --set camera.body_axes=flu --set camera.rate=10 "
        "--set camera.width=376 --set camera.height=240 "
        "--set camera.intrinsics=[229.3,228.6,183.6,124.2] "
        "--set scene.texture=blank --set scene.light=dim --set camera.read_noise=2 "
        "--set camera.shot_noise=4 --set camera.auto_exposure=90 --with-configs --quiet"
    )
    assert generate.main(arguments.split()) == 0
    folder, path = tmp_path / "tour", tmp_path / "estimate.tum"
    configuration = folder / "mav0_configs/simulation.yaml"
    arguments = (
        f"{folder} --configuration {configuration} -o {path} --metrics {tmp_path}/metrics.json"
    )
    monkeypatch.setattr(sys, "argv", ["gtsam_image_vio.py", *arguments.split()])
    example.main()
    summary = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    assert json.loads(capsys.readouterr().out) == summary
    assert summary["keyframes"] == len(read_poses(path, covariance=True).t_ns) == 20
    assert summary["position_rmse_m"] < 0.05
    assert summary["nees_position_per_dof"] < 3.8
    assert summary["nees_orientation_per_dof"] < 3.8
    assert summary["corners_least"] > 15
    assert 0.2 <= summary["corner_noise_px"] < 1.5
    assert summary["lifetime_mean_frames"] > 4.0
    assert summary["start_s"] == 0.0


def test_a_flight_without_a_rest_starts_by_itself(example, tmp_path):
    """Velocity, gravity, scale and biases from images and readings; the turn-on biases are large.

    Of the first pose only position and heading are told. Until the body turns, the accelerometer's
    bias, 0.2 m/s^2 on each axis, is a tilt of 20 mrad; three times that of two axes is allowed. The
    NEES is that of a run with few independent values, which are less certain than above.
    """
    arguments = (
        f"-o {tmp_path}/tour/mav0 --format euroc --imu adis16448 --trajectory tour --duration 6s "
        "--set trajectory.place=corridor --scene corridor --camera euroc_cam0 "
        "--set camera.body_axes=flu --set camera.rate=10 --set scene.texture=rich --seed 2 "
        "--with-configs --quiet"
    )
    assert generate.main(arguments.split()) == 0
    configuration = tmp_path / "tour/mav0_configs/simulation.yaml"
    truth = files.load(tmp_path / "tour/mav0_truth.yaml")
    assert np.linalg.norm(truth["imu.gyroscope_bias"]) > 0.003
    result, summary = example.run(tmp_path / "tour", configuration)
    assert 2.0 <= summary["start_s"] <= 4.0
    assert summary["keyframes"] >= 12
    assert summary["position_rmse_m"] < 0.1
    assert summary["orientation_rmse_rad"] < 0.085
    assert np.linalg.norm(result.position_error[-1]) < 0.15
    assert summary["nees_position_per_dof"] < 6.0
    assert summary["nees_orientation_per_dof"] < 6.0


def test_a_camera_that_never_moves_starts_nothing(example, tmp_path):
    arguments = (
        f"-o {tmp_path}/still/mav0 --format euroc --trajectory static --duration 2s "
        "--scene room --camera euroc_cam0 --with-configs --quiet --set camera.rate=4"
    )
    assert generate.main(arguments.split()) == 0
    with pytest.raises(SystemExit, match="^no start: in 8 images the camera never moved"):
        example.run(tmp_path / "still", tmp_path / "still/mav0_configs/simulation.yaml")
