# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs: files that are opened, rows, and the gate of readings and poses."""
