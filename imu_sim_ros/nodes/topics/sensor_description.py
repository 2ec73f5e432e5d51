# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The description of a sensor, published by the source of its readings on a topic beside them.

Next to ``imu/data_raw`` the simulator publishes ``imu/data_raw/parameters``, a std_msgs/String that
is kept for later subscribers (transient local): the rate and every ``imu.*`` of that IMU, as a
ROS 2 parameter file. JSON is YAML: saved in a file it serves ``--params-file`` and ``--imu`` as it
is.
"""

import json
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from imu_sim_ros.config import SimulationParameters, flatten
from imu_sim_ros.conventions import IMU_TOPIC, SENSOR_SUFFIX
from imu_sim_ros.errors import InputError
from imu_sim_ros.json_text import as_json

QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TYPE: Final = "std_msgs/msg/String"
_PARAMETERS: Final = "ros__parameters"


def topic(node: Node, prefix: str = "") -> str:
    """Return the full name of the topic beside a node's readings, wherever these are remapped to.

    :param prefix: namespace of an IMU of several, with its slash.
    """
    return node.resolve_topic_name(prefix + IMU_TOPIC) + SENSOR_SUFFIX


def encode(parameters: SimulationParameters) -> str:
    """Return the text that describes the sensor of a simulation."""
    imu = flatten(parameters.imu)
    return as_json({"/**": {_PARAMETERS: {"rate": parameters.rate, "imu": imu}}})


def decode(text: str) -> dict[str, object]:
    """Return the sensor's parameters by dotted name, ``imu.gyroscope_noise_density`` and so on.

    :raises InputError: for a string of another form; the values are not checked.
    """
    try:
        tree: Any = json.loads(text)
        imu = tree["/**"][_PARAMETERS]["imu"]
        return {f"imu.{name}": value for name, value in imu.items()}
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        raise InputError("a sensor description that is not a parameter file in JSON") from None
