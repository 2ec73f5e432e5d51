# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What ``--list-*`` prints: the files of config/, and the sensors that can be named."""

import re
from itertools import takewhile

from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.sensors import all_sensors


def sensor_lines() -> list[str]:
    """Return the sensors that can be named, a line each; those of other packages too.

    What cannot be loaded has its reason.
    """
    found, problems = all_sensors()
    return [f"{sensor.name}: {sensor.text or 'no description'}" for sensor in found] + problems


def sensor_table() -> str:
    """Return the sensors as text: topics, then parameters with default and unit."""
    found, problems = all_sensors()
    lines = []
    for sensor in found:
        lines.append(f"{sensor.name:12} {sensor.text}")
        lines += [f"{'':12} {topic.name} ({topic.type})" for topic in sensor.topics]
        for name, known in parameters(sensor.section).items():
            unit = f" [{known.unit}]" if known.unit else ""
            words = f"{sensor.name}.{name} ({known.default}{unit}): {known.text}"
            lines.append(f"{'':12} {words}")
    return "\n".join([*lines, *problems]) or "no sensor is installed"


def descriptions(folder: str) -> dict[str, str]:
    """Return the first sentence of each file, in the comment that it begins with, by name.

    :param folder: one of config/: imus, trajectories, cameras, scenes, barometers, gnss, ...
    """
    found = {}
    for name in files.names(folder):
        lines = files.find(folder, name).read_text(encoding="utf-8").splitlines()
        head = takewhile(lambda line: line.startswith("#"), lines)
        words = " ".join(line.removeprefix("# ") for line in head)
        found[name] = re.split(r"\.(?= |$)", words, maxsplit=1)[0]
    return found


def listing(folder: str) -> str:
    """Return the files of a folder of config/ as text, a line each: name and description."""
    found = descriptions(folder)
    width = max(map(len, found))
    return "\n".join(f"{name:{width}}  {text}" for name, text in found.items())
