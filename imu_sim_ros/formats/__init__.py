# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Formats that are read: each recognises a path by its content and returns Readings or States."""
