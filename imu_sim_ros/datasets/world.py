# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What dead reckoning has to know of readings: gravity, the Earth, the IMU's mount on the body."""

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE
from imu_sim_ros.bags.read import decoded_blocks, decoded_messages, open_bag
from imu_sim_ros.bags.text.reader import imu_file, is_text, state_file
from imu_sim_ros.conventions import GRAVITY, TF_STATIC_TOPIC
from imu_sim_ros.datasets.recorded import read_sensor_yaml
from imu_sim_ros.datasets.transforms import Transforms, ancestors, fixed_transforms, to_root
from imu_sim_ros.datasets.truth_files import simulation_of
from imu_sim_ros.inputs.rows import is_present
from imu_sim_ros.rotation import inverse_pose
from imu_sim_ros.sensors.gravity import earth_rate_vector, gravity_vector
from imu_sim_ros.simulation.parameters import SampledParameters
from imu_sim_ros.types import Array

_CURVED_EARTH: Final = (
    "simulated over a curved Earth, which is integrated as a plane: the errors include what the "
    "local level turns and gravity changes along the way"
)


class KnownWorld(NamedTuple):
    """What integration has to know of the world and the IMU of readings."""

    parameters: dict[str, list[float]]
    """Of the integrator, by name; only what is not usual."""
    notes: tuple[str, ...] = ()
    """What the result rests on, for the user."""


def world_of_simulation(simulated: SampledParameters) -> KnownWorld:
    """Return the world of a simulation."""
    gravity, rate = gravity_vector(simulated).tolist(), earth_rate_vector(simulated).tolist()
    found = {"gravity": gravity} if tuple(gravity) != GRAVITY else {}
    if any(rate):
        found["earth_rate"] = rate
    imu = simulated.imu
    found |= _mount_parameters(np.reshape(imu.mounting, (3, 3)), np.asarray(imu.lever_arm))
    return KnownWorld(found, (_CURVED_EARTH,) if simulated.curved_earth else ())


def read_world(
    path: Path, imu_topic: str | None, truth_topic: str | None, with_truth: bool
) -> KnownWorld:
    """Return the world of a file.

    The mount of the IMU is that of the file's own transforms (``/tf_static``, ``sensor.yaml``),
    else that of the realised truth next to a simulated file.

    :param imu_topic: of the readings; None: the only one.
    :param truth_topic: of the truth; None: the only one.
    :param with_truth: whether there is a truth; its frame is the body, else that to which all
        frames are fixed.
    :raises InputError: for several IMUs of different mounts without a topic that names one.
    """
    simulated = simulation_of(path, imu_topic)
    world = KnownWorld({}) if simulated is None else world_of_simulation(simulated)
    found = _recorded_mount(path, imu_topic, truth_topic, with_truth)
    if found.pose is not None:
        world.parameters.update(_mount_parameters(found.pose[:3, :3], found.pose[:3, 3]))
    elif simulated is None and found.unknown:
        world = world._replace(notes=(*world.notes, found.unknown))
    return world


def _mount_parameters(mounting: Array, lever_arm: Array) -> dict[str, list[float]]:
    """Return the parameters of a mount that is not the body's own frame."""
    found = {}
    if lever_arm.any():
        found["imu.lever_arm"] = lever_arm.tolist()
    if (mounting != np.eye(3)).any():
        found["imu.mounting"] = mounting.ravel().tolist()
    return found


class _RecordedMount(NamedTuple):
    """What a recording says about the mount of its IMU."""

    pose: Array | None = None
    """T_bi (4, 4): maps points of the IMU into the truth's body; None: not recorded."""
    unknown: str = ""
    """What is not known, in words; empty if the frames are the same, or have no names."""


def _recorded_mount(
    path: Path, imu_topic: str | None, truth_topic: str | None, with_truth: bool
) -> _RecordedMount:
    """Return the mount of the IMU of a bag (``/tf_static``) or a EuRoC folder (``sensor.yaml``).

    :param with_truth: whether there is a truth; its frame is the body, else that to which all
        frames are fixed.
    """
    if not is_text(path):
        return _of_bag(path, imu_topic, truth_topic, with_truth)
    if not path.is_dir():
        return _RecordedMount()
    of_imu = _of_folder(imu_file(path, imu_topic).parent)
    of_truth = _of_folder(state_file(path).parent) if with_truth else None
    if of_imu is None:
        return _RecordedMount()
    return _RecordedMount(of_imu if of_truth is None else inverse_pose(of_truth) @ of_imu)


def _of_folder(folder: Path) -> Array | None:
    file = folder / "sensor.yaml"
    return read_sensor_yaml(file).pose if is_present(file) else None


def _of_bag(
    path: Path, imu_topic: str | None, truth_topic: str | None, with_truth: bool
) -> _RecordedMount:
    frame = frame_of(path, IMU, imu_topic, 0)
    body = frame_of(path, ODOMETRY, truth_topic, 1) if with_truth else ""
    if frame == body or (with_truth and not (frame and body)):
        return _RecordedMount()
    transforms = fixed_in(path)
    if not with_truth:
        return _RecordedMount(to_root(transforms, frame))
    found = pose_between(transforms, frame, body)
    if found is not None:
        return _RecordedMount(found)
    return _RecordedMount(
        None,
        f"nothing says where {frame} is in {body} ({TF_STATIC_TOPIC}, or the _truth.yaml of "
        "generate): taken to be in its origin with its axes; imu.lever_arm and imu.mounting state "
        "another mount",
    )


def fixed_in(path: Path) -> Transforms:
    """Return the transforms of a bag's ``/tf_static``."""
    transforms: Transforms = {}
    with open_bag(path) as bag:
        names = {t.name for t in bag.topics if t.name == TF_STATIC_TOPIC and t.type == TF_MESSAGE}
        for _, message in decoded_messages(bag, names):
            transforms.update(fixed_transforms(message))
    return transforms


def pose_between(transforms: Transforms, frame: str, body: str) -> Array | None:
    """Return T (4, 4), which maps coordinates in a frame to those in another; None: not known."""
    of_frame, of_body = ancestors(transforms, frame), ancestors(transforms, body)
    for shared, pose in of_frame.items():
        if shared in of_body:
            return inverse_pose(of_body[shared]) @ pose
    return None


def frame_of(path: Path, kind: str, topic: str | None, which: int) -> str:
    """Return a frame of a topic's first message."""
    for fields in decoded_blocks(path, kind, topic, (), warned=bool):
        return str(fields.texts[which])
    return ""
