# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The standard atmosphere: pressure from height (ISO 2533; U.S. Standard Atmosphere, 1976)."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config.auxiliary import AtmosphereParameters
from imu_sim_ros.conventions import STANDARD_GRAVITY

Array = NDArray[np.float64]

EARTH_RADIUS: Final = 6356766.0
"""[m] of the geopotential height."""
_GAS_CONSTANT: Final = 8.31432 / 0.0289644
"""[J/(kg K)] of dry air, with the constants of 1976."""
_STANDARD_TEMPERATURE: Final = 288.15
_ZERO_CELSIUS: Final = 273.15
_BASES: Final = np.array([0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3, 84852.0])
"""[m] geopotential height where each layer begins; the first reaches below 0 as well."""
_LAPSE: Final = np.array([-6.5e-3, 0.0, 1e-3, 2.8e-3, 0.0, -2.8e-3, -2e-3, 0.0])
"""[K/m]; beyond the standard's seven layers, which end at 86 km, the temperature stays."""


class Atmosphere:
    """Air at rest; a day that is warmer at sea level is as much warmer at every height."""

    def __init__(self, parameters: AtmosphereParameters) -> None:
        steps = np.diff(_BASES) * _LAPSE[:-1]
        warmth = parameters.sea_level_temperature + _ZERO_CELSIUS
        self._temperature = warmth + np.concatenate([[0.0], np.cumsum(steps)])
        self._pressure = np.full(len(_BASES), parameters.sea_level_pressure)
        for k in range(1, len(_BASES)):
            layer = np.array([k - 1])
            self._pressure[k] = self._in_layer(layer, _BASES[k : k + 1])[0]

    def pressure(self, height: Array) -> Array:
        """Return the pressure (n,) [Pa] at heights (n,) above sea level [m].

        With the geopotential height ``H = R z / (R + z)``, in a layer from H_b on with lapse rate L
        ``p = p_b (1 + L (H - H_b) / T_b)^(-g / (R_air L))``, or
        ``p = p_b exp(-g (H - H_b) / (R_air T_b))`` where L is 0.
        """
        geopotential = EARTH_RADIUS * height / (EARTH_RADIUS + height)
        layer = np.searchsorted(_BASES[1:], geopotential, side="right")
        return self._in_layer(layer, geopotential)

    def _in_layer(self, layer: NDArray[np.intp], geopotential: Array) -> Array:
        above = geopotential - _BASES[layer]
        lapse, warmth = _LAPSE[layer], self._temperature[layer]
        exponent = STANDARD_GRAVITY / _GAS_CONSTANT
        isothermal = lapse == 0.0
        own = np.where(isothermal, 1.0, lapse)
        # One expression for both: the exponential is the limit of the power.
        log_ratio = np.where(
            isothermal,
            -exponent * above / warmth,
            -exponent / own * np.log1p(own * above / warmth),
        )
        result: Array = self._pressure[layer] * np.exp(log_ratio)
        return result
