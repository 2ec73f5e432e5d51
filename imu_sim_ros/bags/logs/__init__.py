# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Logs of autopilots and phones, read as bags: a topic for each sensor and estimate."""
