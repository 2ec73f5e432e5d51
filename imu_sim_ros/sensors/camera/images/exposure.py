# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Automatic exposure: a slow meter that brings an image's mean to a grey value, within limits.

At instants ``t_j = j T`` the meter reads the mean m of an image of about 48 columns and wants the
factor ``g = clip(target / m, 1 / limit, limit)``. What it sets follows with a lag: the mean of the
logarithms of the last factors, with weights that fall by e in each lag. A reading acts fully from
the next instant on, and between two instants the logarithm changes evenly. A factor follows from
its time alone, whatever images were made before.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np

from imu_sim_ros.core.types import Array, Bytes, Single
from imu_sim_ros.sensors.camera.images.grey_values import grey_values
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.view import View

_INTERVAL: Final = 0.1
"""Interval of the meter's readings [s]."""
_COLUMNS: Final = 48
"""Number of columns of pixels from which the exposure is computed."""
_MEMORY: Final = 5.0
"""Number of lags after which a reading is left out: its weight is below 1 %."""
_WHITE: Final = np.float32(235.0)
"""Grey value above which a surface may be brighter than white."""
_FULL: Final = np.float32(255.0)


class AutoExposure:
    """The factor that one camera's automatic exposure applies to grey values, over time."""

    def __init__(self, view: View, meter: Callable[[Array], Iterator[Bytes]]) -> None:
        """Initialise for a camera.

        :param meter: returns the picture of :func:`meter_model`, in parts, at a time (1,) [s].
        """
        self._view, self._meter = view, meter
        self._wanted: dict[int, float] = {}

    def factor(self, seconds: float) -> float:
        """Return the factor at a time after the start [s]."""
        whole = math.floor(seconds / _INTERVAL)
        part = seconds / _INTERVAL - whole
        value = (1.0 - part) * self._set(whole - 1) + part * self._set(whole)
        return round(math.exp(value), 6)  # the last bits of an exponential decide nothing

    def _set(self, number: int) -> float:
        """Return the logarithm of the factor that follows from the readings up to a number."""
        weights = self._weights
        return sum(w * self._logarithm(number - k) for k, w in enumerate(weights))

    @cached_property
    def _weights(self) -> list[float]:
        """Weights of past metered brightnesses: an exponential lag."""
        lag = self._view.parameters.auto_exposure_lag
        if lag == 0.0:
            return [1.0]
        count = max(1, math.ceil(_MEMORY * lag / _INTERVAL))
        weights = [math.exp(-k * _INTERVAL / lag) for k in range(count)]
        return [weight / sum(weights) for weight in weights]

    def _logarithm(self, number: int) -> float:
        """Return the logarithm of the factor that the meter wants at an instant."""
        number = max(number, 0)  # before the start the image is that of the start
        if number not in self._wanted:
            p = self._view.parameters
            factor = p.auto_exposure / max(self._mean(number * _INTERVAL), 1e-3)
            limit = p.auto_exposure_limit
            self._wanted[number] = math.log(min(max(factor, 1.0 / limit), limit))
        return self._wanted[number]

    def _mean(self, seconds: float) -> float:
        """Return the mean grey value of the meter's image: a ratio of integers."""
        view, total, count = self._view, 0, 0
        response = grey_values(view.parameters.response)
        t = np.array([min(seconds, view.duration)])
        for picture in self._meter(t):
            total += int(response.of(picture).sum(dtype=np.int64))
            count += picture.size
        return total / (count * response.steps)


def meter_model(p: CameraParameters) -> CameraModel:
    """Return a camera with larger pixels, about 48 columns."""
    size = max(1, round(p.width / _COLUMNS))
    fx, fy, cx, cy = p.intrinsics
    # Its first pixel's centre is that of the first size x size pixels.
    x, y = ((c - 0.5 * (size - 1)) / size for c in (cx, cy))
    small = replace(
        p,
        width=max(1, p.width // size),
        height=max(1, p.height // size),
        intrinsics=(fx / size, fy / size, x, y),
    )
    return CameraModel(small)


def expose(level: Single, factor: float) -> Single:
    """Return grey values (...) times a factor.

    White pixels may be any number of times as bright, and stay white in a darker image:
    windows stay saturated.

    >>> expose(np.array([100, 235, 255], np.float32), 0.5)
    array([ 50. , 117.5, 255. ], dtype=float32)
    """
    result = level * np.float32(factor)
    if factor < 1.0:
        beyond = np.clip((level - _WHITE) / (_FULL - _WHITE), 0.0, 1.0)
        result += beyond * np.float32(1.0 - factor) * _FULL
    return result
