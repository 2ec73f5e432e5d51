# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transforms for tf: the moving body in the world, and frames that are fixed to the body."""

from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple

import numpy as np
from rclpy.qos import DurabilityPolicy, QoSProfile

from imu_sim_ros import rotation, timebase
from imu_sim_ros.bags.messages.transforms import TransformsEncoder
from imu_sim_ros.conventions import TF_STATIC_TOPIC
from imu_sim_ros.nodes.publishing import create
from imu_sim_ros.nodes.simulator.publish_queue import TickStream
from imu_sim_ros.simulation.parameters import SimulationParameters
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.types import Array, Integers

QOS: Final = QoSProfile(depth=100)
STATIC_QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Mount(NamedTuple):
    """A frame that is fixed to the body."""

    frame: str
    pose: Array
    """(4, 4) T_bf: maps coordinates in the frame to the body."""


def publish_mounts(node: Any, body_frame: str, mounts: Iterable[Mount], t_ns: int) -> Any:
    """Publish the fixed transforms once, latched, and return the publisher.

    What coincides with the body's own frame needs no transform.

    :param t_ns: the stamp [ns]; tf takes a static transform at all times.
    :returns: None if there is nothing to publish.
    """
    elsewhere = [mount for mount in mounts if mount.frame != body_frame]
    if not elsewhere:
        return None
    poses = np.stack([mount.pose for mount in elsewhere])
    encoder = TransformsEncoder([(body_frame, mount.frame) for mount in elsewhere])
    q = rotation.from_matrix(poses[:, :3, :3])
    rows = encoder.encode(np.array([t_ns]), poses[None, :, :3, 3], q[None])
    publisher = create(node, encoder.type_name, TF_STATIC_TOPIC, STATIC_QOS)
    publisher.publish(rows[0].tobytes())
    return publisher


def transform_stream(
    rate: float,
    parameters: SimulationParameters,
    trajectory: Trajectory,
    send: Callable[[bytes], None],
) -> TickStream:
    """Return the stream of transforms from the world to the body."""
    encoder = TransformsEncoder([(parameters.world_frame, parameters.body_frame)])

    def make(t_ns: Integers, t0_ns: int) -> list[bytes]:
        motion = trajectory.sample(timebase.seconds_since(t_ns, t0_ns))
        rows = encoder.encode(t_ns, motion.position[:, None], motion.q_wb[:, None])
        return [row.tobytes() for row in rows]

    return TickStream(rate, make, send)
