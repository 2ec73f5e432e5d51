# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The folder of a TUM VI sequence, as exported for EuRoC's and DSO's readers.

Schubert et al., The TUM VI Benchmark (IROS 2018): ``mav0/camN`` and ``mav0/imu0`` as in EuRoC,
``mav0/mocap0/data.csv`` the poses of the IMU, no sensor.yaml; ``dso/imu.txt``, ``dso/gt_imu.csv``
(the same poses), and ``dso/camN`` with ``times.txt`` (name, seconds, exposure in ms) and the
images. The original has 16-bit images, and rows in imu.txt that are interpolated at the images'
times; here images have 8 bits, and readings are at the times of images where ``camera.trigger`` is
synchronised.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.bags import OutputFile, amount, make_folder
from imu_sim_ros.bags.text import decimals
from imu_sim_ros.bags.text.writer import EUROC_IMU_HEADER
from imu_sim_ros.camera import Rig
from imu_sim_ros.config import ImuParameters
from imu_sim_ros.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.datasets.images import ImageFolders
from imu_sim_ros.sensor import ImuBlock
from imu_sim_ros.topics import delivered

Array = NDArray[np.float64]

_POSES: Final = (
    "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
    "q_RS_z []"
)
_DSO_IMU: Final = "# timestamp[ns] w.x w.y w.z a.x a.y a.z"
_DSO_POSES: Final = "# timestamp[ns],tx,ty,tz,qw,qx,qy,qz"
_DSO_TIMES: Final = "# filename timestamp[s] exposure[ms]"


class TumVi:
    """A sequence that is being written; use as a context manager."""

    block_size: Final = 512
    """Samples in a block at most: frames take far longer, and the progress bar should move."""

    def __init__(self, folder: Path, rig: Rig, imu: ImuParameters, jobs: int) -> None:
        """Make the folders.

        :param imu: where it is on the body, whose motion is known.
        :param jobs: threads that make images.
        """
        make_folder(folder)
        self.path = folder
        self.rows, self._last_ns = {"imu": 0, "poses": 0}, -1
        self._q_bi = rotation.from_matrix(np.reshape(imu.mounting, (3, 3)))
        self._p_bi = np.asarray(imu.lever_arm)
        for below in ("mav0/imu0", "mav0/mocap0", "dso"):
            (folder / below).mkdir(parents=True)
        self._open = {
            name: self._file(name, header)
            for name, header in (
                ("mav0/imu0/data.csv", EUROC_IMU_HEADER),
                ("dso/imu.txt", _DSO_IMU),
                ("mav0/mocap0/data.csv", _POSES),
                ("dso/gt_imu.csv", _DSO_POSES),
            )
        }
        self._images = ImageFolders(folder / "mav0", rig, "tum_vi", jobs, "")
        for camera in rig.views:
            place = folder / "dso" / camera
            place.mkdir()
            (place / "images").symlink_to(f"../../mav0/{camera}/data")

    def _file(self, name: str, header: str) -> OutputFile:
        file = OutputFile(self.path / name)
        file.write(header.encode() + b"\n")
        return file

    @property
    def files(self) -> list[Path]:
        """All files, images once."""
        return [file for file in self.path.rglob("*") if file.is_file()]

    @property
    def counts(self) -> dict[str, int]:
        """Rows and images by topic."""
        own = {f"/{IMU_TOPIC}": self.rows["imu"], f"/{TRUTH_TOPIC}": self.rows["poses"]}
        return {**own, **self._images.counts}

    def described(self) -> str:
        """Return how much was written."""
        return amount(self.rows["imu"], self._last_ns, "rows")

    def write(self, blocks: Mapping[str, ImuBlock]) -> None:
        """Write the samples of a window, and request the images taken until its end.

        :param blocks: that of the only IMU, whose name is empty.
        """
        block = blocks[""]
        t_ns, gyro, accel = delivered(block)
        readings = [t_ns, np.concatenate([gyro, accel], axis=1)]
        self._open["mav0/imu0/data.csv"].write(decimals.lines(readings))
        self._open["dso/imu.txt"].write(decimals.lines(readings, " "))
        motion = block.motion
        position = motion.position + rotation.rotate(motion.q_wb, self._p_bi)
        q_wi = rotation.multiply(motion.q_wb, self._q_bi)
        poses = decimals.lines([block.true_t_ns, np.concatenate([position, q_wi], axis=1)])
        for name in ("mav0/mocap0/data.csv", "dso/gt_imu.csv"):
            self._open[name].write(poses)
        self.rows["imu"] += len(t_ns)
        self.rows["poses"] += len(block.true_t_ns)
        if len(block.true_t_ns):
            self._last_ns = int(block.true_t_ns[-1])
            self._images.until(self._last_ns + 1)

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

    def _write_times(self) -> None:
        for number, camera in enumerate(self._images.cameras):
            file = self._file(f"dso/{camera.name}/times.txt", _DSO_TIMES)
            found = list(self._images.exposures(number))
            t_ns = np.array([t for t, _ in found], dtype=np.int64)
            exposure = np.array([1e3 * seconds for _, seconds in found])
            file.write(decimals.lines([t_ns, decimals.seconds(t_ns), exposure], " "))
            file.finish()
