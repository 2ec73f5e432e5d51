# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The topics of cameras: frames as messages, one home for bags and the live node."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from imu_sim_ros.bags.messages import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    POINT_CLOUD,
    POINT_CLOUD2,
    CameraInfo,
    CameraInfoEncoder,
    CompressedImageEncoder,
    ImageEncoder,
    PointCloud2Encoder,
    Qos,
)
from imu_sim_ros.camera import CameraModel, Rig, Scene, View, images
from imu_sim_ros.camera.images import Imager, png
from imu_sim_ros.config.cameras import CameraParameters, RigParameters
from imu_sim_ros.conventions import (
    CAMERA_INFO_TOPIC,
    COMPRESSED_TOPIC,
    DEPTH_TOPIC,
    FEATURES_TOPIC,
    IMAGE_TOPIC,
    LANDMARKS_TOPIC,
)
from imu_sim_ros.datasets.topics import resolved

LATCHED: Final = Qos(durability="transient_local", depth=1)
_DISTORTIONS: Final = {"none": "plumb_bob", "radtan": "plumb_bob", "equidistant": "equidistant"}
"""The names that image_geometry and kalibr's converters know."""


def camera_topics(rig: RigParameters) -> dict[str, str]:
    """Return the type of each topic that a rig has, by name."""
    found: dict[str, str] = {}
    for name, camera in rig.each().items():
        found.update({f"{name}/{topic}": kind for topic, kind in _kinds(camera).items()})
    if rig.features.layout != "none":
        found[FEATURES_TOPIC] = POINT_CLOUD
    found[LANDMARKS_TOPIC] = POINT_CLOUD2
    return found


def image_topic(camera: str, names: Mapping[str, str]) -> str:
    """Return the name of a camera's image topic: the raw one's, unless only the other is there.

    :param names: of the topics that are written, by their own names.
    """
    raw, compressed = (f"{camera}/{topic}" for topic in (IMAGE_TOPIC, COMPRESSED_TOPIC))
    key = compressed if compressed in names and raw not in names else raw
    return resolved(names.get(key, key))


def _kinds(camera: CameraParameters) -> dict[str, str]:
    kinds = {}
    if camera.images in ("raw", "both"):
        kinds[IMAGE_TOPIC] = IMAGE
    if camera.images in ("compressed", "both"):
        kinds[COMPRESSED_TOPIC] = COMPRESSED_IMAGE
    if camera.depth:
        kinds[DEPTH_TOPIC] = IMAGE
    kinds[CAMERA_INFO_TOPIC] = CAMERA_INFO
    return kinds


class CameraMessages:
    """Frames of one camera as the messages of its topics; may be used by several threads."""

    def __init__(self, view: View, frame_id: str, imager: Imager | None, encoding: str) -> None:
        """Set up the messages.

        :param imager: None: no images.
        """
        p = view.parameters
        kinds = _kinds(p)
        self._imager = imager
        self._info = CameraInfoEncoder(frame_id, info_of_camera(p), encoding)
        self._raw = self._png = self._depth = None
        if IMAGE_TOPIC in kinds:
            self._raw = ImageEncoder(frame_id, p.height, p.width, p.encoding, encoding)
        if COMPRESSED_TOPIC in kinds:
            self._png = CompressedImageEncoder(frame_id, p.encoding, encoding)
        if DEPTH_TOPIC in kinds:
            self._depth = ImageEncoder(frame_id, p.height, p.width, "32FC1", encoding)

    def messages(self, number: int, t_ns: int) -> dict[str, bytes]:
        """Return the messages of a frame with a stamp, by topic below the camera's name."""
        found = {CAMERA_INFO_TOPIC: self._info.encode(t_ns)}
        if self._imager is None:
            return found
        if self._raw is not None or self._png is not None:
            image = self._imager.image(number)
            if self._raw is not None:
                found[IMAGE_TOPIC] = self._raw.encode(t_ns, image)
            if self._png is not None:
                found[COMPRESSED_TOPIC] = self._png.encode(t_ns, png(image))
        if self._depth is not None:
            found[DEPTH_TOPIC] = self._depth.encode(t_ns, self._imager.depth(number))
        return found


def imagers(rig: Rig, names: list[str]) -> dict[str, Imager]:
    """Return the imagers of the cameras named, for those with images or depth.

    :raises ConfigurationError: for a scene without surfaces.
    :raises MissingDependencyError: where OpenCV is not installed.
    """
    views = {name: rig.views[name] for name in names}
    wanted = {
        name: view
        for name, view in views.items()
        if view.parameters.images != "none" or view.parameters.depth
    }
    return images.imagers(wanted, rig.scene, rig.parameters.scene, rig.trajectory)


def info_of_camera(camera: CameraParameters) -> CameraInfo:
    """Return a camera's model in the terms of sensor_msgs/CameraInfo.

    Of a unified sphere D is xi and the distortion, of a double sphere xi and alpha; ROS has no
    names for the two, so they have ours.
    """
    model = CameraModel(camera)
    k = np.array([[model.fx, 0.0, model.cx], [0.0, model.fy, model.cy], [0.0, 0.0, 1.0]])
    p = np.column_stack([k, np.zeros(3)])
    kind, d = _DISTORTIONS[camera.distortion_model], camera.distortion
    if kind == "plumb_bob":
        d = (*d, *[0.0] * (5 - len(d)))
    if camera.model != "pinhole":
        kind = camera.model
        own = (camera.xi,) if camera.model == "unified" else (camera.xi, camera.alpha)
        d = (*own, *camera.distortion)
    return CameraInfo(camera.height, camera.width, kind, d, k, np.eye(3), p)


def landmarks(scene: Scene, world_frame: str, t_ns: int, encoding: str = "cdr") -> bytes:
    """Return all landmarks with their ids as sensor_msgs/PointCloud2."""
    numbers = {"id": np.arange(len(scene.landmarks))}
    return PointCloud2Encoder(world_frame, encoding).encode(t_ns, scene.landmarks, numbers)
