# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tags of AprilTag's family 36h11 (E. Olson, ICRA 2011), as kalibr's AprilGrid has them."""

from typing import Final

import numpy as np

from imu_sim_ros.core.errors import MissingDependencyError
from imu_sim_ros.core.types import Bytes
from imu_sim_ros.sensors.camera.images.libraries import opencv

_UPRIGHT: Final = 2
"""Rotation, in quarter turns, of OpenCV's tags that gives those of kalibr."""


def tag(number: int) -> Bytes:
    """Return the 10 x 10 cells of a tag with its two-cell black border: 255 white, 0 black.

    :raises MissingDependencyError: without OpenCV, and for an OpenCV without its tags.
    """
    try:
        aruco = opencv().aruco
    except AttributeError:
        raise MissingDependencyError(
            "AprilGrids need the tags of OpenCV (cv2.aruco): apt install python3-opencv, or pip "
            "install 'opencv-python-headless>=4.7'"
        ) from None
    codes = aruco.getPredefinedDictionary(aruco.DICT_APRILTAG_36h11).bytesList  # (587, 5, 4)
    bits = np.unpackbits(codes[number].reshape(4, 5)[_UPRIGHT])
    cells = np.zeros((10, 10), np.uint8)
    cells[2:8, 2:8] = 255 * np.concatenate([bits[:32], bits[-4:]]).reshape(6, 6)
    return cells
