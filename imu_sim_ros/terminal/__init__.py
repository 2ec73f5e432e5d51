# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a terminal shows and takes: tables, JSON, progress, signals, the arguments of a job."""
