# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An IMU on a moving body: `ros2 launch imu_sim_ros simulate.launch.py imu:=lecture`."""

from imu_sim_ros.nodes import launching
from imu_sim_ros.simulation.playback import SimulatorParameters

PARAMETERS = (
    *("imu", "trajectory", "rate", "seed", "duration", "start_time", "real_time_factor"),
    *("imus", "cameras", "world_frame", "body_frame", "imu_frame", "wait_for_subscribers"),
)
ARGUMENTS = [
    launching.NAMESPACE,
    *launching.OF_EVERY_NODE,
    *launching.arguments(SimulatorParameters, PARAMETERS),
]


def generate_launch_description():
    """Return the simulator with its arguments; the launch ends with it."""
    return launching.description(ARGUMENTS, _actions)


def _actions(values):
    namespace = values["namespace"]
    return [launching.required_node("simulator", SimulatorParameters, values, namespace)]
