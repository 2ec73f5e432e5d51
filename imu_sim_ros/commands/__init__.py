# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments and printing; one file per program."""

from imu_sim_ros.commands import common

__all__ = ["common"]
