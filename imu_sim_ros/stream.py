"""Trajectory and sensor joined: blocks of samples, the one engine behind node and command."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from imu_sim_ros import timebase
from imu_sim_ros.config.simulation import SimulationParameters
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.poses import PoseSequence, read_poses
from imu_sim_ros.sensor.block import ImuBlock
from imu_sim_ros.sensor.ideal import specific_force
from imu_sim_ros.sensor.noise import RandomWalk, WhiteNoise
from imu_sim_ros.trajectory import build_trajectory

BLOCK_SIZE = 8192
DEFAULT_START_NS = timebase.NANOSECONDS_PER_SECOND

PoseReader = Callable[[str | Path], PoseSequence]


class Simulation:
    """The samples of one simulated IMU, in order, in blocks of any size."""

    def __init__(
        self,
        parameters: SimulationParameters,
        pose_reader: PoseReader = read_poses,
        t0_ns: int | None = None,
    ) -> None:
        self.parameters = parameters
        self.trajectory = build_trajectory(parameters.trajectory, pose_reader)
        if t0_ns is None:
            start = parameters.start_time
            t0_ns = timebase.to_nanoseconds(start) if start >= 0 else DEFAULT_START_NS
        self.t0_ns = t0_ns
        self.total = self._sample_count()
        self.reset()

    def _sample_count(self) -> int | None:
        """Return how many samples there are; None: no end."""
        duration = self.parameters.duration or self.trajectory.duration
        if math.isinf(duration):
            return None
        if duration > self.trajectory.duration:
            raise ConfigurationError(
                f"duration = {duration}: the trajectory lasts {self.trajectory.duration:g} s"
            )
        return timebase.sample_count(duration, self.parameters.rate)

    def reset(self) -> None:
        """Go back to the first sample: the same samples follow again."""
        self.position = 0
        seed, dt = self.parameters.seed, 1.0 / self.parameters.rate
        self._white = [WhiteNoise(seed, triad, dt) for triad in ("gyroscope", "accelerometer")]
        self._walk = [RandomWalk(seed, triad, dt) for triad in ("gyroscope", "accelerometer")]
        self.update(self.parameters)

    def update(self, parameters: SimulationParameters) -> None:
        """Take new values of live parameters; they hold from the next block on."""
        self.parameters = parameters
        imu = parameters.imu
        self._white[0].configure(imu.gyroscope_noise_density)
        self._white[1].configure(imu.accelerometer_noise_density)
        self._walk[0].configure(imu.gyroscope_random_walk)
        self._walk[1].configure(imu.accelerometer_random_walk)

    def next_block(self, count: int) -> ImuBlock:
        """Return the next samples: ``count``, fewer at the end of the run, none after it."""
        if self.total is not None:
            count = min(count, self.total - self.position)
        first = self.position
        t_ns = timebase.sample_times_ns(first, count, self.parameters.rate, self.t0_ns)
        motion = self.trajectory.sample(timebase.seconds_since(t_ns, self.t0_ns))
        force = specific_force(motion, np.array(self.parameters.gravity))
        walk = [term.next_block(count).T for term in self._walk]
        white = [term.next_block(count).T for term in self._white]
        self.position += count
        return ImuBlock(
            first=first,
            true_t_ns=t_ns,
            t_ns=t_ns,
            release_t_ns=t_ns,
            delivered=np.arange(count),
            gyro=motion.angular_velocity + walk[0] + white[0],
            accel=force + walk[1] + white[1],
            temperature=np.full(count, 25.0),
            ideal_gyro=motion.angular_velocity,
            ideal_accel=force,
            gyro_bias=walk[0],
            accel_bias=walk[1],
            gyro_scale=np.ones((count, 3)),
            accel_scale=np.ones((count, 3)),
            motion=motion,
        )

    def blocks(self, block_size: int = BLOCK_SIZE, count: int | None = None) -> Iterator[ImuBlock]:
        """Yield the samples that are left, or the next ``count``, in blocks.

        :param count: needed where the run has no end and the loop shall have one.
        """
        last = None if count is None else self.position + count
        while last is None or self.position < last:
            size = block_size if last is None else min(block_size, last - self.position)
            block = self.next_block(size)
            if len(block.true_t_ns) == 0:
                return
            yield block
