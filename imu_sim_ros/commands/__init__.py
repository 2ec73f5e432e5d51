# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments and printing; one module a program. A program imports what it needs when it runs."""
