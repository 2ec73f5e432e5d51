# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The barometer of an IMU: the standard atmosphere at the IMU's height, and its errors."""

import math
from fractions import Fraction
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.conventions import STANDARD_GRAVITY
from imu_sim_ros.random_streams import generator
from imu_sim_ros.rotation import rotate
from imu_sim_ros.sensors.barometer.parameters import BarometerParameters
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.environment import AtmosphereParameters
from imu_sim_ros.sensors.errors.terms import Surroundings
from imu_sim_ros.sensors.errors.triad import Additions, Triad
from imu_sim_ros.sensors.faults import Fault, FaultSchedule
from imu_sim_ros.sensors.imu.parameters import ImuParameters, instantaneous
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.timing import SampleTiming
from imu_sim_ros.sensors.world import Sampled, Window, World
from imu_sim_ros.types import Array, Times

EARTH_RADIUS: Final = 6356766.0
"""[m] of the geopotential height."""
_GAS_CONSTANT: Final = 8.31432 / 0.0289644
"""[J/(kg K)] of dry air, with the constants of 1976."""
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
        return self._pressure[layer] * np.exp(log_ratio)


NAME: Final = "barometer"


class Gusts:
    """Steps of the pressure at random times: each draws the pressure that is held until the next.

    Between two samples a step occurs with the probability ``1 - exp(-rate dt)`` that a Poisson
    process has an event.
    """

    def __init__(self, seed: int, rate: float, sigma: float, dt: float) -> None:
        """Start in still air.

        :param rate: mean number of steps in a second.
        :param sigma: of the pressure [Pa].
        """
        self._times, self._sizes = (generator(seed, f"{NAME}.gust{part}") for part in ("", "_size"))
        self._probability = -math.expm1(-rate * dt)
        self._sigma = sigma
        self._held = 0.0

    def next(self, count: int) -> Array:
        """Return the next values (count,) [Pa]."""
        starts = np.flatnonzero(self._times.random(count) < self._probability)
        sizes = self._sigma * self._sizes.standard_normal(len(starts))
        values = np.concatenate([[self._held], sizes])
        result: Array = values[np.searchsorted(starts, np.arange(count), side="right")]
        self._held = float(values[-1])
        return result


def gusts(parameters: BarometerParameters, seed: int) -> Gusts | None:
    """Return the gusts at one barometer; None if there are none."""
    p = parameters
    return Gusts(seed, p.gust_rate, p.gust_sigma, 1.0 / p.rate) if p.gust_rate else None


class PressureErrors:
    """The errors of one barometer, or of those of a batch, on ideal pressures.

    They are those of a triad's first axis.
    """

    def __init__(self, triad: Triad) -> None:
        """Take the sensor's own errors; :meth:`configure` gives its limits."""
        self.triad = triad
        self._limits: tuple[ArrayLike, ArrayLike] = (0.0, math.inf)

    def configure(self, minimum: ArrayLike, maximum: ArrayLike) -> None:
        """Take the lowest and the highest pressure [Pa] that can be read; 0: no limit."""
        self._limits = (minimum, np.where(np.asarray(maximum) > 0.0, maximum, math.inf))

    def read(
        self,
        first: int,
        ideal: Array,
        gust: Array | None,
        additions: Additions,
        faults: FaultSchedule | None = None,
    ) -> dict[str, Array]:
        """Return the next n samples and their truth, as a flight has them.

        :param ideal: (n, ...) pressure of the still air [Pa].
        :param gust: (n, ...) what wind adds [Pa]; None: nothing.
        :param additions, faults: as for :meth:`Triad.read`.
        """
        values = np.empty((*ideal.shape, 3), order="F")
        values[..., 1:] = 0.0
        values[..., 0] = ideal if gust is None else ideal + gust
        made = self.triad.read(first, values, values, additions, faults)
        bias = made.bias[..., 0] if gust is None else made.bias[..., 0] + gust
        reading = np.clip(made.reading[..., 0], *self._limits)
        return {"pressure": reading, "ideal_pressure": ideal, "bias": bias}


class Barometer:
    """One barometer; its samples are read in order."""

    def __init__(self, mounted: Mounted, t0_ns: int, _: object = None) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of the start [ns].
        """
        imu, environment = mounted.own, mounted.environment
        own, seed = imu.barometer, environment.seed
        self._timing = SampleTiming(NAME, own.rate, imu, seed, t0_ns, own.time_offset, own.span)
        self._atmosphere = Atmosphere(environment.atmosphere)
        self._height = environment.height
        self._lever_arm_b = np.array(imu.lever_arm)
        self._gusts = gusts(own, seed)
        self._errors = PressureErrors(Triad(NAME, instantaneous(imu), seed, own.rate))
        self.configure(imu)

    def configure(self, imu: ImuParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        self._reference_temperature = imu.reference_temperature
        self._timing.configure(imu)
        self._errors.configure(imu.barometer.minimum, imu.barometer.maximum)
        self._errors.triad.configure(instantaneous(imu))

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Let a fault begin with the first sample not before a time since the start [s]."""
        self._timing.inject(fault, begin)

    def read(self, window: Window, world: World) -> Samples:
        """Return the samples in a window, which begins where the last one ended."""
        samples = self._timing.times.within(window)
        motion = world.motion(samples.t)
        arm_w = rotate(motion.q_wb, self._lever_arm_b)
        # In a curved world, too, z is the height above the origin's (CurvedEarth).
        ideal = self._atmosphere.pressure(self._height + motion.position[:, 2] + arm_w[:, 2])
        return self._read(samples, ideal, world)

    def apply(self, true_t_ns: Times, ideal: Array, world: World) -> Samples:
        """Return the next n samples of ideal pressures that somebody gives.

        :param true_t_ns: (n,) of the samples [ns].
        :param ideal: (n,) of the still air at the IMU [Pa].
        """
        return self._read(self._timing.given(true_t_ns), ideal, world)

    def _read(self, samples: Sampled, ideal: Array, world: World) -> Samples:
        gust = None if self._gusts is None else self._gusts.next(len(samples.t))
        offset = world.temperature.at(samples.t) - self._reference_temperature
        additions = self._errors.triad.additions(Surroundings(offset))
        values = self._errors.read(samples.first, ideal, gust, additions, self._timing.faults)
        return self._timing.samples(samples.first, samples.true_t_ns, values)
