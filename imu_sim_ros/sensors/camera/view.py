# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A camera on a body: when it takes frames, and where it is then."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation, timebase
from imu_sim_ros.core.random_streams import generator_at
from imu_sim_ros.core.types import Array, Integers, Mask, Times
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.world import World
from imu_sim_ros.trajectory.motion import Trajectory

LARGEST_JITTER: Final = 0.45
"""Largest error of the stamps, in frame intervals, so that stamps always increase."""


class Frames(NamedTuple):
    """n consecutive frames of one camera."""

    number: Integers
    """(n,) which frames."""
    true_t_ns: Times
    """(n,) the middle of the exposure, of the middle row [ns]."""
    t_ns: Times
    """(n,) the stamps, by the camera's clock [ns]."""
    release_t_ns: Times
    """(n,) when the messages leave the driver [ns]."""
    delivered: Mask
    """(n,) false: the frame is lost."""


class CameraPoses(NamedTuple):
    """Poses of a camera at n times."""

    position: Array
    """(n, 3) p_wc [m]."""
    q_wc: Array
    """(n, 4) attitudes of the camera."""


class Eyes(NamedTuple):
    """Poses of a camera at n times, in the world and in the axes of moving bodies."""

    world: CameraPoses
    bodies: Sequence[CameraPoses] = ()
    """Poses in the axes of each moving body."""


class View:
    """One camera of a simulation."""

    def __init__(
        self, name: str, parameters: CameraParameters, seed: int, t0_ns: int, duration: float
    ) -> None:
        """Set up the camera.

        :param name: name of the camera; its random streams have it in their names.
        :param t0_ns: start of the simulation [ns].
        :param duration: length of the simulation [s], maybe infinite; no frame is taken after it.
        """
        self.name, self.parameters, self.seed = name, parameters, seed
        self.t0_ns, self.duration = t0_ns, duration
        self.model = CameraModel(parameters)
        r_bc, self.p_bc = parameters.pose()
        self.q_bc = rotation.from_matrix(r_bc)
        self.phase_ns = timebase.to_nanoseconds(parameters.phase)

    @property
    def total(self) -> int | None:
        """Number of frames; None: endless."""
        rest = self.duration - self.parameters.phase
        if np.isinf(rest):
            return None
        return timebase.sample_count(max(rest, 0.0), self.parameters.rate)

    def stream(self, source: str, index: int) -> np.random.Generator:
        """Return the random stream of one source for one frame."""
        return generator_at(self.seed, f"{self.name}.{source}", index)

    def frames(self, first: int, count: int) -> Frames:
        """Return frames ``first .. first + count - 1``."""
        p = self.parameters
        index = np.arange(first, first + count, dtype=np.int64)
        true = timebase.sample_times_ns(first, count, p.rate, self.t0_ns + self.phase_ns)
        stamps = true - timebase.to_nanoseconds(p.time_offset)
        if p.jitter > 0.0:
            limit = LARGEST_JITTER / p.rate
            errors = [self.stream("stamp", int(k)).standard_normal() * p.jitter for k in index]
            stamps = stamps + np.rint(np.clip(errors, -limit, limit) * 1e9).astype(np.int64)
        delivered = np.ones(count, dtype=bool)
        if p.dropout_probability > 0.0:
            drawn = [self.stream("dropout", int(k)).random() for k in index]
            delivered = np.array(drawn) >= p.dropout_probability
        release = true + timebase.to_nanoseconds(p.latency)
        return Frames(
            number=index, true_t_ns=true, t_ns=stamps, release_t_ns=release, delivered=delivered
        )

    def seconds(self, t_ns: Times) -> Array:
        """Return times after the start, within the trajectory's length [s]."""
        t = timebase.seconds_since(t_ns, self.t0_ns)
        return np.clip(t, 0.0, self.duration)

    def poses(self, trajectory: Trajectory, t: Array) -> CameraPoses:
        """Return where the camera is at times t (n,) [s]: ``T_wc = T_wb T_bc``."""
        motion = trajectory.sample(np.clip(t, 0.0, trajectory.duration))
        position = motion.position + rotation.rotate(motion.q_wb, self.p_bc)
        return CameraPoses(position, rotation.multiply(motion.q_wb, self.q_bc))


def view_of(
    mounted: Mounted[CameraParameters], world: World, duration: float | None = None
) -> View:
    """Return a camera on a simulation's body.

    :param duration: how long it takes frames [s]; None: until the simulation ends.
    """
    if duration is None:
        longest = world.trajectory.duration
        duration = min(mounted.environment.duration or longest, longest)
    seed = mounted.environment.seed
    return View(mounted.name, mounted.parameters, seed, world.t0_ns, duration)


def transform_to_camera(poses: CameraPoses, points: Array) -> Array:
    """Return points (n, 3) of the world in the camera's frame, each by the pose of its row."""
    return rotation.rotate_inverse(poses.q_wc, points - poses.position)
