# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records, rotations, times, names and errors: what every other room is written with."""
