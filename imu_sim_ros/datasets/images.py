# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images of cameras as PNG files: EuRoC/ASL folders, and those of kalibr_bagcreater.

``euroc``: ``cam0/data/<stamp>.png``, ``cam0/data.csv``, ``cam0/sensor.yaml``, and ``cam0/depth``,
with bodies that move also ``cam0/mask``, if depth is asked for, and ``cam0/flow``. ``csv``:
``cam0/<stamp>.png`` next to imu0.csv, as kalibr_bagcreater takes it. Threads make the
images; OpenCV and NumPy let them run side by side.
"""

import io
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.outputs import write_bytes
from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.bags.writer import amount
from imu_sim_ros.conventions import IMAGE_TOPIC
from imu_sim_ros.datasets.bodies import add_tables
from imu_sim_ros.datasets.columns import Tables
from imu_sim_ros.datasets.tracks import CameraProgress
from imu_sim_ros.errors import InputError, system_error
from imu_sim_ros.sensors.camera.images.files import png
from imu_sim_ros.sensors.camera.images.flow import kitti_flow
from imu_sim_ros.sensors.camera.images.imager import imagers
from imu_sim_ros.sensors.camera.images.renderer import opencv
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig import Rig
from imu_sim_ros.types import Array, Bytes, Single

EUROC_HEADER: Final = "#timestamp [ns],filename"
DEPTH_FOLDER: Final = "depth"
MASK_FOLDER: Final = "mask"
FLOW_FOLDER: Final = "flow"
_AHEAD: Final = 4
"""Images in progress for each thread."""
LATEST_NS: Final = 2**63 - 1
_MILLIMETRES: Final = 1000.0
_DISTORTIONS: Final = {"none": "none", "radtan": "radial-tangential", "equidistant": "equidistant"}


class ImageFolders:
    """The images of all cameras in a folder; use as a context manager."""

    def __init__(self, folder: Path, rig: Rig, form: str, jobs: int, comment: str) -> None:
        """Make the folders.

        :param folder: that exists.
        :param form: euroc; tum_vi, which has grey values of 16 bits and no descriptions of sensors;
            or csv.
        :param jobs: threads.
        :param comment: for the sensors' descriptions.
        :raises ConfigurationError: for a scene without surfaces.
        :raises MissingDependencyError: if OpenCV is not installed.
        """
        self._cv2 = opencv()
        self._cv2.setNumThreads(1)  # the threads are ours
        views = {n: view for n, view in rig.views.items() if view.parameters.images != "none"}
        made = imagers(views, rig.scene, rig.parameters.scene, rig.trajectory)
        self.cameras = [CameraProgress(rig, name) for name in views]
        self._imagers = list(made.values())
        self._frames: list[list[tuple[int, int]]] = [[] for _ in self.cameras]
        self._folder, self._tables, self._deep = folder, form != "csv", form == "tum_vi"
        self._further = (DEPTH_FOLDER, MASK_FOLDER) if rig.scene.crowd else (DEPTH_FOLDER,)
        """Folders of the truth of each pixel, if it is wanted."""
        self._pool = ThreadPoolExecutor(jobs, thread_name_prefix="images")
        self._waiting: deque[Future[None]] = deque()
        self._most = _AHEAD * jobs
        for camera in self.cameras:
            place = self._place(camera.name)
            folders = [place]
            if self._has_depth(camera):
                folders += [place.parent / name for name in self._further]
            if self._flow(camera) != "none":
                folders.append(place.parent / FLOW_FOLDER)
            for made_folder in folders:
                try:
                    made_folder.mkdir(parents=True)
                except OSError as error:
                    raise system_error(made_folder, error) from None
            if form == "euroc":
                text = _sensor_yaml(camera.view.parameters, comment)
                (place.parent / "sensor.yaml").write_text(text, encoding="utf-8")
        with Tables() as tables:
            add_tables(tables, folder, rig)

    @property
    def counts(self) -> dict[str, int]:
        """Images by camera."""
        return {
            f"/{camera.name}/{IMAGE_TOPIC}": len(frames)
            for camera, frames in zip(self.cameras, self._frames, strict=True)
        }

    def exposures(self, camera: int) -> Iterator[tuple[int, float]]:
        """Yield stamp [ns] and exposure time [s] of each image of a camera, by its number."""
        for number, t_ns in self._frames[camera]:
            yield t_ns, self._imagers[camera].exposure(number)

    def vignette(self, camera: int) -> Single:
        """Return the share of the light that each pixel of a camera gets (h, w)."""
        return self._imagers[camera].vignette

    def _has_depth(self, camera: CameraProgress) -> bool:
        return self._tables and camera.view.parameters.depth

    def _flow(self, camera: CameraProgress) -> str:
        """Return the form of the flow of a camera, as ``camera.flow`` names it."""
        return camera.view.parameters.flow if self._tables else "none"

    def until(self, t_ns: int) -> None:
        """Request all images taken before a time [ns], those of all cameras in order of time."""
        end = -1
        while end < t_ns:
            end = min([t_ns, *(camera.block_end() for camera in self.cameras)])
            due = []
            for number, camera in enumerate(self.cameras):
                frames = camera.view.frames(camera.position, camera.until(end))
                camera.position += len(frames.number)
                rows = np.stack([frames.true_t_ns, frames.number, frames.t_ns], axis=1)
                due += [(t, number, *row) for t, *row in rows[frames.delivered].tolist()]
            for _, number, *frame in sorted(due):
                self._order(number, *frame)

    def _order(self, camera: int, number: int, t_ns: int) -> None:
        while len(self._waiting) >= self._most:
            self._waiting.popleft().result()
        path = self._place(self.cameras[camera].name) / image_name(t_ns)
        self._frames[camera].append((number, t_ns))
        self._waiting.append(self._pool.submit(self._make, camera, number, path))

    def _make(self, camera: int, number: int, path: Path) -> None:
        image: NDArray[Any] = self._imagers[camera].image(number)
        write_png(path, in_16_bits(image) if self._deep and image.ndim == 2 else image)
        if self._has_depth(self.cameras[camera]):
            depth, mask = self._imagers[camera].depth_and_mask(number)
            for folder, each in ((DEPTH_FOLDER, millimetres(depth)), (MASK_FOLDER, mask)):
                if each is not None:
                    write_png(path.parents[1] / folder / path.name, each)
        form = self._flow(self.cameras[camera])
        if form != "none":
            steps = self._imagers[camera].flow(number)
            place = path.parents[1] / FLOW_FOLDER / path.name
            if form == "kitti":
                write_png(place, kitti_flow(steps))
            else:
                content = io.BytesIO()
                np.save(content, steps)
                write_bytes(place.with_suffix(".npy"), content.getvalue())

    def _place(self, name: str) -> Path:
        return self._folder / name / "data" if self._tables else self._folder / name

    def __enter__(self) -> "ImageFolders":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        failed = error is not None and isinstance(error, Exception)
        try:
            while self._waiting and not failed:
                self._waiting.popleft().result()
        finally:
            self._pool.shutdown(cancel_futures=True)
        if error is not None and not failed:
            self._cut()
        if self._tables and not failed:
            for camera, frames in zip(self.cameras, self._frames, strict=True):
                write_table(self._folder / camera.name, [t_ns for _, t_ns in frames])

    def _cut(self) -> None:
        """Drop what an interruption left some cameras with and others without."""
        ends = []
        for camera, frames in zip(self.cameras, self._frames, strict=True):
            there = [n for n, t_ns in frames if self._file(camera, t_ns).is_file()]
            following = there[-1] + 1 if there else 0
            if camera.view.total is None or following < camera.view.total:
                ends.append(int(camera.view.frames(following, 1).true_t_ns[0]))
        end = min(ends, default=LATEST_NS)
        for number, camera in enumerate(self.cameras):
            kept = []
            for n, t_ns in self._frames[number]:
                path = self._file(camera, t_ns)
                if path.is_file() and camera.view.frames(n, 1).true_t_ns[0] < end:
                    kept.append((n, t_ns))
                    continue
                path.unlink(missing_ok=True)
                for folder in (*self._further, FLOW_FOLDER):
                    beside = path.parents[1] / folder / path.name
                    for file in (beside, beside.with_suffix(".npy")):
                        file.unlink(missing_ok=True)
            self._frames[number] = kept

    def _file(self, camera: CameraProgress, t_ns: int) -> Path:
        return self._place(camera.name) / image_name(t_ns)

    def described(self) -> str:
        """Return how many images each camera has, and until when."""
        return ", ".join(
            amount(len(frames), frames[-1][1] if frames else -1, f"images of {camera.name}")
            for camera, frames in zip(self.cameras, self._frames, strict=True)
        )


def image_name(t_ns: int) -> str:
    """Return the name of an image: its stamp [ns] in 19 digits, so that names sort by time.

    :raises InputError: for a stamp before 0, which no width sorts.
    """
    if t_ns < 0:
        raise InputError(
            f"an image at {t_ns * 1e-9:.9g} s, before 0: names of images are stamps; with a "
            "camera.time_offset the start_time has to be later than it"
        )
    return f"{t_ns:019d}.png"


def write_table(folder: Path, stamps: Iterable[int]) -> None:
    """Write data.csv of a camera: the images' stamps [ns] in the digits of their names, and those.

    :raises ImuSimError: if it cannot be written, with the reason.
    """
    path = folder / "data.csv"
    try:
        with path.open("w", encoding="utf-8") as file:
            file.write(EUROC_HEADER + "\n")
            names = sorted(map(image_name, stamps))
            file.writelines(f"{name.removesuffix('.png')},{name}\n" for name in names)
    except OSError as error:
        raise system_error(path, error) from None


def millimetres(depth: Single) -> NDArray[np.uint16]:
    """Return depths (h, w) [m] as REP 118 has them in 16 bits; 0 for what is beyond 65.5 m."""
    rounded = np.rint(depth * np.float32(_MILLIMETRES))
    return np.where(rounded <= np.iinfo(np.uint16).max, rounded, 0.0).astype(np.uint16)


def in_16_bits(image: Bytes) -> NDArray[np.uint16]:
    """Return grey values (h, w) in 16 bits; what reads 8 of them gets the same values."""
    return image.astype(np.uint16) * np.uint16(256)


def write_png(path: Path, image: NDArray[Any]) -> None:
    """Write an image (h, w), or (h, w, 3) in red, green and blue.

    :raises ImuSimError: if it cannot be written, with the reason.
    """
    write_bytes(path, png(image))


def _sensor_yaml(camera: CameraParameters, comment: str) -> str:
    """Return EuRoC's description of a camera."""
    model = CameraModel(camera)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = camera.pose()
    k = (*camera.distortion, 0.0, 0.0, 0.0, 0.0)[: max(4, len(camera.distortion))]
    intrinsics = ", ".join(decimal(x) for x in (model.fx, model.fy, model.cx, model.cy))
    shape = {"unified": f"xi: {decimal(camera.xi)}\n"}.get(camera.model, "")
    if camera.model == "double_sphere":
        shape = f"xi: {decimal(camera.xi)}\nalpha: {decimal(camera.alpha)}\n"
    return (
        f"# Camera\nsensor_type: camera\ncomment: {comment}\n\n"
        "# T_BS maps points of the camera into the body.\n"
        f"{pose_text(matrix)}\n"
        f"rate_hz: {camera.rate:g}\nresolution: [{camera.width}, {camera.height}]\n"
        f"camera_model: {camera.model}\n{shape}intrinsics: [{intrinsics}] # fu, fv, cu, cv\n"
        f"distortion_model: {_DISTORTIONS[camera.distortion_model]}\n"
        f"distortion_coefficients: [{', '.join(decimal(x) for x in k)}]\n"
    )


def pose_text(matrix: Array) -> str:
    """Return T_BS (4, 4) as EuRoC's descriptions of sensors have it."""
    rows = ",\n         ".join(", ".join(decimal(value) for value in row) for row in matrix)
    return f"T_BS:\n  cols: 4\n  rows: 4\n  data: [{rows}]\n"
