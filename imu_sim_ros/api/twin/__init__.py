# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The digital twin: a recording and a true trajectory in, a sensor on its vehicle out.

Here the mathematics of ``calibration.twin`` meets splines and the simulation.
"""

from imu_sim_ros.api.twin.check import Check
from imu_sim_ros.api.twin.result import Twin, labels, twin

__all__ = ["Check", "Twin", "labels", "twin"]
