# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of recordings that can be noticed: one function each, in one list."""
