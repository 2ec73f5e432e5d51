# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a camera on a moving body sees: models, scenes, feature tracks.

``project``, ``tracks``, ``frames`` and ``depths`` give it in one call, as arrays.

The camera's frame c has x to the right, y down and z along the view; the centre of the first pixel
is at (0, 0). A frame depends on nothing but the seed and its number, so frames are the same in
blocks of any size, and can be generated in any order.
"""

from imu_sim_ros.camera.build import build_scene
from imu_sim_ros.camera.model import CameraModel, Projection, Rays
from imu_sim_ros.camera.observe import depths, frames, project, tracks
from imu_sim_ros.camera.point_file import read_points
from imu_sim_ros.camera.reprojection import reprojection_errors
from imu_sim_ros.camera.rig import Blindness, Rig, build_rig
from imu_sim_ros.camera.scene import Scene, Surfaces
from imu_sim_ros.camera.target import fitted
from imu_sim_ros.camera.tracker import Lines, Tracker, Tracks
from imu_sim_ros.camera.view import Frames, Poses, View, in_camera

__all__ = [
    "Blindness",
    "CameraModel",
    "Frames",
    "Lines",
    "Poses",
    "Projection",
    "Rays",
    "Rig",
    "Scene",
    "Surfaces",
    "Tracker",
    "Tracks",
    "View",
    "build_rig",
    "build_scene",
    "depths",
    "fitted",
    "frames",
    "in_camera",
    "project",
    "read_points",
    "reprojection_errors",
    "tracks",
]
