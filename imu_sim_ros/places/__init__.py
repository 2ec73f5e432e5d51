# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Places of rectangles with materials and light, independent of cameras."""
