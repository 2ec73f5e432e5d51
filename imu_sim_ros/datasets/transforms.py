# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transforms between frames that are fixed to each other, as a bag has them on /tf_static."""

from typing import Any

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.types import Array

Transforms = dict[str, tuple[str, Array]]
"""By child: its parent, and T_parent_child (4, 4)."""


def fixed_transforms(message: Any) -> Transforms:
    """Return the transforms of a message of /tf_static."""
    found: Transforms = {}
    for t in message.transforms:
        q, p = t.transform.rotation, t.transform.translation
        matrix = rotation.to_matrix(np.array([[q.w, q.x, q.y, q.z]]))[0]
        pose = rotation.pose_matrix(matrix, (p.x, p.y, p.z))
        found[t.child_frame_id] = (t.header.frame_id, pose)
    return found


def to_root(transforms: Transforms, frame: str) -> Array | None:
    """Return T (4, 4) from a frame to the one that everything is fixed to; None: not known."""
    return list(ancestors(transforms, frame).values())[-1] if frame in transforms else None


def ancestors(transforms: Transforms, frame: str) -> dict[str, Array]:
    """Return T (4, 4) from a frame to itself, its parent, the parent's parent, ..."""
    found = {frame: np.eye(4)}
    while frame in transforms:
        parent, step = transforms[frame]
        if parent in found:
            break
        found[parent] = step @ found[frame]
        frame = parent
    return found
