# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters: declared once (unit, range, text), layered from files, checked and listed."""
