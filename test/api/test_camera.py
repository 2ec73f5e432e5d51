# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks of a camera in Python equal those that generate writes for the same parameters."""

import csv

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.camera import build_simulation_rig, reprojection_errors
from imu_sim_ros.commands import generate
from imu_sim_ros.sensors.camera.rig_parameters import scene_layer

MOTION = ["--imu", "mpu6000", "--trajectory", "figure_eight", "--duration", "1s", "--seed", "4"]
CAMERA = {"preset": "euroc_cam0", "pixel_noise": 0.5, "body_axes": "flu"}


@pytest.fixture(scope="module")
def flight():
    return ims.simulate(imu="mpu6000", trajectory="figure_eight", duration=1, seed=4)


def test_tracks_are_those_of_generate(flight, tmp_path):
    chosen = ["--camera", "euroc_cam0", "--scene", "room", "--format", "tracks"]
    camera_settings = ["--set", "cam0.camera.pixel_noise=0.5", "--set", "cam0.camera.body_axes=flu"]
    assert (
        generate.main([*MOTION, *chosen, *camera_settings, "--quiet", "-o", str(tmp_path / "made")])
        == 0
    )
    with (tmp_path / "made" / "tracks.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    blocks = list(ims.camera.tracks(flight, CAMERA, "room", block=7))
    assert sum(len(block.id) for block in blocks) == len(rows) > 100
    for name, column in (
        ("id", np.concatenate([b.id for b in blocks])),
        ("t_ns", np.concatenate([b.frames.t_ns[b.frame] for b in blocks])),
        ("u", np.concatenate([b.uv[:, 0] for b in blocks])),
        ("v_true", np.concatenate([b.uv_true[:, 1] for b in blocks])),
        ("depth", np.concatenate([b.depth for b in blocks])),
    ):
        expected = np.array([float(row[name]) for row in rows])
        np.testing.assert_allclose(column, expected, rtol=1e-8, err_msg=name)


def given_poses():
    """Return poses at 100 Hz over ten seconds, with stamps from 1000 s on."""
    t = np.arange(0.0, 10.0, 0.01)
    z = np.zeros_like(t)
    position = np.stack([0.5 * np.sin(t), 0.3 * np.cos(t), 1.5 + z], axis=-1)
    q_wb = np.stack([np.cos(0.05 * np.sin(t)), z, z, np.sin(0.05 * np.sin(t))], axis=-1)
    return ims.PoseSequence((1e12 + 1e9 * t).astype(np.int64), position, q_wb)


def given_function(t):
    z = np.zeros_like(t)
    position = np.stack([0.5 * np.sin(t), 0.3 * np.cos(t), 1.5 + z], axis=-1)
    return position, np.stack([np.cos(0.05 * np.sin(t)), z, z, np.sin(0.05 * np.sin(t))], axis=-1)


@pytest.mark.parametrize(("trajectory", "start"), [(given_poses(), 1000.0), (given_function, 1.0)])
def test_a_camera_sees_the_motion_that_somebody_gave(trajectory, start):
    """Frames begin at the first stamp, and landmarks project onto the pixels by the true motion."""
    flight = ims.simulate(imu="perfect", trajectory=trajectory, duration=3, rate=200)
    assert flight.t0_ns == flight.t_ns[0] == pytest.approx(start * 1e9, abs=2e7)
    camera = {"preset": "euroc_cam0", "body_axes": "flu"}
    given_rig = {"cameras": ["cam0"], **{f"cam0.camera.{n}": v for n, v in camera.items()}}
    rig = build_simulation_rig({**given_rig, **scene_layer("room")}, flight)
    blocks = list(ims.camera.tracks(flight, camera, "room"))
    stamps = np.concatenate([b.frames.t_ns for b in blocks])
    np.testing.assert_array_equal(stamps, flight.t0_ns + 50_000_000 * np.arange(60))
    for block in blocks:
        motion = flight.trajectory.sample((block.frames.true_t_ns - flight.t0_ns) * 1e-9)
        off = reprojection_errors(
            rig.parameters.camera_parameters()["cam0"],
            motion.position[block.frame],
            motion.q_wb[block.frame],
            rig.scene.landmarks[block.landmark],
            block.uv_true,
        )
        assert np.abs(off).max() < 1e-6


def test_frames_have_the_cameras_size_and_times(flight):
    pytest.importorskip("cv2")
    t_ns, image = next(ims.camera.frames(flight, CAMERA, "room"))
    assert (image.shape, image.dtype) == ((480, 752), np.uint8)
    assert image.std() > 5.0
    assert t_ns == next(ims.camera.tracks(flight, CAMERA)).frames.t_ns[0]


def test_points_are_projected_as_by_opencv():
    cv2 = pytest.importorskip("cv2")
    points = np.random.default_rng(1).uniform([-1, -1, 2], [1, 1, 5], (50, 3))
    projection = ims.camera.project(points, "euroc_cam0")
    k = np.array([[458.654, 0, 367.215], [0, 457.296, 248.375], [0, 0, 1]])
    d = np.array([-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05])  # EuRoC's sensor.yaml
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), k, d)
    assert projection.valid.all()
    np.testing.assert_allclose(projection.uv, expected[:, 0], atol=1e-6)


def test_what_is_wrong_is_told():
    with pytest.raises(ims.ConfigurationError, match="euroc_cam7"):
        ims.camera.project([[0.0, 0.0, 1.0]], "euroc_cam7")
    with pytest.raises(ims.ConfigurationError, match=r"did you mean cam0\.camera\.pixel_noise"):
        ims.camera.project([[0.0, 0.0, 1.0]], {"pixel_nois": 1.0})
