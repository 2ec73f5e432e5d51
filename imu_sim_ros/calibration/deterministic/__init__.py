# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scale, misalignment and bias, from positions, turntable, temperature and ellipsoid."""
