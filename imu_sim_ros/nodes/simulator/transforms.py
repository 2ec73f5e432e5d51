# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The body's pose as a transform, where tf2_ros is installed."""

from typing import Any

import numpy as np
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from numpy.typing import NDArray
from rclpy.time import Time

from imu_sim_ros import timebase
from imu_sim_ros.config import SimulationParameters
from imu_sim_ros.errors import MissingDependencyError
from imu_sim_ros.nodes.simulator.publish_queue import TickStream
from imu_sim_ros.trajectory import Trajectory


def transform_stream(
    node: Any, rate: float, parameters: SimulationParameters, trajectory: Trajectory
) -> TickStream:
    """Return the stream of transforms from the world to the body.

    :raises MissingDependencyError: where tf2_ros is not installed.
    """
    try:
        from tf2_ros import TransformBroadcaster
    except ImportError:
        raise MissingDependencyError(
            f"publish.tf_rate = {rate:g}: needs tf2_ros, which is not installed here "
            "(apt install ros-jazzy-tf2-ros; it is not on PyPI)"
        ) from None
    return TickStream(
        rate,
        lambda t_ns, t0_ns: transforms(t_ns, t0_ns, parameters, trajectory),
        TransformBroadcaster(node).sendTransform,
    )


def transforms(
    t_ns: NDArray[np.int64],
    t0_ns: int,
    parameters: SimulationParameters,
    trajectory: Trajectory,
) -> list[TransformStamped]:
    """Return the transforms from the world to the body at times (n,)."""
    motion = trajectory.sample(timebase.seconds_since(t_ns, t0_ns))
    result = []
    for stamp, position, q in zip(
        t_ns.tolist(), motion.position.tolist(), motion.q_wb.tolist(), strict=True
    ):
        message = TransformStamped(child_frame_id=parameters.body_frame)
        message.header.frame_id = parameters.world_frame
        message.header.stamp = Time(nanoseconds=stamp).to_msg()
        message.transform.translation = Vector3(x=position[0], y=position[1], z=position[2])
        message.transform.rotation = Quaternion(w=q[0], x=q[1], y=q[2], z=q[3])
        result.append(message)
    return result
