# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images of cameras as PNG files: EuRoC/ASL folders, and those of kalibr_bagcreater.

``euroc``: ``cam0/data/<stamp>.png``, ``cam0/data.csv``, ``cam0/sensor.yaml``, and ``cam0/depth``,
with moving bodies also ``cam0/mask``, if depth is asked for, and ``cam0/flow``. ``csv``:
``cam0/<stamp>.png`` next to imu0.csv, as kalibr_bagcreater takes it. Threads make the
images; OpenCV and NumPy let them run side by side.
"""

import io
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, wait
from pathlib import Path
from threading import Lock
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.outputs import write_bytes
from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.bags.writer import describe_amount
from imu_sim_ros.core.conventions import DEPTH_TOPIC, FLOW_TOPIC, IMAGE_TOPIC
from imu_sim_ros.core.errors import InputError, system_error
from imu_sim_ros.core.types import Bytes, Single
from imu_sim_ros.datasets.bodies import add_tables
from imu_sim_ros.datasets.columns import Tables
from imu_sim_ros.datasets.recorded import DEPTH_FOLDER, pose_text
from imu_sim_ros.sensors.camera.declaration import cameras_in
from imu_sim_ros.sensors.camera.images.files import png
from imu_sim_ros.sensors.camera.images.flow import kitti_flow
from imu_sim_ros.sensors.camera.images.libraries import numba, opencv
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig_parameters import rig_parameters_of
from imu_sim_ros.sensors.camera.scene_parameters import check_surfaces
from imu_sim_ros.sensors.camera.view import View, view_of
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.topics import WindowSamples

EUROC_HEADER: Final = "#timestamp [ns],filename"
MASK_FOLDER: Final = "mask"
FLOW_FOLDER: Final = "flow"
_LONGEST_END: Final = 1.0
"""Time to wait for images under way after an interruption [s]."""
_AHEAD: Final = 4
"""Number of images in progress for each thread."""
LATEST_NS: Final = 2**63 - 1
"""Time after all others [ns]."""
_MILLIMETRES: Final = 1000.0
"""Units of a depth image in a metre."""
_DISTORTIONS: Final = {"none": "none", "radtan": "radial-tangential", "equidistant": "equidistant"}


class _Frame(NamedTuple):
    """Frame whose image is requested."""

    true_t_ns: int
    camera: int
    number: int
    t_ns: int
    row: int
    """Row of the frame in its block of samples."""


class ImageFolders:
    """The images of all cameras in a folder; use as a context manager."""

    def __init__(
        self,
        folder: Path,
        sensors: Mapping[str, Mounted[MountedParameters]],
        world: World,
        form: str,
        jobs: int,
        warn: Callable[[str], object],
    ) -> None:
        """Make the folders.

        :param folder: existing folder.
        :param sensors: sensors of the body.
        :param world: world with threads.
        :param form: euroc; tum_vi, which has grey values of 16 bits and no descriptions of sensors;
            or csv.
        :param jobs: number of threads.
        :param warn: receives a line for each camera of which nothing is written.
        :raises ConfigurationError: for a scene without surfaces.
        :raises MissingDependencyError: if OpenCV or numba is not installed.
        """
        opencv()
        numba()
        assert world.threads is not None
        self._threads, self._max_pending = world.threads, _AHEAD * jobs
        self._folder, self._tables, self._has_16_bits = folder, form != "csv", form == "tum_vi"
        all_cameras = cameras_in(sensors)
        cameras = {
            name: camera for name, camera in all_cameras.items() if self._outputs(camera.parameters)
        }
        for name in all_cameras:
            if name not in cameras:
                depth = "" if form == "csv" else ", depth and flow"
                warn(f"{name}: images{depth} are switched off: nothing of it is written")
        if cameras:
            check_surfaces(rig_parameters_of(next(iter(cameras.values())).environment).scene)
        self.views = [view_of(camera, world) for camera in cameras.values()]
        self._frames: list[list[_Frame]] = [[] for _ in self.views]
        self._exposures: list[list[tuple[int, float]]] = [[] for _ in self.views]
        self._truth_folders = (DEPTH_FOLDER, MASK_FOLDER) if world.scene.crowd else (DEPTH_FOLDER,)
        """Folders of the truth of each pixel, if it is wanted."""
        self._pending: deque[Future[None]] = deque()
        self._lock = Lock()
        self._is_closed = False
        """True after an interruption: no further file is written."""
        for view in self.views:
            self._make_camera_folders(view)
            if form == "euroc":
                comment = f"simulated by imu_sim_ros, seed {world.environment.seed}"
                text = _sensor_yaml(view.parameters, comment)
                (folder / view.name / "sensor.yaml").write_text(text, encoding="utf-8")
        # All cameras see the same scene: its tables are written once.
        any_camera = next(iter(all_cameras.values()))
        with Tables() as tables:
            add_tables(tables, folder, view_of(any_camera, world), world.scene)

    def _make_camera_folders(self, view: View) -> None:
        """Make the folders of a camera's images, depth, masks and flow.

        :raises InputError: for a folder that cannot be made.
        """
        outputs = self._outputs(view.parameters)
        if DEPTH_FOLDER in outputs:
            outputs += self._truth_folders[1:]
        for output in outputs:
            target = self._folder / view.name / output
            try:
                target.mkdir(parents=True)
            except OSError as error:
                raise system_error(target, error) from None

    @property
    def counts(self) -> dict[str, int]:
        """Frames by the topic of their images, or of their depth or flow if there are none."""
        topics = {DEPTH_FOLDER: DEPTH_TOPIC, FLOW_FOLDER: FLOW_TOPIC}
        return {
            f"/{view.name}/{topics.get(self._outputs(view.parameters)[0], IMAGE_TOPIC)}": len(
                frames
            )
            for view, frames in zip(self.views, self._frames, strict=True)
        }

    def exposures(self, camera: int) -> list[tuple[int, float]]:
        """Return stamp [ns] and exposure time [s] of each image of a camera, by its number."""
        stamps = {frame.t_ns for frame in self._frames[camera]}
        return [exposure for exposure in self._exposures[camera] if exposure[0] in stamps]

    def _outputs(self, camera: CameraParameters) -> tuple[str, ...]:
        """Return the folders below that of a camera for its images, depth and flow, if wanted."""
        images = ("data" if self._tables else "",)
        return (
            *(images if camera.images != "none" else ()),
            *((DEPTH_FOLDER,) if self._tables and camera.depth else ()),
            *((FLOW_FOLDER,) if self._tables and camera.flow != "none" else ()),
        )

    def write(self, window: WindowSamples) -> None:
        """Request the images of a window, those of all cameras in order of time."""
        frames = []
        for camera, view in enumerate(self.views):
            samples = window[view.name]
            for row in samples.delivered.tolist():
                true_t_ns, t_ns = int(samples.true_t_ns[row]), int(samples.t_ns[row])
                frames.append(_Frame(true_t_ns, camera, samples.first + row, t_ns, row))
        for frame in sorted(frames):
            while len(self._pending) >= self._max_pending:
                self._pending.popleft().result()
            path, samples = self._file(frame), window[self.views[frame.camera].name]
            self._frames[frame.camera].append(frame)
            if self._has_16_bits:
                exposure = frame.t_ns, samples.exposure[frame.row]
                self._exposures[frame.camera].append(exposure)
            self._pending.append(self._threads.submit(self._make, frame, samples, path))

    def _make(self, frame: _Frame, samples: Samples, path: Path) -> None:
        """Write the image, depth, segmentation and flow of one frame."""
        camera = self.views[frame.camera].parameters
        if camera.images != "none":
            image: Bytes = samples.image[frame.row]
            pixels = widen_to_16_bits(image) if self._has_16_bits and image.ndim == 2 else image
            self._write_file(path, png(pixels))
        outputs = self._outputs(camera)
        if DEPTH_FOLDER in outputs:
            depth, mask = samples.depth_and_mask[frame.row]
            for folder, values in ((DEPTH_FOLDER, millimetres(depth)), (MASK_FOLDER, mask)):
                if values is not None:
                    self._write_file(path.parents[1] / folder / path.name, png(values))
        if FLOW_FOLDER in outputs:
            steps = samples.flow[frame.row]
            target = path.parents[1] / FLOW_FOLDER / path.name
            if camera.flow == "kitti":
                self._write_file(target, png(kitti_flow(steps)))
            else:
                content = io.BytesIO()
                np.save(content, steps)
                self._write_file(target.with_suffix(".npy"), content.getvalue())

    def _write_file(self, path: Path, data: bytes) -> None:
        """Write a whole file, unless the output has been closed by an interruption."""
        with self._lock:
            if self._is_closed:
                raise KeyboardInterrupt
            write_bytes(path, data)

    def __enter__(self) -> "ImageFolders":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        failed = error is not None and isinstance(error, Exception)
        try:
            if error is not None and not failed:  # what is complete is kept
                running = [future for future in self._pending if not future.cancel()]
                wait(running, _LONGEST_END)
                with self._lock:
                    self._is_closed = True
                self._pending.clear()
            while self._pending and not failed:
                self._pending.popleft().result()
        finally:
            for future in self._pending:
                future.cancel()
        if error is not None and not failed:
            self._cut()
        if self._tables and not failed:
            for view, frames in zip(self.views, self._frames, strict=True):
                if view.parameters.images != "none":
                    write_table(self._folder / view.name, [frame.t_ns for frame in frames])

    def _cut(self) -> None:
        """Drop the frames after an interruption that not all cameras have."""
        ends = []
        for view, frames in zip(self.views, self._frames, strict=True):
            # A later image may have been started while an earlier one was cancelled.
            missing = [frame.true_t_ns for frame in frames if not self._file(frame).is_file()]
            following = frames[-1].number + 1 if frames else 0
            if missing:
                ends.append(missing[0])
            elif view.total is None or following < view.total:
                ends.append(int(view.frames(following, 1).true_t_ns[0]))
        end = min(ends, default=LATEST_NS)
        for number, frames in enumerate(self._frames):
            complete = []
            for frame in frames:
                path = self._file(frame)
                if frame.true_t_ns < end:
                    complete.append(frame)
                    continue
                path.unlink(missing_ok=True)
                for folder in (*self._truth_folders, FLOW_FOLDER) if self._tables else ():
                    companion = path.parents[1] / folder / path.name
                    for file in (companion, companion.with_suffix(".npy")):
                        file.unlink(missing_ok=True)
            self._frames[number] = complete

    def _file(self, frame: _Frame) -> Path:
        """Return the file of a frame in the first of its camera's folders."""
        view = self.views[frame.camera]
        output = self._outputs(view.parameters)[0]
        path = self._folder / view.name / output / image_name(frame.t_ns)
        is_array = output == FLOW_FOLDER and view.parameters.flow != "kitti"
        return path.with_suffix(".npy") if is_array else path

    def summary(self) -> str:
        """Return the number of images of each camera and their end, as text."""
        return ", ".join(
            describe_amount(
                len(frames), frames[-1].t_ns if frames else -1, f"images of {view.name}"
            )
            for view, frames in zip(self.views, self._frames, strict=True)
        )


def image_name(t_ns: int) -> str:
    """Return the file name of an image: its stamp [ns] in 19 digits, so that names sort by time.

    :raises InputError: for a negative stamp, which does not sort.
    """
    if t_ns < 0:
        raise InputError(
            f"an image at {t_ns * 1e-9:.9g} s, before 0: names of images are stamps; with a "
            "camera.time_offset the start_time has to be later than it"
        )
    return f"{t_ns:019d}.png"


def write_table(folder: Path, stamps: Iterable[int]) -> None:
    """Write data.csv of a camera: the stamps of the images [ns], and their file names.

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
    """Return depths (h, w) [m] in millimetres, 16 bits (REP 118); 0 beyond 65.5 m."""
    rounded = np.rint(depth * np.float32(_MILLIMETRES))
    return np.where(rounded <= np.iinfo(np.uint16).max, rounded, 0.0).astype(np.uint16)


def widen_to_16_bits(image: Bytes) -> NDArray[np.uint16]:
    """Return grey values (h, w) in 16 bits, the upper 8 of which are the given ones."""
    return image.astype(np.uint16) * np.uint16(256)


def _sensor_yaml(camera: CameraParameters, comment: str) -> str:
    """Return EuRoC's description of a camera."""
    model = CameraModel(camera)
    matrix = camera.mount()
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
