# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``python -m imu_sim_ros PROGRAM``: the programs without a script on the PATH."""

import sys

from imu_sim_ros.commands.start import imu_sim

if __name__ == "__main__":
    sys.exit(imu_sim())
