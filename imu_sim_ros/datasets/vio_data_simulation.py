# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The text files of HeYijia/vio_data_simulation, with pixel noise and the image's bounds.

``imu_pose.txt``, ``imu_pose_noise.txt``, ``cam_pose.txt``: t, q w x y z, p, gyro, acc.
``imu_int_pose.txt``, ``imu_int_pose_noise.txt``: what the readings of the first two integrate to by
Euler's method, from the second reading on: t, q, p, and q, p again.
``cam_pose_tum.txt``: t, p, q x y z w. ``all_points.txt``: x y z 1; of frame N
``keyframe/all_points_N.txt``: x y z 1 u v, and ``keyframe/all_lines_N.txt``: u1 v1 u2 v2, where u
and v are normalised and undistorted. Times are seconds from the start, each computed from its
index; the original applies no noise and has no border, so its readers see a landmark that a
camera does not.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.outputs import make_folder, write_bytes
from imu_sim_ros.bags.text import decimals
from imu_sim_ros.bags.writer import describe_amount
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import system_error
from imu_sim_ros.core.types import Array
from imu_sim_ros.datasets.tracks import Blindness
from imu_sim_ros.sensors.camera.declaration import cameras_in
from imu_sim_ros.sensors.camera.view import View, view_of
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.topics import WindowSamples
from imu_sim_ros.trajectory.motion import Motion

_SECOND: Final = 1e-9
"""Seconds in a nanosecond."""
_INTEGRATED: Final = ("imu_int_pose", "imu_int_pose_noise")


class _Rows:
    """A text file of numbers separated by spaces."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows = 0
        try:
            self._file = path.open("xb")
        except OSError as error:
            raise system_error(path, error) from None

    def write(self, values: Array) -> None:
        """Append rows (n, m)."""
        try:
            self._file.write(decimals.lines([values], " "))
        except OSError as error:
            raise system_error(self.path, error) from None
        self.rows += len(values)

    def close(self) -> None:
        """Finish the file."""
        try:
            self._file.close()
        except OSError as error:
            raise system_error(self.path, error) from None


class _Integration:
    """Integrator of readings to poses, as the original's ``IMU::testImu`` (src/imu.cpp).

    A step takes the reading at its end: ``a = R_wb acc + g``, with R_wb at its start, then
    ``q = q (1, gyro dt / 2)``, of length 1 here, ``v = v + a dt``, ``p = p + v dt + a dt^2 / 2``.
    """

    def __init__(self, gravity: Sequence[float]) -> None:
        self._gravity = np.asarray(gravity)
        self._state: tuple[float, Array, Array, Array] | None = None
        """Time [s], q_wb (4,), velocity (3,) and position (3,) after the last reading."""

    def rows(self, t: Array, motion: Motion, gyro: Array, accel: Array) -> Array:
        """Return the rows (m, 15) of the next n readings; the very first reading has none.

        :param t: (n,) times [s].
        :param motion: true motion, with which the integration begins.
        """
        if self._state is None and len(t):
            q_wb, velocity, position = motion.q_wb[0], motion.velocity[0], motion.position[0]
            self._state = (float(t[0]), q_wb, velocity, position)
            t, gyro, accel = t[1:], gyro[1:], accel[1:]
        if self._state is None or not len(t):
            return np.empty((0, 15))
        previous_t, q_wb, velocity, position = self._state
        dt = np.diff(t, prepend=previous_t)[:, None]
        turns = rotation.normalise(np.concatenate([np.ones_like(dt), 0.5 * dt * gyro], axis=1))
        q = rotation.cumulative_product(np.concatenate([q_wb[None], turns]))
        acceleration = rotation.rotate(q[:-1], accel) + self._gravity
        speeds = velocity + np.cumsum(acceleration * dt, axis=0)
        places = position + np.cumsum(speeds * dt + 0.5 * acceleration * dt * dt, axis=0)
        q = rotation.normalise(q[1:])
        self._state = (float(t[-1]), q[-1], speeds[-1], places[-1])
        return np.concatenate([t[:, None], q, places, q, places], axis=1)


class VioDataSimulation:
    """Output of a folder of that simulator's files; use as a context manager."""

    def __init__(
        self,
        folder: Path,
        sensors: Mapping[str, Mounted[MountedParameters]],
        world: World,
        warn: Callable[[str], object],
    ) -> None:
        """Open the files.

        :param sensors: sensors of the body, with one camera.
        :param warn: receiver of the time spans without landmarks, at the end.
        """
        self._warn = warn
        camera = next(iter(cameras_in(sensors).values()))
        make_folder(folder)
        self.path = folder
        (folder / "keyframe").mkdir()
        self._world, self._view = world, view_of(camera, world)
        self._blindness = Blindness(self._view.name)
        self._frames, self._last_ns = 0, -1
        names = ("imu_pose", "imu_pose_noise", "cam_pose", "cam_pose_tum", *_INTEGRATED)
        gravity = sensors[IMU].environment.gravity
        self._integrations = {name: _Integration(gravity) for name in _INTEGRATED}
        self._files = {name: _Rows(folder / f"{name}.txt") for name in names}
        self._write(folder / "all_points.txt", _homogeneous(world.scene.landmarks))

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows of the IMU, and of frames."""
        return {"imu_pose": self._files["imu_pose"].rows, "keyframes": self._frames}

    def summary(self) -> str:
        """Return the amount of data written, as text."""
        return describe_amount(self._files["imu_pose"].rows, self._last_ns, "rows")

    def write(self, window: WindowSamples) -> None:
        """Write the samples of a window, and its frames.

        :param window: samples by sensor, with the only IMU among them.
        """
        block: Samples = window[IMU]
        m = block.motion
        t = (block.true_t_ns - self._world.t0_ns)[:, None] * _SECOND
        pose = [t, m.q_wb, m.position]
        true = [block.ideal_gyro, block.ideal_accel]
        self._files["imu_pose"].write(np.concatenate([*pose, *true], axis=1))
        self._files["imu_pose_noise"].write(
            np.concatenate([*pose, block.gyro, block.accel], axis=1)
        )
        times = np.asarray(t[:, 0], dtype=np.float64)
        readings = ((block.ideal_gyro, block.ideal_accel), (block.gyro, block.accel))
        for name, (gyro, accel) in zip(_INTEGRATED, readings, strict=True):
            rows = self._integrations[name].rows(times, m, gyro, accel)
            self._files[name].write(rows)
        if len(block.true_t_ns):
            self._last_ns = int(block.true_t_ns[-1])
        self._write_frames(window[self._view.name])

    def _write_frames(self, samples: Samples) -> None:
        """Write camera poses, and a file of points and one of lines for each frame."""
        view, world, count = self._view, self._world, len(samples.t_ns)
        tracks, lines = samples.tracks, samples.lines
        self._frames += count
        self._blindness.record(tracks, world.t0_ns)
        seconds = view.seconds(samples.true_t_ns)
        poses = view.poses(world.trajectory, seconds)
        t = seconds[:, None]
        nothing = np.zeros((count, 6))
        self._files["cam_pose"].write(
            np.concatenate([t, poses.q_wc, poses.position, nothing], axis=1)
        )
        q_xyzw = poses.q_wc[:, [1, 2, 3, 0]]
        self._files["cam_pose_tum"].write(np.concatenate([t, poses.position, q_xyzw], axis=1))
        points = np.concatenate(
            [_homogeneous(world.scene.landmarks[tracks.landmark]), _normalise(view, tracks.uv)],
            axis=1,
        )
        ends = _normalise(view, lines.ends.reshape(-1, 2)).reshape(-1, 4)
        for k in range(count):
            name = f"{samples.first + k}.txt"
            folder = self.path / "keyframe"
            self._write(folder / f"all_points_{name}", points[tracks.frame == k])
            self._write(folder / f"all_lines_{name}", ends[lines.frame == k])

    @staticmethod
    def _write(path: Path, values: Array) -> None:
        write_bytes(path, decimals.lines([values], " ") if len(values) else b"")

    def __enter__(self) -> "VioDataSimulation":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        for file in self._files.values():
            file.close()
        if error is None:
            for line in self._blindness.warnings():
                self._warn(line)


def _homogeneous(points: Array) -> Array:
    """Return points (n, 3) with a fourth coordinate of 1."""
    return np.concatenate([points, np.ones((len(points), 1))], axis=1)


def _normalise(view: View, uv: Array) -> Array:
    """Return x / z and y / z (n, 2) of pixels (n, 2)."""
    ray = view.model.unproject(uv).direction
    return ray[:, :2] / ray[:, 2:]
