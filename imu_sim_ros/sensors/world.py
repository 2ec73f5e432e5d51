# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""World of the sensors of a body: its motion, the environment, and the time."""

from collections.abc import Callable
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.types import Array
from imu_sim_ros.sensors.environment import EnvironmentParameters, TemperatureParameters
from imu_sim_ros.trajectory.motion import Motion, Trajectory

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from imu_sim_ros.sensors.camera.scene import Scene

_T = TypeVar("_T")


class Window(NamedTuple):
    """An interval of time ``[begin, end)`` since the start of a run, in exact numbers [s]."""

    begin: Fraction
    """Start, which is part of the interval [s]."""
    end: Fraction
    """End, which is not part of it [s]."""


class TemperatureProfile:
    """Piecewise linear ambient temperature, followed by the sensor with a first-order lag.

    On a piece ``T_a = A + B (t - t_j)`` the lag ``tau dT/dt = T_a - T`` has the solution
    ``T = T_a - B tau + (T_j - A + B tau) exp(-(t - t_j) / tau)``: closed form, so times can be
    asked for in any order. The sensor starts at the ambient temperature. Power P from the start on
    warms it further, by ``P sum_i R_i (1 - exp(-t / tau_i))`` of package and board.
    """

    def __init__(self, parameters: TemperatureParameters) -> None:
        """Initialise with the ambient temperature and the lag of the sensor.

        A profile that begins after 0 s is preceded by the constant ``value``.
        """
        times = list(parameters.profile[::2])
        values = list(parameters.profile[1::2])
        if not times or times[0] > 0.0:
            times.insert(0, 0.0)
            values.insert(0, parameters.value)
        self._times = np.array(times)
        """(k,) starts t_j of the pieces [s]."""
        self._ambient = np.array(values)
        """(k,) ambient temperatures A at these times [degC]."""
        self._slope = np.zeros(len(times))
        """(k,) slopes B [K/s]."""
        if parameters.interpolation == "linear":
            self._slope[:-1] = np.diff(self._ambient) / np.diff(self._times)
        self._tau = parameters.time_constant
        self._excess = np.zeros(len(times))
        """The decaying part at the start of each piece: ``T_j - A + B tau``."""
        sensor = self._ambient[0]  # T_j, the sensor's temperature at the start of piece j
        for j, (ambient, slope) in enumerate(zip(self._ambient, self._slope, strict=True)):
            self._excess[j] = sensor - ambient + slope * self._tau
            if j + 1 < len(times) and self._tau:
                length = self._times[j + 1] - self._times[j]
                sensor = ambient + slope * (length - self._tau)
                sensor += self._excess[j] * np.exp(-length / self._tau)
        rises = parameters.power * np.array(parameters.thermal_resistance)
        self._warm_up = [
            (float(rise), tau)
            for rise, tau in zip(rises, parameters.warm_up_time, strict=True)
            if rise
        ]
        self.constant = len(times) == 1 and not self._warm_up
        """True if the temperature never changes."""

    def at(self, t: Array) -> Array:
        """Return the sensor's temperature (n,) [degC] at times t (n,) [s] since the start."""
        if self.constant:
            return np.full(t.shape, self._ambient[0])
        piece = np.searchsorted(self._times, t, side="right") - 1
        since = t - self._times[piece]
        temperature: Array = self._ambient[piece] + self._slope[piece] * (since - self._tau)
        if self._tau:
            temperature += self._excess[piece] * np.exp(-since / self._tau)
        for rise, tau in self._warm_up:
            temperature += rise if tau == 0.0 else -rise * np.expm1(-t / tau)
        return temperature


class World:
    """A body's motion and its surroundings, at times since the start of a run."""

    def __init__(
        self,
        trajectory: Trajectory,
        environment: EnvironmentParameters,
        t0_ns: int,
        scene: "Callable[[World], Scene] | None" = None,
        threads: "Executor | None" = None,
    ) -> None:
        """Start at a time.

        :param t0_ns: true time of the start [ns].
        :param scene: returns the scene in it when it is first asked for; None: there is none.
        :param threads: compute large values such as images in the background; None: when asked for.
        """
        self._make_scene, self.threads = scene, threads
        self._shared: dict[str, Any] = {}
        self.trajectory, self.environment, self.t0_ns = trajectory, environment, t0_ns
        self.temperature = TemperatureProfile(environment.temperature)
        self._known: tuple[Array, Motion] | None = None

    @cached_property
    def scene(self) -> "Scene":
        """Scene that sensors see and range: surfaces, meshes, landmarks, and bodies that move.

        :raises ConfigurationError: for a scene that does not fit the path, and without one.
        """
        if self._make_scene is None:
            raise ConfigurationError("scene: no sensor of this simulation declares that it sees")
        return self._make_scene(self)

    def share(self, name: str, make: Callable[[], _T]) -> _T:
        """Return an object that several sensors use; it is made with the first call."""
        if name not in self._shared:
            self._shared[name] = make()
        return self._shared[name]

    def motion(self, t: Array) -> Motion:
        """Return the body's motion at times t (n,) [s], which increase.

        Sensors take samples at the same times, so the motion at the last times is kept.
        """
        if self._known is not None:
            times, motion = self._known
            rows = _even_rows(t, times)
            if rows is not None:
                return Motion(*(values[rows] for values in motion))
        motion = self.trajectory.sample(t)
        self._known = t, motion
        return motion


def _even_rows(t: Array, times: Array) -> slice | None:
    """Return at which evenly spaced rows of increasing times t is; None: at none."""
    count = len(t)
    if not 0 < count <= len(times):
        return None
    indices = np.searchsorted(times, t[[0, min(1, count - 1)]], side="right") - 1
    begin, step = int(indices[0]), max(int(indices[1] - indices[0]), 1)
    if begin < 0:
        return None
    rows = slice(begin, begin + step * (count - 1) + 1, step)
    return rows if np.array_equal(times[rows], t) else None
