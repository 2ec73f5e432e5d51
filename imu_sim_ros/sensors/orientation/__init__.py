# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The orientation that an IMU states: parameters, model and filter."""
