# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""IMUs on the segments of a moving person: the parameters of an IMU on each."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, TypeAlias

from imu_sim_ros.core import arguments
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.names import ros_name
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.parameters import files

Segments: TypeAlias = str | Sequence[str] | Mapping[str, Mapping[str, object]]
"""Names of segments, ``all``, or the parameters of the IMU on each by name."""
ALL: Final = "all"
"""Name that stands for every segment."""


def segment_layer(segments: object, file: object) -> tuple[dict[str, object], dict[str, str]]:
    """Return the parameters of an IMU on each segment, and the segments by the names of the IMUs.

    :param segments: as :data:`Segments`; parameters are those of the IMU, such as ``lever_arm``.
    :param file: file of the trajectory, whose segments are all; None: there is none.
    :raises ConfigurationError: for anything else, no segments, and names that are alike.
    :raises InputError: for a file that cannot be read.
    """
    imu_parameters: Mapping[object, object] = segments if isinstance(segments, Mapping) else {}
    names = arguments.string_list("segments", [*imu_parameters] if imu_parameters else segments)
    if names == (ALL,):
        if not isinstance(file, str) or not file:
            raise ConfigurationError(
                f"{argument_prefix('segments', ALL)}: needs a trajectory file that has segments"
            )
        names = _segments_of(Path(file))
    layer: dict[str, object] = {}
    imus: dict[str, str] = {}
    for name in names:
        imu = ros_name(name)
        if imu in imus:
            raise ConfigurationError(
                f"{argument_prefix('segments')}: {imus[imu]} and {name}: two IMUs named {imu}"
            )
        imus[imu] = name
        layer[f"{imu}.segment"] = name
        if imu_parameters.get(name):
            parameters = files.dotted_values(imu_parameters[name], f"segments.{name}")
            layer |= {f"{imu}.imu.{key}": value for key, value in parameters.items()}
    if not imus:
        raise ConfigurationError(
            f"{argument_prefix('segments')}: none; the file has none, or the list is empty"
        )
    return {"imus": [*imus], **layer}, imus


def _segments_of(path: Path) -> tuple[str, ...]:
    """Return the names of all topics of poses in a file."""
    from imu_sim_ros.formats.door import format_of  # readers of bags, which most flights need not

    return tuple(name.strip("/") for name in format_of(path).pose_topics(path))
