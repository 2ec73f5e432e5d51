# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of cameras and of what they see; a room of its own, for most runs have no camera.

``camera`` one camera, ``distortion`` where its polynomial folds, ``scene`` what is seen, ``rig``
all cameras of a body and how their parameters are layered. Imports the rest of config.
"""

from imu_sim_ros.config.cameras.camera import CameraModelParameters, CameraParameters
from imu_sim_ros.config.cameras.distortion import distorted_radius, fold, radial_coefficients
from imu_sim_ros.config.cameras.rig import (
    RigParameters,
    camera_names,
    layer_rig,
    load_rig,
    rig_problems,
    rig_section,
    scene_layer,
    split_rig,
)
from imu_sim_ros.config.cameras.scene import TYPES as SCENES
from imu_sim_ros.config.cameras.scene import (
    AprilgridParameters,
    CheckerboardParameters,
    CloudParameters,
    HouseParameters,
    PathSceneParameters,
    PlanesParameters,
    PointFileParameters,
    RoomParameters,
    SceneParameters,
    TargetParameters,
)

__all__ = [
    "SCENES",
    "AprilgridParameters",
    "CameraModelParameters",
    "CameraParameters",
    "CheckerboardParameters",
    "CloudParameters",
    "HouseParameters",
    "PathSceneParameters",
    "PlanesParameters",
    "PointFileParameters",
    "RigParameters",
    "RoomParameters",
    "SceneParameters",
    "TargetParameters",
    "camera_names",
    "distorted_radius",
    "fold",
    "layer_rig",
    "load_rig",
    "radial_coefficients",
    "rig_problems",
    "rig_section",
    "scene_layer",
    "split_rig",
]
