# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vignetting: the share of light that each pixel gets."""

import numpy as np

from imu_sim_ros.core.types import Array, Single
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.parameters import CameraParameters


def vignette(p: CameraParameters) -> Single:
    """Return the share of the light that each pixel gets (h, w), 1 without vignetting."""
    factors = shares(p, 0)
    return np.ones((p.height, p.width), np.float32) if factors is None else factors


def shares(p: CameraParameters, dimensions: int) -> Single | None:
    """Return ``1 - v (r / r_corner)^2`` (h, w) with r from the principal point; None: all 1.

    :param dimensions: number of further dimensions, of length 1, for colours.
    """
    model = CameraModel(p)
    if p.vignetting == 0.0:
        return None
    u, v = np.meshgrid(np.arange(p.width) - model.cx, np.arange(p.height) - model.cy)
    square = u * u + v * v
    factor: Array = 1.0 - p.vignetting * square / square.max()
    result: Single = factor.astype(np.float32).reshape(*square.shape, *(1,) * dimensions)
    return result
