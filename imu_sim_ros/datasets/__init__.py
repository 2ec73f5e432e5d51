# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Datasets in files: EuRoC, TUM VI, tracks, and the configuration of each consumer."""
