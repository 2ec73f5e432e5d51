# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the clock of a truth wanders against that of the readings, beside offset and skew."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_WINDOW: Final = 2.0
"""[s] in which an offset is taken."""
_HIGHEST: Final = 5.0
"""[Hz] what counts of the residual: above it there is vibration."""
_STEPS: Final = (3e-5, 1e-4, 3e-4, 1e-3)
"""[s] between neighbouring windows that are tried."""
_GAIN: Final = 3.0
"""In log-likelihood; below it the clock does not wander."""


def wander(
    stamps: Array, residuals: Array, slope: Array, rate: float, *, steady: bool = True
) -> Array:
    """Return what is to be added to the true times (n,) [s]; 0 where the clock is steady.

    In windows the gyroscope's residual is compared with the rate of change of the readings. A
    random walk of the offset is then fitted to these, with the step that is most likely; steady is
    what gains too little by walking.

    :param residuals: (n, 6) reading minus model.
    :param slope: (n, 6) derivative of the model in time.
    :param steady: whether the clock may be found steady; false: the course in any case.
    """
    from scipy.fft import dct

    size = round(_WINDOW * rate)
    count = len(stamps) // (size // 2) - 1
    highest = int(2.0 * _WINDOW * _HIGHEST)
    if count < 4 or highest < 4:
        return np.zeros(len(stamps))
    centre, offset, sigma = np.zeros((3, count))
    for k in range(count):
        rows = slice(k * (size // 2), k * (size // 2) + size)
        y = dct(residuals[rows, :3], norm="ortho", axis=0)[1:highest]
        x = dct(slope[rows, :3], norm="ortho", axis=0)[1:highest]
        power = np.mean(y**2, axis=0) + 1e-30
        for _ in range(3):
            weight = max(float(np.sum(x**2 / power)), 1e-30)
            offset[k] = np.sum(x * y / power) / weight
            power = np.mean((y - x * offset[k]) ** 2, axis=0) + 1e-30
        centre[k] = stamps[rows].mean()
        sigma[k] = np.sqrt(2.0 / weight)  # half of a window is the next one's
    still = _walk(offset, sigma, 0.0)
    best = max((_walk(offset, sigma, step) for step in _STEPS), key=lambda found: found[0])
    if steady and best[0] < still[0] + _GAIN:
        return np.zeros(len(stamps))
    result: Array = np.interp(stamps, centre, best[1])
    return result


def _walk(offset: Array, sigma: Array, step: float) -> tuple[float, Array]:
    """Return the log-likelihood of a walk of unknown start, and its most likely course (m,)."""
    index = np.arange(len(offset))
    covariance = step**2 * np.minimum.outer(index, index)
    total = covariance + np.diag(sigma**2)
    inverse = np.linalg.inv(total)
    information = float(inverse.sum())
    start = float(inverse.sum(axis=0) @ offset) / information
    rest = offset - start
    course = start + covariance @ inverse @ rest
    log = -0.5 * (np.linalg.slogdet(total)[1] + rest @ inverse @ rest + np.log(information))
    return float(log), course
