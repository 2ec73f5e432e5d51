# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What several commands share: their outputs, with the arguments that belong to them."""

from imu_sim_ros.commands.shared.output_arguments import PICTURES, add_force, outputs

__all__ = ["PICTURES", "add_force", "outputs"]
