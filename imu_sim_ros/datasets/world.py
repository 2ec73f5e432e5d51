# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""World and mount of readings that dead reckoning needs: gravity, the Earth, the IMU's mount."""

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE
from imu_sim_ros.bags.read import decode_blocks, decode_messages, open_bag
from imu_sim_ros.bags.text.reader import imu_file, is_text, state_file
from imu_sim_ros.core.conventions import GRAVITY, TF_STATIC_TOPIC
from imu_sim_ros.core.rotation import inverse_pose
from imu_sim_ros.core.types import Array
from imu_sim_ros.datasets.transforms import (
    Transforms,
    transform_to_root,
    transforms_of_message,
    transforms_to_ancestors,
)
from imu_sim_ros.datasets.truth_files import simulation_of
from imu_sim_ros.inputs.rows import is_present
from imu_sim_ros.sensors.camera.calibration_files import description
from imu_sim_ros.sensors.gravity import earth_rate_vector, gravity_vector
from imu_sim_ros.simulation.parameters import SampledParameters

_CURVED_EARTH: Final = (
    "simulated over a curved Earth, which is integrated as a plane: the errors include what the "
    "local level turns and gravity changes along the way"
)


class KnownWorld(NamedTuple):
    """Parameters of the world and the mount of readings that integration needs."""

    parameters: dict[str, list[float]]
    """Parameters of the integrator that differ from the defaults, by name."""
    notes: tuple[str, ...] = ()
    """Assumptions of the result, for the user."""


def world_of_simulation(simulated: SampledParameters) -> KnownWorld:
    """Return the world of a simulation."""
    gravity, rate = gravity_vector(simulated).tolist(), earth_rate_vector(simulated).tolist()
    parameters = {"gravity": gravity} if tuple(gravity) != GRAVITY else {}
    if any(rate):
        parameters["earth_rate"] = rate
    imu = simulated.imu
    parameters |= _mount_parameters(np.reshape(imu.mounting, (3, 3)), np.asarray(imu.lever_arm))
    return KnownWorld(parameters, (_CURVED_EARTH,) if simulated.curved_earth else ())


def read_world(
    path: Path, imu_topic: str | None, truth_topic: str | None, with_truth: bool, is_bag: bool
) -> KnownWorld:
    """Return the world of a file.

    The mount of the IMU is that of the file's own transforms (``/tf_static``, ``sensor.yaml``),
    else that of the realised truth next to a simulated file.

    :param imu_topic: topic of the readings; None: the only one.
    :param truth_topic: topic of the truth; None: the only one.
    :param with_truth: True if there is a truth, whose frame is the body; else the body is the frame
            to which all frames are fixed.
    :param is_bag: True for a bag, which may have transforms.
    :raises InputError: for several IMUs of different mounts without a topic that names one.
    """
    simulated = simulation_of(path, imu_topic)
    world = KnownWorld({}) if simulated is None else world_of_simulation(simulated)
    if is_bag:
        mount = _bag_mount(path, imu_topic, truth_topic, with_truth)
    else:
        mount = _dataset_mount(path, imu_topic, with_truth)
    if mount.pose is not None:
        world.parameters.update(_mount_parameters(mount.pose[:3, :3], mount.pose[:3, 3]))
    elif simulated is None and mount.unknown:
        world = world._replace(notes=(*world.notes, mount.unknown))
    return world


def _mount_parameters(mounting: Array, lever_arm: Array) -> dict[str, list[float]]:
    """Return the parameters of a mount that differs from the body's frame."""
    parameters = {}
    if lever_arm.any():
        parameters["imu.lever_arm"] = lever_arm.tolist()
    if (mounting != np.eye(3)).any():
        parameters["imu.mounting"] = mounting.ravel().tolist()
    return parameters


class _RecordedMount(NamedTuple):
    """Mount of an IMU according to a recording."""

    pose: Array | None = None
    """T_bi (4, 4), maps points of the IMU into the truth's body; None: not recorded."""
    unknown: str = ""
    """Missing information, as text; empty if the frames are the same, or have no names."""


def _dataset_mount(path: Path, imu_name: str | None, with_truth: bool) -> _RecordedMount:
    """Return the mount of the IMU of a EuRoC folder (``sensor.yaml``); other files have none.

    :param with_truth: True if there is a truth, whose frame is the body.
    """
    if not (path.is_dir() and is_text(path)):
        return _RecordedMount()
    imu_mount = _folder_mount(imu_file(path, imu_name).parent)
    truth_mount = _folder_mount(state_file(path).parent) if with_truth else None
    if imu_mount is None:
        return _RecordedMount()
    return _RecordedMount(
        imu_mount if truth_mount is None else inverse_pose(truth_mount) @ imu_mount
    )


def _folder_mount(folder: Path) -> Array | None:
    """Return the pose (4, 4) of a sensor in a EuRoC folder; None if none is stated."""
    file = folder / "sensor.yaml"
    return description(file)[1] if is_present(file) else None


def _bag_mount(
    path: Path, imu_topic: str | None, truth_topic: str | None, with_truth: bool
) -> _RecordedMount:
    """Return the mount of the IMU of a bag (``/tf_static``).

    :param with_truth: True if there is a truth, whose frame is the body; else the body is the frame
            to which all frames are fixed.
    """
    frame = frame_of(path, IMU, imu_topic, 0)
    body = frame_of(path, ODOMETRY, truth_topic, 1) if with_truth else ""
    if frame == body or (with_truth and not (frame and body)):
        return _RecordedMount()
    transforms = static_transforms(path)
    if not with_truth:
        return _RecordedMount(transform_to_root(transforms, frame))
    pose = transform_between(transforms, frame, body)
    if pose is not None:
        return _RecordedMount(pose)
    return _RecordedMount(
        None,
        f"nothing says where {frame} is in {body} ({TF_STATIC_TOPIC}, or the _truth.yaml of "
        "generate): taken to be in its origin with its axes; imu.lever_arm and imu.mounting state "
        "another mount",
    )


def static_transforms(path: Path) -> Transforms:
    """Return the transforms of a bag's ``/tf_static``."""
    transforms: Transforms = {}
    with open_bag(path) as bag:
        names = {t.name for t in bag.topics if t.name == TF_STATIC_TOPIC and t.type == TF_MESSAGE}
        for _, message in decode_messages(bag, names):
            transforms.update(transforms_of_message(message))
    return transforms


def transform_between(transforms: Transforms, frame: str, body: str) -> Array | None:
    """Return T (4, 4), which maps coordinates from one frame to another; None: unknown."""
    frame_ancestors, body_ancestors = (
        transforms_to_ancestors(transforms, frame),
        transforms_to_ancestors(transforms, body),
    )
    for ancestor, pose in frame_ancestors.items():
        if ancestor in body_ancestors:
            return inverse_pose(body_ancestors[ancestor]) @ pose
    return None


def frame_of(path: Path, kind: str, topic: str | None, index: int) -> str:
    """Return a frame of a topic's first message.

    :param index: index of the frame among the strings of the message.
    """
    for fields in decode_blocks(path, kind, topic, (), warned=bool):
        return str(fields.texts[index])
    return ""
