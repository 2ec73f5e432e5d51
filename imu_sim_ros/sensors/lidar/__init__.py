# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""LiDAR: directions and times of its rays, what they meet, errors, and the clouds of drivers."""
