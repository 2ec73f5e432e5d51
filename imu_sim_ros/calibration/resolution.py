# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The digital step of each axis, and what rounding to it does to the noise.

Rounding to steps s of noise with the deviation sigma adds ``s^2 / 12`` as white noise, for as long
as the noise spans a step. The first term of rounding's Fourier series, which depends on where
between two codes the mean lies, leaves ``(1 / pi^2 + 4 sigma^2 / s^2) exp(-2 pi^2 sigma^2 / s^2)``
of s^2 open (Widrow, Kollar and Liu, "Statistical theory of quantization", IEEE Transactions on
Instrumentation and Measurement 45, 1996). Below half a step nothing can be determined: between two
codes the readings show s / 2, on a code they show nothing.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

COARSE: Final = 0.55
"""Deviation of the readings, in steps, below which the noise is not their own. At 0.55 the noise is
between 0.45 and 0.48 steps, wherever the mean lies."""
HIDDEN: Final = 0.58
"""Deviation, in steps, that noise with its rounding may have where the readings are coarse."""
_LOOKED_AT: Final = 4096
_MOST_CODES: Final = 256


class StepFinder:
    """Finds the step of each axis from the few distinct values that its readings take."""

    def __init__(self, axes: int) -> None:
        self.step = np.zeros(axes)
        """(axes,) the step; 0 where the readings are not in steps, or only one code was seen."""
        self._open = np.ones(axes, dtype=bool)
        self._codes: list[Array] = [np.empty(0)] * axes

    def look(self, columns: Array) -> None:
        """Take the next readings (axes, n)."""
        for k in np.flatnonzero(self._open):
            codes = np.union1d(self._codes[k], columns[k, :_LOOKED_AT])
            if len(codes) > _MOST_CODES:
                self.step[k], self._open[k] = 0.0, False
                continue
            self._codes[k] = codes
            if len(codes) > 1:
                self.step[k] = float(np.min(np.diff(codes)))
                self._open[k] = len(codes) < 8  # then a neighbouring pair has been seen


def doubt(deviation: float, step: float) -> float:
    """Return the relative uncertainty of the readings' variance that rounding leaves.

    :param deviation: of the readings, rounding included.
    :param step: 0: no rounding.
    """
    if step == 0.0:
        return 0.0
    x = max((deviation / step) ** 2 - 1.0 / 12.0, 0.0)
    share = (1.0 / np.pi**2 + 4.0 * x) * np.exp(-2.0 * np.pi**2 * x)
    return float(share / max(x + 1.0 / 12.0, 1e-12))
