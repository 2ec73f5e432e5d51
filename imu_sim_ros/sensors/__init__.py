# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the body carries: one folder a sensor, and what all of them share."""
