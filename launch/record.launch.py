# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics into a bag: `ros2 launch imu_sim_ros record.launch.py output:=flight duration:=20.0`."""

from imu_sim_ros.bags.recorder_parameters import RecorderParameters
from imu_sim_ros.nodes import launching

PARAMETERS = ("output", "topics", "storage", "compression", "duration", "max_size")
ARGUMENTS = [
    launching.NAMESPACE,
    *launching.OF_EVERY_NODE,
    *launching.arguments(RecorderParameters, PARAMETERS),
]


def generate_launch_description():
    """Return the recorder with its arguments; the launch ends with it."""
    return launching.description(ARGUMENTS, _actions)


def _actions(values):
    namespace = values["namespace"]
    return [launching.required_node("recorder", RecorderParameters, values, namespace)]
