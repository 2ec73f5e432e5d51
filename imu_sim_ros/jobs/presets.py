# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The presets that come with the package."""

from typing import Final

from imu_sim_ros.core import arguments
from imu_sim_ros.core.arguments import suggest_keywords
from imu_sim_ros.sensors import find_sensor, switchable_sensors
from imu_sim_ros.sensors.catalogue import descriptions

_FOLDERS: Final = {
    "imu": "imus",
    "trajectory": "trajectories",
    "camera": "cameras",
    "scene": "scenes",
    "barometer": "barometers",
    "campaign": "campaigns",
    "estimator": "estimators",
}
"""Folders of config/ by the argument that takes a name from it."""


@suggest_keywords
def presets(kind: str = "imu") -> dict[str, str]:
    """Return the presets of one kind with their descriptions.

    :param kind: imu, trajectory, camera, scene, barometer, campaign, estimator, or the name of a
        sensor with presets, such as gnss.
    :returns: descriptions by the names of the presets.
    :raises ConfigurationError: for another kind.

    >>> import imu_sim_ros as ims
    >>> ims.presets()["perfect"]
    'Perfect, no price: An IMU without errors: its readings are the ideal ones'
    >>> "figure_eight" in ims.presets("trajectory")
    True
    """
    sensors = {name: find_sensor(name).presets for name in switchable_sensors()}
    folders = _FOLDERS | {name: folder for name, folder in sensors.items() if folder}
    return descriptions(folders[arguments.choice("kind", kind, folders)])
