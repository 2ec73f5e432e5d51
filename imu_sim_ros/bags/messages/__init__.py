# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What messages look like as bytes: layouts, definitions, encoding and decoding of whole blocks."""
