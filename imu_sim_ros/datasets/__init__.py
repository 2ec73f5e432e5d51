# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is written and read as files: EuRoC, TUM VI, tracks, and each consumer's configuration."""
