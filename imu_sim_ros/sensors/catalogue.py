# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Output of ``--list-*``: the files of config/, and the sensors that can be named."""

import re
from itertools import takewhile

from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.sensors import all_sensors


def sensor_lines() -> list[str]:
    """Return the sensors that can be named, a line each; those of other packages too.

    What cannot be loaded has its reason.
    """
    sensors, problems = all_sensors()
    return [f"{sensor.name}: {sensor.text or 'no description'}" for sensor in sensors] + problems


def sensor_table() -> str:
    """Return the sensors as text: topics, then parameters with default and unit."""
    sensors, problems = all_sensors()
    lines = []
    for sensor in sensors:
        lines.append(f"{sensor.name:12} {sensor.text}")
        lines += [f"{'':12} {topic.name} ({topic.type})" for topic in sensor.topics]
        for name, parameter in parameters(sensor.section).items():
            unit = f" [{parameter.unit}]" if parameter.unit else ""
            line = f"{sensor.name}.{name} ({parameter.default}{unit}): {parameter.text}"
            lines.append(f"{'':12} {line}")
    return "\n".join([*lines, *problems]) or "no sensor is installed"


def descriptions(folder: str) -> dict[str, str]:
    """Return the first sentence of each file, in the comment that it begins with, by name.

    :param folder: one of config/: imus, trajectories, cameras, scenes, barometers, gnss, ...
    """
    texts = {}
    for name in files.names(folder):
        lines = files.find(folder, name).read_text(encoding="utf-8").splitlines()
        head = takewhile(lambda line: line.startswith("#"), lines)
        header = " ".join(line.removeprefix("# ") for line in head)
        texts[name] = re.split(r"\.(?= |$)", header, maxsplit=1)[0]
    return texts


def list_folder(folder: str) -> str:
    """Return the files of a folder of config/ as text, a line each: name and description."""
    texts = descriptions(folder)
    width = max(map(len, texts))
    return "\n".join(f"{name:{width}}  {text}" for name, text in texts.items())
