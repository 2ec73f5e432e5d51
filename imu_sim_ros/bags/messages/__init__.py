# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes: definitions, layouts, encoders and decoders."""
