# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configuration files of the programs that read simulated data: kalibr, OpenVINS, VINS, ..."""
