# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of the corners of a printed grid [pixels], measured with OpenCV's refinement."""

import numpy as np
import pytest
from small_camera import SMALL_CAMERA

from imu_sim_ros.core import rotation
from imu_sim_ros.sensors.camera.view import CameraPoses, Eyes, transform_to_camera

WIDE_CAMERA = {
    **SMALL_CAMERA,
    "camera__width": 752,
    "camera__height": 480,
    "camera__intrinsics": [458.65, 457.3, 367.2, 248.4],
}


def judged(renderer, view, corners, low, high):
    """Return errors of corners (n, 2) [pixels] in three images from a box, and the images.

    :param renderer: with any number of rays along each side of a pixel.
    :param corners: (m, 3) in the world, ahead along x.
    """
    cv2 = pytest.importorskip("cv2")
    mounting = rotation.from_matrix(np.array(SMALL_CAMERA["camera__mounting"]).reshape(3, 3))
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-5)
    stream, errors, images = np.random.default_rng(3), [], []
    for _ in range(3):
        eye = stream.uniform(low, high)
        turn = rotation.from_euler(stream.uniform(-0.12, 0.12, 3))
        poses = CameraPoses(eye[None], rotation.multiply(turn, mounting)[None])
        total, rays = np.zeros((480, 752), np.uint32), len(renderer.rows) // 480
        for rows, picture in renderer.pictures(Eyes(poses)):
            for a, b in np.ndindex(rays, rays):
                total[rows] += picture[a::rays, b::rays]
        image = np.rint(total / rays**2).astype(np.uint8)
        many = CameraPoses(*(np.repeat(part, len(corners), axis=0) for part in poses))
        uv, valid = view.model.project(transform_to_camera(many, corners))
        uv = uv[valid & view.model.inside(uv, 15.0)]
        start = uv.astype(np.float32).reshape(-1, 1, 2)
        refined = cv2.cornerSubPix(image, start, (5, 5), (-1, -1), stop)
        errors.append(refined[:, 0] - uv)
        images.append(image)
    return np.concatenate(errors), images
