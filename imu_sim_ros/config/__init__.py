# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every parameter once: frozen dataclasses, and the files that set them."""
