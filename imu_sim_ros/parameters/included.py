# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameter files that come with the package: sensors, trajectories, cameras, scenes, ..."""

import os
from functools import cache
from pathlib import Path
from typing import Final

from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.inputs.rows import is_present
from imu_sim_ros.names import unknown

_KINDS: Final = {
    "imus": "IMU",
    "trajectories": "trajectory",
    "cameras": "camera",
    "scenes": "scene",
    "campaigns": "campaign",
    "estimators": "estimator",
    "barometers": "barometer",
}
"""What a file of each kind describes; those of other sensors are called as these are."""


@cache
def config_folder() -> Path:
    """Return the folder of the package's own parameter files.

    It is ``share/imu_sim_ros/config`` next to the installed package, or ``config`` of a checkout.
    """
    for parent in Path(__file__).resolve().parents:
        for folder in (parent / "share" / "imu_sim_ros" / "config", parent / "config"):
            if (folder / "imus").is_dir():
                return folder
    raise ConfigurationError("the package's config folder is missing: reinstall imu_sim_ros")


def names(kind: str) -> list[str]:
    """Return the names of the files of one kind: ``imus``, ``trajectories``, ``cameras``, ..."""
    folder = config_folder() / kind
    files = os.listdir(folder) if folder.is_dir() else []
    return sorted(name.removesuffix(".yaml") for name in files if name.endswith(".yaml"))


def find(kind: str, name_or_file: str, option: str = "") -> Path:
    """Return the parameter file of a name in config/, or the given file.

    :param kind: a folder in config/, for instance ``imus`` or ``trajectories``.
    :param option: name of the option, for the message; empty if the kind is enough.
    :raises ConfigurationError: if there is neither, with the nearest name or all names.
    """
    named = config_folder() / kind / f"{name_or_file}.yaml"
    if "/" not in name_or_file and named.is_file():
        return named
    try:
        if name_or_file and is_present(name_or_file):
            return Path(name_or_file)
    except InputError as error:
        raise ConfigurationError(error.problems) from None
    known = names(kind)
    line = unknown(
        _KINDS.get(kind, kind), name_or_file, known, f"neither a file nor one of {', '.join(known)}"
    )
    raise ConfigurationError(f"{option}: {line}" if option else line)
