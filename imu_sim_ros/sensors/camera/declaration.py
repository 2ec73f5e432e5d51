# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A camera as the rest of the package sees it: topics of its frames, one message for each."""

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Final, TypeAlias, TypeGuard, TypeVar

import numpy as np

from imu_sim_ros.core.conventions import (
    CAMERA_INFO_TOPIC,
    COMPRESSED_TOPIC,
    DEPTH_TOPIC,
    FLOW_TOPIC,
    IMAGE_TOPIC,
    MASK_TOPIC,
)
from imu_sim_ros.core.types import Bytes, Single
from imu_sim_ros.recordings.cameras import ROS_DISTORTIONS, CameraInfo
from imu_sim_ros.sensors.camera.features import FEATURES
from imu_sim_ros.sensors.camera.images.files import png
from imu_sim_ros.sensors.camera.images.libraries import numba, opencv
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig_parameters import RigParameters, rig_parameters_of
from imu_sim_ros.sensors.camera.scene_parameters import body_names, check_surfaces
from imu_sim_ros.sensors.camera.truths import DATASETS, LANDMARKS, moving_body_truth
from imu_sim_ros.sensors.declaration import (
    Mounted,
    Payloads,
    Rendering,
    Sensor,
    Topic,
    import_on_call,
)
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.samples import Rows, Samples

if TYPE_CHECKING:
    from imu_sim_ros.sensors.deferred import DeferredValues, Results

_MODULE: Final = "imu_sim_ros.sensors.camera.frames"
_IMAGE: Final = "sensor_msgs/msg/Image"

_Pixels = TypeVar("_Pixels")
Encode: TypeAlias = Callable[[int, _Pixels], bytes]
"""Function that turns the stamp [ns] and the pixels of a frame into a message."""
_DepthAndMask: TypeAlias = tuple[Single, Bytes | None]


def _pixel_topic(
    name: str,
    kind: str,
    pixels: "Callable[[Samples], DeferredValues[_Pixels]]",
    exists: Callable[[CameraParameters], bool],
    encoder: Callable[[Mounted[CameraParameters], str], Encode[_Pixels]],
    moving: bool = False,
) -> Topic:
    """Return a topic with a message for each frame of a camera.

    :param kind: type of the messages.
    :param pixels: returns the pixels of each frame among the samples.
    :param exists: returns True if a camera with these parameters has the topic.
    :param encoder: returns the encoder of a mounted camera for ``cdr`` or ``ros1``.
    :param moving: True if the topic exists only in scenes in which something moves.
    """

    def make(mounted: Mounted[CameraParameters], encoding: str) -> Payloads:
        opencv()
        numba()
        check_surfaces(rig_parameters_of(mounted.environment).scene)
        encode = encoder(mounted, encoding)

        def payloads(readings: Samples, rows: Rows, _: object) -> "Results[bytes]":
            def message(k: int, frame_pixels: _Pixels) -> bytes:
                return encode(int(readings.t_ns[k]), frame_pixels)

            return pixels(readings).begin(_numbers(readings, rows), message)

        return payloads

    def is_present(mounted: Mounted[CameraParameters]) -> bool:
        still = moving and not body_names(rig_parameters_of(mounted.environment).scene)
        return exists(mounted.parameters) and not still

    return Topic(name, kind, (), make, exists=is_present)


def _numbers(readings: Samples, rows: Rows) -> Iterable[int]:
    """Return the numbers of the rows of samples that are sent."""
    return np.arange(len(readings.t_ns))[rows].tolist()


def _image_encoder(
    mounted: Mounted[CameraParameters], pixel_encoding: str, encoding: str
) -> Callable[[int, Bytes | Single], bytes]:
    """Return the encoder of images in a pixel encoding."""
    from imu_sim_ros.bags.messages.encode_cameras import ImageEncoder

    p = mounted.parameters
    return ImageEncoder(mounted.frame, p.height, p.width, pixel_encoding, encoding).encode


def _raw(mounted: Mounted[CameraParameters], encoding: str) -> Encode[Bytes]:
    """Return the encoder of raw images."""
    return _image_encoder(mounted, mounted.parameters.encoding, encoding)


def _compressed_encoder(mounted: Mounted[CameraParameters], encoding: str) -> Encode[Bytes]:
    """Return the encoder of compressed images."""
    from imu_sim_ros.bags.messages.encode_cameras import CompressedImageEncoder

    messages = CompressedImageEncoder(mounted.frame, mounted.parameters.encoding, encoding)
    return lambda t_ns, image: messages.encode(t_ns, png(image))


def _depth(mounted: Mounted[CameraParameters], encoding: str) -> Encode[_DepthAndMask]:
    """Return the encoder of depth images."""
    encode = _image_encoder(mounted, "32FC1", encoding)
    return lambda t_ns, depth_and_mask: encode(t_ns, depth_and_mask[0])


def _mask(mounted: Mounted[CameraParameters], encoding: str) -> Encode[_DepthAndMask]:
    """Return the encoder of masks."""
    encode = _image_encoder(mounted, "mono8", encoding)

    def message(t_ns: int, depth_and_mask: _DepthAndMask) -> bytes:
        mask = depth_and_mask[1]
        assert mask is not None, "the topic exists only where bodies move"
        return encode(t_ns, mask)

    return message


def _flow(mounted: Mounted[CameraParameters], encoding: str) -> Encode[Single]:
    """Return the encoder of optical flow."""
    return _image_encoder(mounted, "32FC2", encoding)


def _info(mounted: Mounted[CameraParameters], encoding: str) -> Payloads:
    """Return the encoder of camera_info."""
    from imu_sim_ros.bags.messages.encode_cameras import CameraInfoEncoder

    messages = CameraInfoEncoder(mounted.frame, info_of_camera(mounted.parameters), encoding)
    return lambda readings, rows, _: [
        messages.encode(t_ns) for t_ns in readings.t_ns[rows].tolist()
    ]


def info_of_camera(camera: CameraParameters) -> CameraInfo:
    """Return a camera's model in the terms of sensor_msgs/CameraInfo.

    D is xi and the distortion for a unified sphere, xi and alpha for a double one; ROS has no
    names for the two, so they have ours.
    """
    model = CameraModel(camera)
    kind, d = ROS_DISTORTIONS[camera.distortion_model], camera.distortion
    if camera.model != "pinhole":
        shape = (camera.xi,) if camera.model == "unified" else (camera.xi, camera.alpha)
        kind, d = camera.model, (*shape, *d)
    size, intrinsics = (camera.height, camera.width), (model.fx, model.fy, model.cx, model.cy)
    return CameraInfo.of_lens(size, intrinsics, kind, d)


SENSOR: Final[Sensor[CameraParameters]] = Sensor(
    name="camera",
    quantity="camera",
    section=CameraParameters,
    model=import_on_call(_MODULE, "Camera"),
    topics=(
        _pixel_topic(
            IMAGE_TOPIC, _IMAGE, lambda s: s.image, lambda p: p.images in ("raw", "both"), _raw
        ),
        _pixel_topic(
            COMPRESSED_TOPIC,
            "sensor_msgs/msg/CompressedImage",
            lambda samples: samples.image,
            lambda p: p.images in ("compressed", "both"),
            _compressed_encoder,
        ),
        _pixel_topic(DEPTH_TOPIC, _IMAGE, lambda s: s.depth_and_mask, lambda p: p.depth, _depth),
        _pixel_topic(
            MASK_TOPIC, _IMAGE, lambda s: s.depth_and_mask, lambda p: p.depth, _mask, moving=True
        ),
        _pixel_topic(FLOW_TOPIC, _IMAGE, lambda s: s.flow, lambda p: p.flow != "none", _flow),
        Topic(CAMERA_INFO_TOPIC, "sensor_msgs/msg/CameraInfo", (), _info),
    ),
    readings=None,
    sees=True,
    faulty_parts=(),
    text="camera: its frames, with the errors of lens, shutter, exposure and pixels",
    warnings=import_on_call(_MODULE, "warnings"),
    in_sight=import_on_call(_MODULE, "visibility_mask"),
    rendering=Rendering(DATASETS, import_on_call(_MODULE, "notes")),
)


def _is_camera(sensor: Mounted[MountedParameters]) -> TypeGuard[Mounted[CameraParameters]]:
    """Return True for a camera."""
    return sensor.sensor is SENSOR


def cameras_in(
    sensors: Mapping[str, Mounted[MountedParameters]],
) -> dict[str, Mounted[CameraParameters]]:
    """Return the cameras among sensors."""
    return {name: sensor for name, sensor in sensors.items() if _is_camera(sensor)}


def mount_cameras(
    rig: RigParameters, parameters: EnvironmentParameters
) -> dict[str, Mounted[MountedParameters]]:
    """Return the cameras, their tracks, and the truth of the scene, as mounted sensors.

    :param parameters: parameters of the simulation.
    """
    cameras: dict[str, Mounted[MountedParameters]] = {
        name: Mounted(name, SENSOR, camera_parameters, parameters, rig.frame(name), f"{name}/")
        for name, camera_parameters in rig.camera_parameters().items()
    }
    if not cameras:
        return {}
    tracked = [FEATURES] if rig.features.layout != "none" else []
    for sensor in (*tracked, LANDMARKS, *map(moving_body_truth, body_names(rig.scene))):
        frame = parameters.body_frame
        cameras[sensor.quantity] = Mounted(sensor.name, sensor, rig, parameters, frame)
    return cameras
