# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An IMU on a moving body: `ros2 launch imu_sim_ros simulate.launch.py imu:=lecture`."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

ARGUMENTS = (
    ("imu", "lecture", "sensor: a name in config/imus, or a parameter file"),
    ("trajectory", "lecture", "motion: a name in config/trajectories, or a kind of trajectory"),
    ("rate", "200.0", "samples per second [Hz]"),
    ("seed", "0", "seed of all random streams"),
    ("duration", "0.0", "length of the run [s]; 0: endless, or the trajectory's own length"),
    ("namespace", "", "namespace of the node and its topics"),
)


def generate_launch_description() -> LaunchDescription:
    """Return the simulator with its arguments."""
    parameters = {
        "imu.preset": ParameterValue(LaunchConfiguration("imu"), value_type=str),
        "trajectory.type": ParameterValue(LaunchConfiguration("trajectory"), value_type=str),
        "rate": ParameterValue(LaunchConfiguration("rate"), value_type=float),
        "seed": ParameterValue(LaunchConfiguration("seed"), value_type=int),
        "duration": ParameterValue(LaunchConfiguration("duration"), value_type=float),
    }
    simulator = Node(
        package="imu_sim_ros",
        executable="simulator",
        name="simulator",
        namespace=LaunchConfiguration("namespace"),
        parameters=[parameters],
        output="screen",
    )
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, default, text in ARGUMENTS
    ]
    return LaunchDescription([*declared, simulator])
