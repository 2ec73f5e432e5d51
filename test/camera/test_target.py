# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The board and the motion of a calibration follow from the lens."""

import cv2
import numpy as np
import pytest

from imu_sim_ros.camera import build_rig, rig_of
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import MissingDependencyError
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.camera.frames import warnings
from imu_sim_ros.sensors.camera.images.imager import Imager
from imu_sim_ros.sensors.camera.images.tag36h11 import tag
from imu_sim_ros.sensors.camera.images.texture import atlas
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.scene_fit import fit_scene as fitted_with
from imu_sim_ros.trajectory.parameters import trajectory_layer


def fitted(parameters):
    return fitted_with(parameters, lambda values: load_simulation(values).trajectory)


def target_parameters(*presets, **values):
    """Return the parameters of a calibration with these cameras, ``__`` for a dot."""
    names = [f"cam{k}" for k in range(len(presets))]
    return {
        "cameras": names,
        **{f"{n}.camera.preset": p for n, p in zip(names, presets, strict=True)},
        "camera.body_axes": "flu",
        "camera.trigger": "free",
        "trajectory.type": "target",
        "scene.type": "aprilgrid",
        "duration": 60.0,
        **{key.replace("__", "."): value for key, value in values.items()},
    }


def body_of(values):
    return Body(load_simulation(values), sensors=["cam0"])


def corners_in_view(rig, name):
    """Return all corners in view, the shortest edges of whole tags, and their number by frame."""
    view, t = rig.views[name], np.linspace(0.0, 60.0, 601)
    poses = view.poses(rig.trajectory, t)
    pixels, edges, counts = [], [], []
    for position, q_wc in zip(*poses, strict=True):
        local = rotation.rotate_inverse(q_wc, rig.scene.landmarks - position)
        uv, valid = view.model.project(local)
        in_image = valid & view.model.inside(uv)
        tags = uv.reshape(-1, 4, 2)[in_image.reshape(-1, 4).all(axis=1)]
        pixels.append(uv[in_image])
        counts.append(len(tags))
        edges.append(np.linalg.norm(tags - np.roll(tags, 1, axis=1), axis=2).ravel())
    return np.concatenate(pixels), np.concatenate(edges), np.array(counts)


@pytest.mark.parametrize("preset", files.names("cameras"))
def test_corners_cover_the_images_of_every_camera_and_a_detector_finds_the_tags(preset):
    """Four pixels a bit are 40 along a tag of 6 bits and two of border on either side."""
    aprilgrid = pytest.importorskip("aprilgrid")
    rig = build_rig(target_parameters(preset, camera__max_features=0, camera__pixel_noise=0.0))
    pixels, edges, counts = corners_in_view(rig, "cam0")
    model, scene = rig.views["cam0"].model, rig.parameters.scene
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    assert ((high - low) / (model.width, model.height)).min() > 0.8
    assert edges.min() > 40.0
    assert counts.min() >= min(9, scene.rows * scene.columns)
    assert warnings(rig.cameras["cam0"], rig.world, 60.0) == []
    imager = Imager(rig.views["cam0"], rig.scene, atlas(rig.scene.surfaces, scene), rig.trajectory)
    detector = aprilgrid.Detector("t36h11")
    for number in range(60, 1200, 285):
        tracks = rig.tracker("cam0").tracks(number, 1)
        corners = np.full((scene.rows * scene.columns * 4, 2), np.nan)
        corners[tracks.landmark] = tracks.uv_true
        corners = corners.reshape(-1, 4, 2)
        whole = set(np.flatnonzero(np.isfinite(corners).all(axis=(1, 2))).tolist())
        detections = {tag.tag_id: tag.corners for tag in detector.detect(imager.image(number))}
        # The edges of large tags are bent in a fisheye: some are not taken for tags.
        min_share = 0.6 if model.kind == "equidistant" else 0.9
        assert len(whole & set(detections)) >= min_share * len(whole) >= 0.6 * 9
        for number in whole & set(detections):
            away = np.linalg.norm(
                np.reshape(detections[number], (4, 1, 2)) - corners[number], axis=2
            )
            assert away.min(axis=1).max() < 2.0


def test_what_is_given_stays_and_what_was_fitted_is_not_fitted_again():
    """The parameters of an output make the same samples and images again."""
    lens = target_parameters("tum_vi_cam0", "tum_vi_cam1")
    values = fitted(lens)
    assert values["scene.columns"] < 6
    assert fitted(values) == values
    overrides = {
        "scene.tag_size": 0.088,
        "scene.columns": 6,
        "trajectory.yaw.amplitude": [0.2, 0.1],
    }
    fitted_values = fitted({**lens, **overrides})
    assert {name: fitted_values[name] for name in overrides} == overrides
    assert fitted_values["scene.position"] != values["scene.position"]
    [warning] = body_of({**lens, **overrides}).warnings()
    assert "a bit of the AprilGrid's tags has 1.0 px at the least (4 are wanted)" in warning


@pytest.mark.parametrize(
    "parameters",
    [
        {"trajectory.type": "figure_eight"},
        {"scene.type": "checkerboard"},
        {"trajectory.z.angular_frequency": [1.0, 2.0, 3.0]},
        {"camera.body_axes": "preset"},
        {"scene.tag_size": "large"},
        {"camera.preset": "none"},
    ],
    ids=str,
)
def test_only_the_motion_before_the_board_follows_the_lens(parameters):
    layer = trajectory_layer("target")
    lens = {**target_parameters("euroc_cam0"), **layer}
    assert fitted(lens)["scene.tag_size"] > 0.15  # the motion's file was read: it is still target
    if "camera.preset" in parameters:
        del lens["cam0.camera.preset"]
    assert fitted({**lens, **parameters}) == {**lens, **parameters}


def test_a_board_out_of_view_is_said():
    """EuRoC's body has x up: in its own axes the camera looks past the board."""
    [line] = body_of(target_parameters("euroc_cam0", camera__body_axes="preset")).warnings()
    assert line.startswith("cam0: ")
    assert "no tag of the AprilGrid comes into view" in line
    assert "camera.body_axes = preset" in line


def test_the_axes_of_the_body_are_those_of_the_trajectory(tmp_path):
    """Forward, left, up for ours; a recording's own; what is told, and a mounting that is told."""
    ours = {"cameras": ["cam0"], "camera.preset": "euroc_cam0", "trajectory.type": "polar"}
    recorded = {**ours, "trajectory.type": "poses", "trajectory.file": "flight.csv"}

    def axes(**overrides):
        return {
            kind: load_simulation({**settings, **overrides}).rig.camera("cam0").body_axes
            for kind, settings in (("ours", ours), ("recorded", recorded))
        }

    assert axes() == {"ours": "flu", "recorded": "preset"}
    assert axes(**{"cam0.camera.body_axes": "preset"})["ours"] == "preset"
    assert axes(**{"camera.mounting": [1.0, 0, 0, 0, 1, 0, 0, 0, 1]})["ours"] == "preset"
    body = body_of({**ours, "scene.type": "house", "camera.images": "none", "duration": 1.0})
    rig = rig_of(body.parameters, body.trajectory, body.t0_ns)
    forward = rotation.to_matrix(rig.views["cam0"].q_bc)[:, 2]
    assert forward[0] > 0.99
    assert body.notes() == ["cam0: the body is forward, left, up (camera.body_axes flu)"]


def test_an_opencv_without_tags_is_told(monkeypatch):
    monkeypatch.delattr(cv2, "aruco")
    with pytest.raises(MissingDependencyError, match="AprilGrids need the tags of OpenCV"):
        tag(0)
