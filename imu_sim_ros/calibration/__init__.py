# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimation of parameters from readings: noise (Allan), deterministic errors, the twin."""
