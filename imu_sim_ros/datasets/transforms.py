# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Constant transforms between frames, as in a bag's /tf_static."""

import numpy as np

from imu_sim_ros.bags.messages.schemas import Message
from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array

Transforms = dict[str, tuple[str, Array]]
"""Parent frame and T_parent_child (4, 4), by child frame."""


def transforms_of_message(message: Message) -> Transforms:
    """Return the transforms of a message of /tf_static."""
    transforms: Transforms = {}
    for t in message.transforms:
        q, p = t.transform.rotation, t.transform.translation
        matrix = rotation.to_matrix(np.array([[q.w, q.x, q.y, q.z]]))[0]
        pose = rotation.pose_matrix(matrix, (p.x, p.y, p.z))
        transforms[t.child_frame_id] = (t.header.frame_id, pose)
    return transforms


def transform_to_root(transforms: Transforms, frame: str) -> Array | None:
    """Return T (4, 4) from a frame to the root of its fixed frames; None: unknown."""
    return (
        list(transforms_to_ancestors(transforms, frame).values())[-1]
        if frame in transforms
        else None
    )


def transforms_to_ancestors(transforms: Transforms, frame: str) -> dict[str, Array]:
    """Return T (4, 4) from a frame to itself, its parent, the parent's parent, ..."""
    poses = {frame: np.eye(4)}
    while frame in transforms:
        parent, step = transforms[frame]
        if parent in poses:
            break
        poses[parent] = step @ poses[frame]
        frame = parent
    return poses
