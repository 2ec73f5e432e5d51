# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the barometer of an IMU: ``imu.barometer_...``.

Errors that gyroscopes and accelerometers have as well have the same names.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from imu_sim_ros.parameters.kinds import flag, number, text
from imu_sim_ros.sensors.imu.triads import triad_field
from imu_sim_ros.sensors.parameters import OwnRateParameters

_TEXTS: Final = {"triad": "barometer", "unit": "Pa", "change": "Pa/s"}


def _single_axis_field(name: str, **changes: object) -> Any:
    """Return a parameter of triads for a single axis."""
    return triad_field(name, _TEXTS, **{"kind": "number", "default": 0.0, **changes})


@dataclass(frozen=True)
class BarometerParameters(OwnRateParameters):
    """One barometer; every error is off at zero."""

    preset: str = text("", "file in config/barometers, or a path, to start from; empty: none")
    noise_density: float = _single_axis_field("noise_density")
    random_walk: float = _single_axis_field("random_walk")
    gauss_markov_sigma: float = _single_axis_field(
        "gauss_markov_sigma",
        text="stationary standard deviation of a first-order Gauss-Markov drift (weather)",
    )
    correlation_time: float = _single_axis_field("correlation_time")
    bias_instability: float = _single_axis_field("bias_instability")
    bias: float = _single_axis_field("bias")
    turn_on_bias_sigma: float = _single_axis_field(
        "turn_on_bias_sigma",
        text="standard deviation of the offset from unit to unit, drawn from the seed",
    )
    temperature_bias: tuple[float, ...] = _single_axis_field(
        "temperature_bias",
        kind="numbers",
        default=(),
        group=1,
        text="bias polynomial: entry k is the coefficient of (T - T0)^(k+1)",
    )
    temperature_bias_sigma: float = _single_axis_field("temperature_bias_sigma")
    gust_rate: float = number(
        0.0,
        "mean rate of pressure steps at the port, caused by wind, doors or fans",
        unit="1/s",
        minimum=0.0,
        maximum=1000.0,
    )
    gust_sigma: float = number(
        0.0,
        "standard deviation of the pressure after each step; it is held until the next",
        unit="Pa",
        minimum=0.0,
    )
    minimum: float = number(
        0.0, "lowest pressure that can be read", unit="Pa", minimum=0.0, live=True
    )
    maximum: float = number(
        0.0, "highest pressure that can be read; 0: no limit", unit="Pa", minimum=0.0, live=True
    )
    resolution: float = _single_axis_field(
        "resolution", text="step of the digital output (1 LSB); 0: none"
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        yield from super().problems(prefix)
        if self.gauss_markov_sigma and not self.correlation_time:
            yield (
                f"{prefix}correlation_time = 0.0: must be above 0 s where "
                f"{prefix}gauss_markov_sigma is"
            )
        if self.maximum and self.maximum <= self.minimum:
            yield (
                f"{prefix}maximum = {self.maximum:g}: must be 0 or above {prefix}minimum, "
                f"{self.minimum:g} Pa"
            )
        if bool(self.gust_rate) != bool(self.gust_sigma):
            yield (
                f"{prefix}gust_rate = {self.gust_rate:g} and {prefix}gust_sigma = "
                f"{self.gust_sigma:g}: must both be 0 or both be above 0"
            )


@dataclass(frozen=True)
class BarometerSwitches:
    """Switches of the published topics."""

    pressure: bool = flag(False, "publish imu/pressure, the readings of the barometer")
    ground_truth_pressure: bool = flag(
        False, "publish ground_truth/pressure, the pressure without errors"
    )
