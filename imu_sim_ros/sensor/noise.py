"""White noise and bias random walk."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.sensor.streams import axis_generators, draw_normal

Array = NDArray[np.float64]


class WhiteNoise:
    """White noise: ``n_d = sigma / sqrt(dt) w`` (lecture eq. 16)."""

    def __init__(self, seed: int, triad: str, dt: float) -> None:
        self._streams = axis_generators(seed, f"{triad}.white_noise")
        self._dt = dt
        self._sigma = np.zeros((3, 1))

    def configure(self, density: ArrayLike) -> None:
        """Take new densities (3,)."""
        self._sigma = np.reshape(density, (3, 1)) / np.sqrt(self._dt)

    def next_block(self, count: int) -> Array:
        """Return (3, count) noise."""
        if not self._sigma.any():
            return np.zeros((3, count))
        return draw_normal(self._streams, count) * self._sigma


class RandomWalk:
    """Random walk: ``b_k = b_(k-1) + sigma_b sqrt(dt) w`` (lecture eq. 20 and 21), ``b_0 = 0``."""

    def __init__(self, seed: int, triad: str, dt: float) -> None:
        self._streams = axis_generators(seed, f"{triad}.random_walk")
        self._dt = dt
        self._sigma = np.zeros((3, 1))
        self._state = np.zeros(3)

    def configure(self, density: ArrayLike) -> None:
        """Take new densities (3,); the walk goes on from where it is."""
        self._sigma = np.reshape(density, (3, 1)) * np.sqrt(self._dt)

    def next_block(self, count: int) -> Array:
        """Return (3, count) bias."""
        steps = np.empty((3, count + 1))
        steps[:, 0] = self._state
        if self._sigma.any():
            steps[:, 1:] = draw_normal(self._streams, count) * self._sigma
        else:
            steps[:, 1:] = 0.0
        walk: Array = np.cumsum(steps, axis=1)
        self._state = walk[:, -1].copy()
        return walk[:, :-1]
