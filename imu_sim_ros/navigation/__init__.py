# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is made of readings: dead reckoning, preintegration, and their comparison with the truth."""
