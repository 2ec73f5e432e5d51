# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters by dotted name, as files have them, in the form of Python's arguments."""

from typing import Any


def nested(values: dict[str, Any]) -> dict[str, Any]:
    """Return the nested form: ``{"gnss": {"rate": 5}}`` for ``{"gnss.rate": 5}``."""
    arguments: dict[str, Any] = {}
    for name, value in values.items():
        *sections, parameter_name = name.split(".")
        section = arguments
        for part in sections:
            section = section.setdefault(part, {})
        section[parameter_name] = value
    return arguments
