# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An IMU and its dead reckoning: `ros2 launch imu_sim_ros dead_reckoning.launch.py rviz:=true`.

Takes the arguments of simulate.launch.py as well.
"""

from pathlib import Path

from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

SHARE = Path(__file__).resolve().parents[1]

ARGUMENTS = (
    ("method", "midpoint", "euler, midpoint or rk4"),
    ("attitude_update", "so3", "quaternion, so3 or euler_angles"),
    ("initial_state", "truth", "parameters, truth or level"),
    ("rviz", "false", "show truth, odometry and path in RViz"),
)


def generate_launch_description() -> LaunchDescription:
    """Return simulator and integrator, and RViz where it is wanted."""
    simulate = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(SHARE / "launch" / "simulate.launch.py"))
    )
    parameters = {
        name: ParameterValue(LaunchConfiguration(name), value_type=str)
        for name in ("method", "attitude_update", "initial_state")
    }
    parameters["imu.preset"] = ParameterValue(LaunchConfiguration("imu"), value_type=str)
    integrator = Node(
        package="imu_sim_ros",
        executable="integrator",
        name="integrator",
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            str(SHARE / "config" / "integrator.yaml"),
            parameters,
            {"error": True, "roll_pitch_yaw": True, "path_rate": 5.0},
        ],
        output="screen",
    )
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(SHARE / "config" / "dead_reckoning.rviz")],
        condition=IfCondition(LaunchConfiguration("rviz")),
    )
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, default, text in ARGUMENTS
    ]
    return LaunchDescription([*declared, simulate, integrator, rviz])
