# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectory and sensors joined: parameters, the engine, the topics of a simulation."""
