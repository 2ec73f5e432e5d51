# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transforms for tf: the moving body in the world, and frames that are fixed to the body."""

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile

from imu_sim_ros.bags.messages.transforms import TransformsEncoder
from imu_sim_ros.core import timebase
from imu_sim_ros.core.conventions import TF_STATIC_TOPIC
from imu_sim_ros.core.types import Array, Integers
from imu_sim_ros.nodes.publishing import create
from imu_sim_ros.nodes.simulator.publish_queue import TickStream
from imu_sim_ros.simulation.parameters import SimulationParameters
from imu_sim_ros.trajectory.motion import Trajectory

QOS: Final = QoSProfile(depth=100)
STATIC_QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def publish_mounts(
    node: Node, mounts: Mapping[tuple[str, str], Array], t_ns: int
) -> Publisher | None:
    """Publish the fixed transforms once, latched, and return the publisher.

    :param mounts: poses T_bf (4, 4), which map coordinates in a frame to its body, by the names of
        body and frame.
    :param t_ns: the stamp [ns]; tf takes a static transform at all times.
    :returns: None if there is nothing to publish.
    """
    if not mounts:
        return None
    encoder = TransformsEncoder([*mounts])
    rows = encoder.encode_fixed(np.array([t_ns]), np.stack([*mounts.values()]))
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
