# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The barometer of an IMU: the standard atmosphere at the IMU's height, and its errors."""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.core.conventions import ABSOLUTE_ZERO, STANDARD_GRAVITY
from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.rotation import rotate
from imu_sim_ros.core.types import Array
from imu_sim_ros.sensors.barometer.parameters import BarometerParameters
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.environment import AtmosphereParameters
from imu_sim_ros.sensors.errors.triad import Additions, Triad
from imu_sim_ros.sensors.faults import FaultSchedule
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.model import SensorWithImu
from imu_sim_ros.sensors.timing import Sampled
from imu_sim_ros.sensors.world import World

EARTH_RADIUS: Final = 6356766.0
"""Radius of the Earth for the geopotential height [m]."""
_GAS_CONSTANT: Final = 8.31432 / 0.0289644
"""Specific gas constant of dry air, with the constants of 1976 [J/(kg K)]."""
_BASES: Final = np.array([0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3, 84852.0])
"""Geopotential height at which each layer begins [m]; the first extends below 0 as well."""
_LAPSE: Final = np.array([-6.5e-3, 0.0, 1e-3, 2.8e-3, 0.0, -2.8e-3, -2e-3, 0.0])
"""Lapse rate [K/m]; above the standard's seven layers, at 86 km, the temperature is constant."""


class Atmosphere:
    """Air at rest; a deviation of the temperature at sea level is the same at every height."""

    def __init__(self, parameters: AtmosphereParameters) -> None:
        steps = np.diff(_BASES) * _LAPSE[:-1]
        warmth = parameters.sea_level_temperature - ABSOLUTE_ZERO
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
        """Return the pressures (n,) at geopotential heights [m] in layers of the atmosphere."""
        height_in_layer = geopotential - _BASES[layer]
        lapse, warmth = _LAPSE[layer], self._temperature[layer]
        exponent = STANDARD_GRAVITY / _GAS_CONSTANT
        isothermal = lapse == 0.0
        safe_lapse = np.where(isothermal, 1.0, lapse)
        # One expression for both: the exponential is the limit of the power.
        log_ratio = np.where(
            isothermal,
            -exponent * height_in_layer / warmth,
            -exponent / safe_lapse * np.log1p(safe_lapse * height_in_layer / warmth),
        )
        return self._pressure[layer] * np.exp(log_ratio)


NAME: Final = "barometer"


class Gusts:
    """Pressure that changes at random times to a random value, held until the next change.

    Between two samples a step occurs with the probability ``1 - exp(-rate dt)`` that a Poisson
    process has an event.
    """

    def __init__(self, seed: int, rate: float, sigma: float, dt: float) -> None:
        """Start in still air.

        :param rate: mean number of steps in a second.
        :param sigma: standard deviation of the pressure [Pa].
        """
        self._times, self._sizes = (generator(seed, f"{NAME}.gust{part}") for part in ("", "_size"))
        self._probability = -math.expm1(-rate * dt)
        self._sigma = sigma
        self._pressure = 0.0

    def next(self, count: int) -> Array:
        """Return the next values (count,) [Pa]."""
        starts = np.flatnonzero(self._times.random(count) < self._probability)
        sizes = self._sigma * self._sizes.standard_normal(len(starts))
        values = np.concatenate([[self._pressure], sizes])
        pressures: Array = values[np.searchsorted(starts, np.arange(count), side="right")]
        self._pressure = float(values[-1])
        return pressures


def gusts(parameters: BarometerParameters, seed: int) -> Gusts | None:
    """Return the gusts at one barometer; None if there are none."""
    p = parameters
    return Gusts(seed, p.gust_rate, p.gust_sigma, 1.0 / p.rate) if p.gust_rate else None


def read_pressures(
    triad: Triad,
    limits: tuple[ArrayLike, ArrayLike],
    start: int,
    ideal: Array,
    gust: Array | None,
    additions: Additions,
    faults: FaultSchedule | None = None,
) -> dict[str, Array]:
    """Return the next n samples of a barometer and their truth, from ideal pressures.

    The barometer is one, or a batch; its errors are those of a triad's first axis.

    :param limits: smallest and largest measured pressure [Pa]; a largest of 0: no limit.
    :param start: index of the first sample.
    :param ideal: (n, ...) pressure of the still air [Pa].
    :param gust: (n, ...) pressure of wind [Pa]; None: no wind.
    :param additions, faults: as for :meth:`Triad.read`.
    """
    values = np.empty((*ideal.shape, 3), order="F")
    values[..., 1:] = 0.0
    values[..., 0] = ideal if gust is None else ideal + gust
    samples = triad.read(start, values, values, additions, faults)
    bias = samples.bias[..., 0] if gust is None else samples.bias[..., 0] + gust
    lowest, highest = limits
    highest = np.where(np.asarray(highest) > 0.0, highest, math.inf)
    reading = np.clip(samples.reading[..., 0], lowest, highest)
    return {"pressure": reading, "ideal_pressure": ideal, "bias": bias}


class Barometer(SensorWithImu):
    """One barometer."""

    parameters: BarometerParameters

    def __init__(self, mounted: Mounted[ImuParameters], t0_ns: int, _: object = None) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of the start [ns].
        """
        super().__init__(mounted, t0_ns)
        environment = mounted.environment
        self._atmosphere = Atmosphere(environment.atmosphere)
        self._height = environment.height
        self._gusts = gusts(self.parameters, environment.seed)

    def ideal(self, t: Array, world: World) -> Array:
        """Return the pressure of the still air at the IMU (n,) [Pa]."""
        motion = world.motion(t)
        arm_w = rotate(motion.q_wb, self.lever_arm_b)
        # In a curved world, too, z is the height above the origin's height (CurvedEarth).
        return self._atmosphere.pressure(self._height + motion.position[:, 2] + arm_w[:, 2])

    def measure(self, samples: Sampled, ideal: Array, additions: Additions) -> dict[str, Array]:
        """Return pressures and biases [Pa] of the next n samples."""
        gust = None if self._gusts is None else self._gusts.next(len(samples.t))
        limits, faults = (self.parameters.minimum, self.parameters.maximum), self.timing.faults
        return read_pressures(self.triad, limits, samples.first, ideal, gust, additions, faults)
