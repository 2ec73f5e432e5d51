# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cameras on the body: models, scenes, feature tracks; frame c: x right, y down, z forward."""
