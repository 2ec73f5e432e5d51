# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rate and stamp grid of a sensor beside the IMU."""

from collections.abc import Iterator
from dataclasses import dataclass

from imu_sim_ros.parameters.kinds import number
from imu_sim_ros.timebase import LOWEST_RATE

LARGEST_RATE = 20000.0


@dataclass(frozen=True)
class OwnRateParameters:
    """Rate and stamp grid of a sensor beside the IMU."""

    rate: float = number(
        100.0,
        "samples per second of this sensor, on a grid of its own",
        unit="Hz",
        minimum=LOWEST_RATE,
        maximum=LARGEST_RATE,
    )
    time_offset: float = number(
        0.0,
        "time from the IMU's first sample to this sensor's first; below 1 / rate",
        unit="s",
        minimum=0.0,
        maximum=1e6,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Say whether the first sample comes too late."""
        if self.time_offset * self.rate >= 1.0:
            yield (
                f"{prefix}time_offset = {self.time_offset:g}: must be below 1 / {prefix}rate, "
                f"{1.0 / self.rate:g} s"
            )
