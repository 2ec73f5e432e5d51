# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Properties of recordings by anybody: the clock behind the stamps."""
