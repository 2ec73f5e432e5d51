# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics into a bag: `ros2 launch imu_sim_ros record.launch.py output:=flight duration:=20.0`."""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription

ARGUMENTS = (
    ("output", "", "bag: a folder, NAME.mcap or NAME.bag; empty: named after the time"),
    ("topics", "", "names, separated by blanks; empty: all topics"),
    ("storage", "auto", "auto, mcap, sqlite3 or ros1"),
    ("compression", "none", "none, lz4, zstd or bz2"),
    ("duration", "0.0", "end after this time since the first message [s]; 0: never"),
    ("max_size", "0.0", "end when this much is written [MB]; 0: never"),
)


def generate_launch_description() -> LaunchDescription:
    """Return the recorder with its arguments."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, default, text in ARGUMENTS
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=_recorder)])


def _recorder(context):
    """Return the node; an empty list of topics has no form as a parameter, so it is left out."""
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    parameters = {name: value[name] for name in ("output", "storage", "compression")}
    parameters |= {name: float(value[name]) for name in ("duration", "max_size")}
    if value["topics"].split():
        parameters["topics"] = value["topics"].split()
    recorder = Node(
        package="imu_sim_ros",
        executable="recorder",
        name="recorder",
        parameters=[parameters],
        output="screen",
    )
    return [recorder]
