# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``twin``: a sensor on its vehicle, from a recording in motion with a true trajectory."""

from imu_sim_ros.commands.twin.program import main, parser

__all__ = ["main", "parser"]
