# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A quarter of EuRoC's cam0, without noise: images of it take little time."""

import numpy as np

from imu_sim_ros.sensors.camera.images.imager import Imager, textures
from imu_sim_ros.sensors.camera.images.texture import LEVELS, Atlas

SMALL_CAMERA = {
    "camera__width": 188,
    "camera__height": 120,
    "camera__intrinsics": [114.7, 114.3, 91.8, 62.1],
    "camera__distortion_model": "radtan",
    "camera__distortion": [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05],
    "camera__mounting": [0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0],
    "camera__rate": 20.0,
    "camera__read_noise": 0.0,
}


def without_textures(scene):
    """Return textures of one texel for a scene of which depth alone is asked, and no image."""
    crowd = scene.crowd.surfaces if scene.crowd else ()
    count = sum(len(group.origin) for group in (scene.surfaces, *crowd))
    size, place = np.ones((count, 2), np.float32), np.ones((count, LEVELS, 2), np.float32)
    return Atlas(np.zeros((8, 8), np.uint8), size, place)


def imager_of(rig, scene=None):
    """Return what makes the images of a rig's first camera, in its scene or in another one."""
    view, scene = rig.views["cam0"], rig.scene if scene is None else scene
    look = textures(scene, rig.parameters.scene, view.parameters.encoding == "rgb8")
    return Imager(view, scene, look, rig.trajectory)
