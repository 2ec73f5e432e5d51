# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Regions of an image in which the renderer tests rectangles."""

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.sensors.camera.images.loops import IN_FRONT, LEVELS
from imu_sim_ros.sensors.camera.images.planes import Planes
from imu_sim_ros.sensors.camera.images.rays import PixelRays
from imu_sim_ros.sensors.camera.images.renderer import Renderer
from imu_sim_ros.sensors.camera.images.texture import Atlas
from imu_sim_ros.sensors.camera.view import Eyes

CAMERA = {
    "camera__width": 188,
    "camera__height": 120,
    "camera__mounting": [0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0],
}
LENSES = {
    "radial": {
        "camera__intrinsics": [114.7, 114.3, 91.8, 62.1],
        "camera__distortion_model": "radtan",
        "camera__distortion": [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05],
    },
    "fisheye": {
        "camera__intrinsics": [55.0, 55.0, 93.0, 60.0],
        "camera__distortion_model": "equidistant",
        "camera__distortion": [0.0035, 0.0007, -0.002, 0.0002],
    },
}


def all_rays(view, scale):
    """Return the rays of a camera and those of all its pixels (3, h, w)."""
    rays = PixelRays(view.model, scale)
    bands = [rays.of_band(k) for k in range(len(rays.bands))]
    return rays, np.concatenate(bands, axis=1)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("limit", [0, 10**9])
def test_rays_look_through_the_middle_of_each_part_of_a_pixel(make_rig, monkeypatch, lens, limit):
    """Kept for all images or found for each: projected, they meet their place again."""
    monkeypatch.setattr("imu_sim_ros.sensors.camera.images.rays._KEPT", limit)
    monkeypatch.setattr("imu_sim_ros.sensors.camera.images.rays._BAND", 64_000)
    view = make_rig("target", **CAMERA, **LENSES[lens]).views["cam0"]
    rays, full = all_rays(view, 3)
    assert len(rays.bands) > 2
    assert full.shape == (3, 360, 564)
    pixels, valid = view.model.project(full.reshape(3, -1).T.astype(np.float64))
    i, j = np.divmod(np.arange(360 * 564), 564)
    expected = np.stack([(j - 1) / 3.0, (i - 1) / 3.0], axis=1)
    # Directions in single precision: 6e-8 of 115 pixels' focal length, and the lens's own inverse.
    assert valid.all()
    assert np.abs(pixels - expected).max() < 5e-5
    rows, columns = np.array([0, 0, 119, 250, 359]), np.array([5, 563, 7])
    (some,) = rays.at((rows, columns))
    assert np.array_equal(some, full[:, rows[:, None], columns])


@pytest.mark.parametrize("lens", LENSES)
def test_no_rectangle_is_missed_however_thin(make_rig, lens):
    """Rays meet a rectangle only in cells where it may be; here all rays meet all rectangles."""
    stream = np.random.default_rng(8)
    sizes = [(100.0, 0.004), (0.5, 40.0), (0.02, 0.02), (3.0, 2.0)]
    corners = []
    for k in range(40):
        q = stream.standard_normal(4)
        turn = rotation.to_matrix(q / np.linalg.norm(q))
        across, up = (turn[:, j] * sizes[k % 4][j] for j in (0, 1))
        origin = stream.uniform(-1.5, 1.5, 3) - across * stream.random() - up * stream.random()
        corners += [*origin, *(origin + across), *(origin + up)]
    values = {**CAMERA, **LENSES[lens], "scene__type": "planes", "scene__corners": corners}
    rig = make_rig("target", **values)
    view, surfaces = rig.views["cam0"], rig.scene.surfaces
    white = np.full((8, 8), 255, np.uint8)
    textures = Atlas(white, np.ones((40, 2), np.float32), np.ones((40, LEVELS, 2), np.float32))
    renderer = Renderer(view.model, surfaces, textures, 1)
    _, rays = all_rays(view, 1)
    for t in (0.5, 4.0):
        poses = view.poses(rig.trajectory, np.array([t]))
        position, r_wc = (
            np.round(part * 2.0**30) / 2.0**30
            for part in (poses.position, rotation.to_matrix(poses.q_wc))
        )
        planes = Planes.of(surfaces, surfaces.normal, position, r_wc)
        nearest, rectangles_hit = np.zeros((120, 188), np.float32), set()
        for m in range(40):
            intersections = planes.meet(
                np.array([m]), rays.reshape(3, 1, -1), np.zeros((1, 1), np.int64), IN_FRONT
            )
            ahead, inverse, places = (
                part.reshape(*part.shape[:-2], 120, 188) for part in intersections
            )
            in_rectangle = ((places >= 0.0) & (places <= 1.0)).all(axis=0)
            shown = ahead & in_rectangle & (inverse > nearest)
            nearest[shown] = inverse[shown]
            rectangles_hit |= {m} if shown.any() else set()
        depth = rays[2] / np.where(nearest > 0.0, nearest, np.inf)
        assert len(rectangles_hit) > 8
        assert np.array_equal(renderer.depth(Eyes(poses)), np.where(nearest > 0.0, depth, 0.0))
