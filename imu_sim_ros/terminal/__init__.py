# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Terminal of the programs: tables, JSON, progress, signals, and the arguments of a job."""
