# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cameras on the body: models, scenes, feature tracks; frame c: x right, y down, z forward."""

from typing import Final

CAMERAS: Final = (
    "names of the cameras on the body, each the namespace of its topics and the prefix of its "
    "own parameters (cam0.camera.rate, ...); none: no camera"
)
"""What the parameter ``cameras`` is."""
