# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the sensors of a body are in: its motion, the environment, and the time."""

from collections.abc import Callable
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from imu_sim_ros import timebase
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.response import TemperatureProfile
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.types import Array, Times

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from imu_sim_ros.sensors.camera.scene import Scene


class Window(NamedTuple):
    """An interval of time ``[begin, end)`` since the start of a run, in exact numbers [s]."""

    begin: Fraction
    end: Fraction


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
        :param threads: make what takes long, such as images; None: whoever asks for it does.
        """
        self._make_scene, self.threads = scene, threads
        self._shared: dict[str, Any] = {}
        self.trajectory, self.environment, self.t0_ns = trajectory, environment, t0_ns
        self.temperature = TemperatureProfile(environment.temperature)
        self._known: tuple[Array, Motion] | None = None

    @cached_property
    def scene(self) -> "Scene":
        """What sensors see and range: surfaces, meshes, landmarks, and bodies that move.

        :raises ConfigurationError: for a scene that does not fit the path, and without one.
        """
        if self._make_scene is None:
            raise ConfigurationError("scene: no sensor of this simulation declares that it sees")
        return self._make_scene(self)

    def shared(self, name: str, make: Callable[[], Any]) -> Any:
        """Return what several sensors make of the world: the first one makes it."""
        if name not in self._shared:
            self._shared[name] = make()
        return self._shared[name]

    def motion(self, t: Array) -> Motion:
        """Return the body's motion at times t (n,) [s], which increase.

        Sensors take samples at the same times, so the motion at the last times is kept.
        """
        if self._known is not None:
            times, motion = self._known
            rows = _evenly_spaced(t, times)
            if rows is not None:
                return Motion(*(values[rows] for values in motion))
        motion = self.trajectory.sample(t)
        self._known = t, motion
        return motion


def _evenly_spaced(t: Array, times: Array) -> slice | None:
    """Return at which evenly spaced rows of increasing times t is; None: at none."""
    count = len(t)
    if not 0 < count <= len(times):
        return None
    indices = np.searchsorted(times, t[[0, min(1, count - 1)]], side="right") - 1
    first, step = int(indices[0]), max(int(indices[1] - indices[0]), 1)
    if first < 0:
        return None
    rows = slice(first, first + step * (count - 1) + 1, step)
    return rows if np.array_equal(times[rows], t) else None


class Sampled(NamedTuple):
    """n samples that lie in a window of time."""

    first: int
    """Index of the first of them."""
    true_t_ns: Times
    """(n,) [ns]."""
    t: Array
    """(n,) since the start of the run [s]."""


class SampleTimes:
    """Times of a sensor's samples: sample k is taken at ``offset + k / rate`` after the start."""

    def __init__(self, rate: float, t0_ns: int, offset: float = 0.0, span: float = 0.0) -> None:
        """Keep them as exact numbers.

        :param t0_ns: true time of the start [ns].
        :param span: how long a sample takes [s].
        """
        self._rate, self._exact_rate = rate, timebase.exact_rate(rate)
        self._offset, self._span = Fraction(repr(offset)), Fraction(repr(span))
        self._t0_ns, self._first_ns = t0_ns, t0_ns + timebase.to_nanoseconds(offset)

    def index(self, t: Fraction) -> int:
        """Return the index of the first sample not before a time, or not complete by then.

        :param t: since the start [s].
        """
        after = (t - self._offset - self._span) * self._exact_rate
        if self._span:
            return max(after.numerator // after.denominator + 1, 0)
        return max(-(-after.numerator // after.denominator), 0)

    def time(self, index: int) -> Fraction:
        """Return the time of a sample since the start [s]."""
        return self._offset + index / self._exact_rate

    def within(self, window: Window) -> Sampled:
        """Return the samples in a window."""
        first = self.index(window.begin)
        return self.following(first, self.index(window.end) - first)

    def following(self, first: int, count: int) -> Sampled:
        """Return the samples from an index on."""
        true_t_ns = timebase.sample_times_ns(first, count, self._rate, self._first_ns)
        return Sampled(first, true_t_ns, timebase.seconds_since(true_t_ns, self._t0_ns))
