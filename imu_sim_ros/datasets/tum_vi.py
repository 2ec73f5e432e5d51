# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The folder of a TUM VI sequence, as exported for EuRoC's and DSO's readers.

Schubert et al., The TUM VI Benchmark (IROS 2018): ``mav0/camN`` and ``mav0/imu0`` as in EuRoC,
``mav0/mocap0/data.csv`` the poses of the IMU, no sensor.yaml; ``dso/imu.txt`` with the readings,
and a further one, interpolated, at the time of each image, which DM-VIO requires;
``dso/gt_imu.csv`` (the same poses), and ``dso/camN`` with ``times.txt`` (name, seconds, exposure in
ms), the images, ``camera.txt`` (DSO's form of the lens) and ``vignette.png``. Images have 16 bits,
of which the upper 8 are the simulated camera's.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.outputs import OutputFile, make_folder, write_bytes
from imu_sim_ros.bags.text import decimals
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.bags.text.writer import EUROC_IMU_HEADER
from imu_sim_ros.bags.writer import describe_amount
from imu_sim_ros.core import rotation
from imu_sim_ros.core.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.core.timebase import interpolate_columns
from imu_sim_ros.datasets.images import ImageFolders, image_name
from imu_sim_ros.sensors.camera.declaration import cameras_in
from imu_sim_ros.sensors.camera.images.files import png
from imu_sim_ros.sensors.camera.images.vignetting import vignette
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.topics import WindowSamples, delivered_readings, resolve_topic

_POSES: Final = (
    "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
    "q_RS_z []"
)
_DSO_IMU: Final = "# timestamp[ns] w.x w.y w.z a.x a.y a.z"
_DSO_POSES: Final = "# timestamp[ns],tx,ty,tz,qw,qx,qy,qz"
_DSO_TIMES: Final = "# filename timestamp[s] exposure[ms]"


class TumVi:
    """Output of a sequence; use as a context manager."""

    def __init__(
        self,
        folder: Path,
        sensors: Mapping[str, Mounted[MountedParameters]],
        world: World,
        jobs: int,
        warn: Callable[[str], object],
    ) -> None:
        """Make the folders.

        :param sensors: sensors of the body, one IMU among them.
        :param world: world with threads that make images.
        :param jobs: number of the threads.
        :param warn: receives a line for each camera of which nothing is written.
        """
        make_folder(folder)
        imu = sensors[IMU].parameters
        assert isinstance(imu, ImuParameters)
        self.path = folder
        self.rows, self._last_ns = {"imu": 0, "poses": 0}, -1
        self._q_bi = rotation.from_matrix(np.reshape(imu.mounting, (3, 3)))
        self._p_bi = np.asarray(imu.lever_arm)
        for subfolder in ("mav0/imu0", "mav0/mocap0", "dso"):
            (folder / subfolder).mkdir(parents=True)
        self._open = {
            name: self._file(name, header)
            for name, header in (
                ("mav0/imu0/data.csv", EUROC_IMU_HEADER),
                ("mav0/mocap0/data.csv", _POSES),
                ("dso/gt_imu.csv", _DSO_POSES),
            )
        }
        self._images = ImageFolders(folder / "mav0", sensors, world, "tum_vi", jobs, warn)
        for camera in cameras_in(sensors):
            target = folder / "dso" / camera
            target.mkdir()
            (target / "images").symlink_to(f"../../mav0/{camera}/data")
        self._describe_lenses()

    def _describe_lenses(self) -> None:
        """Write the vignette of each camera, and its lens as DSO takes it."""
        for view in self._images.views:
            target = self.path / "dso" / view.name
            share = np.rint(vignette(view.parameters) * np.float32(0xFFFF))
            write_bytes(target / "vignette.png", png(share.astype(np.uint16)))
            text = dso_lens(view.parameters)
            if text:
                write_bytes(target / "camera.txt", text.encode())

    def _file(self, name: str, header: str) -> OutputFile:
        """Create a file that starts with a header."""
        file = OutputFile(self.path / name)
        file.write(header.encode() + b"\n")
        return file

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows and images by topic."""
        tables = {
            resolve_topic(IMU_TOPIC): self.rows["imu"],
            resolve_topic(TRUTH_TOPIC): self.rows["poses"],
        }
        return {**tables, **self._images.counts}

    def summary(self) -> str:
        """Return the amount of data written, as text."""
        readings = describe_amount(self.rows["imu"], self._last_ns, "rows")
        return f"{readings}, {self._images.summary()}"

    def write(self, window: WindowSamples) -> None:
        """Write the samples of a window, and request its images.

        :param window: samples by sensor, with the only IMU among them.
        """
        block: Samples = window[IMU]
        t_ns, gyro, accel = delivered_readings(block)
        readings = [t_ns, np.concatenate([gyro, accel], axis=1)]
        self._open["mav0/imu0/data.csv"].write(decimals.lines(readings))
        motion = block.motion
        position = motion.position + rotation.rotate(motion.q_wb, self._p_bi)
        q_wi = rotation.multiply(motion.q_wb, self._q_bi)
        # The poses of TUM VI are on the IMU's clock, too.
        poses = decimals.lines([block.t_ns, np.concatenate([position, q_wi], axis=1)])
        for name in ("mav0/mocap0/data.csv", "dso/gt_imu.csv"):
            self._open[name].write(poses)
        self.rows["imu"] += len(t_ns)
        self.rows["poses"] += len(block.true_t_ns)
        self._images.write(window)
        if len(block.true_t_ns):
            self._last_ns = int(block.true_t_ns[-1])

    def __enter__(self) -> "TumVi":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: object
    ) -> None:
        whole = kind is None or not issubclass(kind, Exception)
        try:
            self._images.__exit__(kind, error, trace)
        finally:
            for file in self._open.values():
                if whole:
                    file.finish()
                else:
                    file.abandon(empty=not self.rows["imu"])
        if whole:
            self._write_times()
            if self.rows["imu"]:
                self._write_dso_imu()

    def _write_times(self) -> None:
        """Write the stamps and exposures of each camera's images."""
        for number, view in enumerate(self._images.views):
            file = self._file(f"dso/{view.name}/times.txt", _DSO_TIMES)
            exposures = sorted(self._images.exposures(number))
            t_ns = np.array([t for t, _ in exposures], dtype=np.int64)
            names = [Path(image_name(t)).stem.encode() for t, _ in exposures]
            exposure = np.array([1e3 * seconds for _, seconds in exposures])
            file.write(decimals.lines([names, decimals.seconds(t_ns), exposure], " "))
            file.finish()

    def _write_dso_imu(self) -> None:
        """Write the readings with interpolated ones at the times of the images."""
        image_stamps = [
            t for k in range(len(self._images.views)) for t, _ in self._images.exposures(k)
        ]
        stamps = np.unique(np.array(image_stamps, dtype=np.int64))
        file = self._file("dso/imu.txt", _DSO_IMU)
        previous = (np.empty(0, dtype=np.int64), np.empty((0, 6)))
        table = self.path / "mav0" / "imu0" / "data.csv"
        for readings in text_reader.imu_blocks(table, skipped=lambda _: None):
            t_ns, values = readings.t_ns, np.concatenate(readings.triads(), axis=1)
            start_ns = previous[0][-1] + 1 if len(previous[0]) else t_ns[0]
            known_ns = np.concatenate([previous[0], t_ns])
            image_ns = stamps[(stamps >= start_ns) & (stamps <= t_ns[-1])]
            image_ns = image_ns[~np.isin(image_ns, t_ns)]
            known_values = np.concatenate([previous[1], values])
            image_values = interpolate_columns(known_ns, image_ns, known_values)
            order = np.argsort(np.concatenate([t_ns, image_ns]), kind="stable")
            rows = [
                np.concatenate([t_ns, image_ns])[order],
                np.concatenate([values, image_values])[order],
            ]
            file.write(decimals.lines(rows, " "))
            previous = (t_ns[-1:], values[-1:])
        file.finish()


def dso_lens(camera: CameraParameters) -> str | None:
    """Return a camera in DSO's form (util/Undistort.cpp); None for a sphere, which DSO lacks.

    The form has focal lengths and centre as shares of the image's size (the centre of the first
    pixel is at half a pixel), the size, the treatment of the borders, and the output size.
    """
    if camera.model != "pinhole":
        return None
    fx, fy, cx, cy = camera.intrinsics
    width, height = camera.width, camera.height
    shares = (fx / width, fy / height, (cx + 0.5) / width, (cy + 0.5) / height)
    name = "EquiDistant" if camera.distortion_model == "equidistant" else "RadTan"
    four = (*camera.distortion, 0.0, 0.0, 0.0, 0.0)[:4]
    size = f"{width} {height}"
    return f"{name} {' '.join(decimal(x) for x in (*shares, *four))}\n{size}\ncrop\n{size}\n"
