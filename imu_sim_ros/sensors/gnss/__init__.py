# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A GNSS receiver: fixes and velocities, their errors, outages and modes; NMEA."""
