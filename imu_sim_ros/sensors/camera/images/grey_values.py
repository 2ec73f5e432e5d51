# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Response of a camera: the grey value of a pixel from its light.

Pictures are rendered in sRGB values c, as a photo shows them: light is about ``(c / 255)^2.2``. A
camera with the response ``srgb`` gives c; one with ``linear`` gives ``255 (c / 255)^2.2``.
"""

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.types import Bytes
from imu_sim_ros.places.light import GAMMA

_STEPS: Final = 64
"""Steps of a linear grey value: integers, so that sums over rays have the same bits everywhere."""


class GreyValues(NamedTuple):
    """Table from rendered values to the grey values of a camera."""

    values: NDArray[np.uint16] | None
    """(256,) grey value of each rendered value, in steps; None: the same."""
    steps: int
    """Steps of one grey value."""

    def of(self, picture: Bytes) -> NDArray[np.uint16] | Bytes:
        """Return the grey values of a picture of any shape, in steps.

        >>> linear = grey_values("linear")
        >>> linear.of(np.array([0, 186, 255], np.uint8)) / linear.steps
        array([  0.   , 127.375, 255.   ])
        """
        return picture if self.values is None else self.values.take(picture)


@cache
def grey_values(response: str) -> GreyValues:
    """Return the grey values of a response, as ``camera.response`` names it."""
    if response == "srgb":
        return GreyValues(None, 1)
    light = [(c / 255.0) ** GAMMA for c in range(256)]
    return GreyValues(np.array([round(_STEPS * 255.0 * v) for v in light], np.uint16), _STEPS)
