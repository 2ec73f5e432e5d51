# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records at rest with known noise, in blocks as a bag reader gives them."""

from collections.abc import Iterator

import numpy as np
import pytest

from imu_sim_ros.core.records import Readings


class Rest:
    """Two triads at rest: white noise, and a walk of the accelerometer."""

    def __init__(self, seconds: float = 300.0, rate: float = 100.0, seed: int = 1) -> None:
        n = int(seconds * rate)
        rng = np.random.default_rng(seed)
        self.rate = rate
        self.t_ns = 1_000_000_000 + np.round(np.arange(n) * 1e9 / rate).astype(np.int64)
        self.gyro = 1e-3 * np.sqrt(rate) * rng.standard_normal((n, 3)) + [0.01, 0.0, -0.01]
        walk = np.cumsum(rng.standard_normal((n, 3)), axis=0) * 5e-4 / np.sqrt(rate)
        self.accel = 0.01 * np.sqrt(rate) * rng.standard_normal((n, 3)) + walk + [0.0, 0.0, 9.81]

    def hold_axes(self, *axes: int) -> "Rest":
        """Make axes (0 to 5) constant, which are then not analysed: that takes less time."""
        for axis in axes:
            values = self.gyro if axis < 3 else self.accel
            values[:, axis % 3] = values[0, axis % 3]
        return self

    def blocks(self, size: int = 4000, keep: np.ndarray | None = None) -> Iterator[Readings]:
        rows = np.arange(len(self.t_ns)) if keep is None else np.flatnonzero(keep)
        for start in range(0, len(rows), size):
            part = rows[start : start + size]
            yield Readings(self.t_ns[part], self.gyro[part], self.accel[part])


@pytest.fixture
def rest() -> Rest:
    return Rest()


@pytest.fixture
def two_axes() -> Rest:
    """Return a record of which gyroscope x and accelerometer z alone have noise."""
    return Rest().hold_axes(1, 2, 3, 4)
