# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the temperature around the IMU over time."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from imu_sim_ros.config.parameter import choice, number, numbers

ABSOLUTE_ZERO = -273.15


@dataclass(frozen=True)
class TemperatureParameters:
    """Ambient temperature over time, and how the sensor follows it."""

    value: float = number(
        25.0, "ambient temperature at the start", unit="degC", minimum=ABSOLUTE_ZERO
    )
    profile: tuple[float, ...] = numbers(
        (),
        "time [s] and ambient temperature [degC] alternating, times increasing; the last "
        "one is held",
        unit="s, degC",
        minimum=ABSOLUTE_ZERO,
        group=2,
    )
    interpolation: str = choice(
        "linear",
        ("linear", "steps"),
        "linear: ramps between the entries of the profile; steps: jumps (soak) at their times",
    )
    time_constant: float = number(
        0.0,
        "thermal lag: the sensor follows the ambient temperature with this time constant",
        unit="s",
        minimum=0.0,
    )

    power: float = number(
        0.0,
        "power that the board dissipates from the start on: it warms itself",
        unit="W",
        minimum=0.0,
        maximum=1000.0,
    )
    thermal_resistance: tuple[float, ...] = numbers(
        (60.0, 30.0),
        "thermal resistances of package and board: each warms up by power times resistance",
        unit="K/W",
        minimum=0.0,
        group=2,
    )
    warm_up_time: tuple[float, ...] = numbers(
        (20.0, 300.0),
        "time constants of the warm-up of package and board",
        unit="s",
        minimum=0.0,
        group=2,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Say whether the profile and the warm-up can be used."""
        for name in ("thermal_resistance", "warm_up_time"):
            if len(getattr(self, name)) != 2:
                yield f"{prefix}{name}: must be two numbers, of the package and of the board"
        times = self.profile[::2]
        if times and times[0] < 0.0:
            yield f"{prefix}profile: time {times[0]:g} s: must be at least 0"
        for before, after in pairwise(times):
            if after <= before:
                yield (f"{prefix}profile: time {after:g} s after {before:g} s: times must increase")
