# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images of what a camera sees; the only user of OpenCV, imported when an image is rendered.

``texture`` is what surfaces look like, ``tag36h11`` the tags of a target, ``cover`` where in the
image a surface may be, ``plane`` and ``mip`` where a ray meets it and at which level it looks,
``renderer`` where each pixel looks, ``imager`` the sensor's errors, ``encode`` a PNG of it and
back.
"""

from imu_sim_ros.camera.images.encode import decoded, png
from imu_sim_ros.camera.images.examine import JPEG, PNG, Size, examined
from imu_sim_ros.camera.images.imager import Imager, imagers
from imu_sim_ros.camera.images.renderer import Maps, Renderer, look_up, opencv
from imu_sim_ros.camera.images.texture import Atlas, atlas

__all__ = [
    "JPEG",
    "PNG",
    "Atlas",
    "Imager",
    "Maps",
    "Renderer",
    "Size",
    "atlas",
    "decoded",
    "examined",
    "imagers",
    "look_up",
    "opencv",
    "png",
]
