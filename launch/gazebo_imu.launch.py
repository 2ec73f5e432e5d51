# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gazebo's IMU with a real one's errors: `ros2 launch imu_sim_ros gazebo_imu.launch.py`.

Bridges a topic of Gazebo (gz.msgs.IMU, without noise of its own) and adds the errors. Gazebo itself
runs at the same time: `gz sim -r imu_world.sdf`, the world of the examples.
"""

from imu_sim_ros.nodes import launching
from imu_sim_ros.simulation.error_parameters import ErrorNodeParameters

PARAMETERS = ("imu", "rate", "seed", "imu_frame")
ARGUMENTS = [
    launching.NAMESPACE,
    *launching.OF_EVERY_NODE,
    *launching.arguments(ErrorNodeParameters, PARAMETERS),
    launching.Argument("topic", "Gazebo's topic of ideal readings", "/imu"),
]


def generate_launch_description():
    """Return bridge and error model; the launch ends with the error model."""
    return launching.description(ARGUMENTS, _actions)


def _actions(values):
    from launch_ros.actions import Node

    topic, namespace = values["topic"], values["namespace"]
    bridge = Node(
        package="ros_gz_bridge",
        executable="parameter_bridge",
        namespace=namespace,
        arguments=[f"{topic}@sensor_msgs/msg/Imu[gz.msgs.IMU"],
        remappings=[(topic, "imu/ideal")],
        output="screen",
    )
    errors = launching.required_node("error_model", ErrorNodeParameters, values, namespace)
    return [bridge, errors]
