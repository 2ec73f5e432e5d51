# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An IMU and its dead reckoning: `ros2 launch imu_sim_ros dead_reckoning.launch.py rviz:=true`.

Takes the arguments of simulate.launch.py as well. Each of several IMUs has an integrator.
"""

from pathlib import Path

from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.nodes import launching
from imu_sim_ros.simulation.playback import SimulatorParameters

CONFIG = Path(__file__).resolve().parents[1] / "config"
BELOW_SIMULATOR = ("-p", "wait_for_subscribers:=1")
BELOW_INTEGRATOR = (
    *("--params-file", str(CONFIG / "integrator.yaml")),
    *("-p", "error:=true", "-p", "roll_pitch_yaw:=true", "-p", "path_rate:=5.0"),
)
OF_SIMULATOR = (
    *("imu", "trajectory", "rate", "seed", "duration", "start_time", "real_time_factor"),
    *("imus", "cameras", "world_frame", "body_frame", "imu_frame"),
)
OF_INTEGRATOR = ("method", "attitude_update", "initial_state")
ARGUMENTS = [
    launching.NAMESPACE,
    *launching.OF_EVERY_NODE,
    *launching.arguments(SimulatorParameters, OF_SIMULATOR),
    *launching.arguments(IntegratorParameters, OF_INTEGRATOR),
    launching.Argument("rviz", "true: show truth, odometry and path in RViz", "false"),
]


def generate_launch_description():
    """Return simulator and integrators, and RViz if it is wanted."""
    return launching.description(ARGUMENTS, _actions)


def _actions(values):
    namespace = values["namespace"].strip("/")
    simulator = launching.required_node(
        "simulator", SimulatorParameters, values, namespace, base_arguments=BELOW_SIMULATOR
    )
    integrators = [
        _integrator(values, "/".join(part for part in (namespace, imu) if part), namespace)
        for imu in launching.names(values["imus"]) or [""]
    ]
    views = []
    if launching.flag(values, "rviz"):
        frame = values["world_frame"]
        views = [launching.rviz(CONFIG / "dead_reckoning.rviz", namespace, frame)]
    return [simulator, *integrators, *views]


def _integrator(values, namespace, namespace_of_truth):
    """Return the integrator of one IMU; the truth of several IMUs is one."""
    truth = f"{namespace_of_truth and '/'}{namespace_of_truth}/ground_truth/odom"
    return launching.required_node(
        "integrator",
        IntegratorParameters,
        values,
        namespace,
        base_arguments=BELOW_INTEGRATOR,
        remappings=[("ground_truth/odom", truth)] if namespace != namespace_of_truth else [],
    )
