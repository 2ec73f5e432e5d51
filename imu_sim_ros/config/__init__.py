# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The places from which trajectories of other packages import; the names live elsewhere."""
