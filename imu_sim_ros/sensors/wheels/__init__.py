# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Wheels of a ground vehicle: encoders, their errors and slip, and odometry from them."""
