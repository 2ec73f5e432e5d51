# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimation of a path from readings: dead reckoning, preintegration, covariance, evaluation."""
