# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Optical flow: against depth and poses, point by point, and by warping the next image."""

import itertools
import json

import numpy as np
import pytest
from rigs import make_rig
from small_camera import SMALL_CAMERA, imager_of, without_textures

from imu_sim_ros.core import rotation
from imu_sim_ros.sensors.camera.images.flow import kitti_flow
from imu_sim_ros.sensors.camera.images.imager import Imager
from imu_sim_ros.sensors.camera.view import CameraPoses, transform_to_camera

HALL = {
    **SMALL_CAMERA,
    "scene__type": "corridor",
    "scene__bodies__people": 3,
    "scene__bodies__carts": 1,
    "scene__horizon": 10.0,
}


TOUR = {
    **HALL,
    "trajectory__place": "corridor",
    "trajectory__place_size": [16.0, 5.0, 2.6],
    "scene__size": [16.0, 5.0, 2.6],
    "scene__center": [0.0, 0.0, 1.3],
}


def flowing(trajectory="figure_eight", **values):
    """Return a rig and what gives the flow of its camera, and no images."""
    rig = make_rig(trajectory, **{**HALL, **values})
    textures = without_textures(rig.scene)
    return rig, Imager(rig.views["cam0"], rig.scene, textures, rig.trajectory)


@pytest.fixture(scope="module")
def scene():
    return make_rig("tour", duration=90.0, **TOUR).scene


@pytest.fixture(scope="module", params=[0.0, 2e-4], ids=["global", "rolling"])
def hall(request, scene):
    """Return a rig in a scene that both shutters see, what gives its flow, and its row time."""
    rolling = {"camera__row_time": request.param}
    rig, imager = flowing("tour", duration=90.0, scene=scene, **TOUR, **rolling)
    return rig, imager, request.param


def test_flow_is_that_of_depth_and_poses(hall):
    """Some pixels of the hall and of each body, one by one; rows by iteration of their times."""
    rig, imager, row_time = hall
    view, height = rig.views["cam0"], 120
    bodies = set()
    frames = (k for k in range(0, 1780, 60) if len(np.unique(imager.depth_and_mask(k)[1])) > 1)
    for number in list(itertools.islice(frames, 3)):
        steps = imager.flow(number)
        depth, mask = imager.depth_and_mask(number)
        valid = np.isfinite(steps).all(axis=2)
        assert valid.mean() > 0.5
        stream = np.random.default_rng(number)
        pixels = np.argwhere(valid)
        pixels = np.concatenate(
            [
                some[stream.integers(0, len(some), min(len(some), 8))]
                for some in (pixels[mask[tuple(pixels.T)] == k] for k in np.unique(mask[valid]))
            ]
        )
        for v, u in pixels.tolist():
            t = number / 20.0 + row_time * (v - 0.5 * (height - 1))
            pose = view.poses(rig.trajectory, np.array([t]))
            ray = view.model.unproject(np.array([[u, v]], float)).direction[0]
            local = ray / ray[2] * float(depth[v, u])
            body = int(mask[v, u])
            bodies.add(body)
            moving_bodies = rig.scene.crowd.bodies
            if body:
                pose = CameraPoses(*moving_bodies[body - 1].sees(np.array([t]), *pose))
            point = pose.position[0] + rotation.rotate(pose.q_wc[0], local)

            def at(row, body=body, point=point, moving_bodies=moving_bodies, number=number):
                row_stamps = np.array([(number + 1) / 20.0 + row_time * (row - 0.5 * (height - 1))])
                pose = view.poses(rig.trajectory, row_stamps)
                if body:
                    pose = CameraPoses(*moving_bodies[body - 1].sees(row_stamps, *pose))
                return view.model.project(transform_to_camera(pose, point[None]))[0][0]

            row = float(v)
            for _ in range(6 if row_time else 1):  # each is closer by its share of rows per row
                projection = at(row)
                row = projection[1]
            # Single precision: 4e-6 px of 188, and 1e-7 of the depth.
            assert np.abs(projection - (u, v) - steps[v, u]).max() < 1e-4
    assert len(bodies) >= 3  # the hall and two that move


def test_the_next_image_warped_by_the_flow_is_the_image():
    """Valid pixels agree to a few grey values, apart from changes of light and gloss."""
    cv2 = pytest.importorskip("cv2")
    plain = {"scene__texture": "plain", "trajectory__y.amplitude": [1.2]}
    rig = make_rig("figure_eight", **HALL, **plain, camera__row_time=2e-4)
    imager = imager_of(rig)
    rows, columns = np.mgrid[:120, :188].astype(np.float32)
    for number in (10, 70):
        steps = imager.flow(number)
        valid = np.isfinite(steps).all(axis=2)
        displacement = np.nan_to_num(steps)
        current, second = (imager.image(k).astype(np.float32) for k in (number, number + 1))
        warped = cv2.remap(
            second, columns + displacement[..., 0], rows + displacement[..., 1], cv2.INTER_CUBIC
        )
        moved, still = (np.abs(frame - current)[valid] for frame in (warped, second))
        assert np.median(moved) <= 1.0
        assert moved.mean() < 0.5 * still.mean()


def test_the_last_frame_has_none_and_what_leaves_the_image_has_none():
    rig, imager = flowing(scene__type="office", scene__bodies__people=0, scene__bodies__carts=0)
    assert np.isnan(imager.flow(rig.views["cam0"].total - 1)).all()
    steps = imager.flow(30)
    rows, columns = np.mgrid[:120, :188]
    target = np.stack([columns, rows], axis=2) + steps
    valid = np.isfinite(steps).all(axis=2)
    assert not valid.all()
    assert (target[valid] >= -0.5).all()
    assert (target[valid] <= (187.5, 119.5)).all()


def test_flow_images_of_kitti_hold_64ths_of_a_pixel_and_validity():
    steps = np.array([[[3.25, -7.0], [np.nan, np.nan]], [[600.0, 0.0], [0.0, 0.0]]], np.float32)
    png = kitti_flow(steps).astype(float)
    valid = png[..., 2] > 0
    assert valid.tolist() == [[True, False], [False, True]]
    assert ((png[..., :2] - 2**15) / 64.0)[valid].tolist() == [[3.25, -7.0], [0.0, 0.0]]


def test_folders_and_bags_hold_it(tmp_path, capsys):
    cv2 = pytest.importorskip("cv2")
    reader = pytest.importorskip("rosbags.highlevel")
    from imu_sim_ros.commands.generate import main

    small = [
        f"--set={name.replace('__', '.')}={json.dumps(value)}"
        for name, value in {**SMALL_CAMERA, "camera__mounting": None}.items()
        if value is not None
    ]
    arguments = ["--trajectory", "figure_eight", "--scene", "room", "--rate", "100", "--duration"]
    arguments += ["0.2s", "--camera", "euroc_cam0", *small, "--seed", "1", "--quiet"]
    for form in ("raw", "kitti"):
        out = ["-o", str(tmp_path / form), "--format", "euroc"]
        assert main([*out, *arguments, "--set", f"camera.flow={form}"]) == 0
    assert main(["-o", str(tmp_path / "a.mcap"), *arguments, "--set", "camera.flow=raw"]) == 0
    arrays = [np.load(path) for path in sorted((tmp_path / "raw/cam0/flow").glob("*.npy"))]
    pictures = sorted((tmp_path / "kitti/cam0/flow").glob("*.png"))
    images = sorted((tmp_path / "raw/cam0/data").glob("*.png"))
    assert [path.stem for path in pictures] == [path.stem for path in images]
    for steps, path in zip(arrays, pictures, strict=True):
        red_last = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]  # OpenCV: blue first
        assert np.array_equal(red_last, kitti_flow(steps))
    with reader.AnyReader([tmp_path / "a.mcap"]) as bag:
        [topic] = [c for c in bag.connections if c.topic == "/cam0/flow/image_raw"]
        for steps, (_, _, data) in zip(arrays, bag.messages([topic]), strict=True):
            message = bag.deserialize(data, topic.msgtype)
            assert message.encoding == "32FC2"
            values = np.frombuffer(message.data.tobytes(), np.float32)
            assert np.array_equal(values, steps.reshape(-1), equal_nan=True)
