# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writing and reading of a folder of feature tracks."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import ImuSimError, InputError, system_error
from imu_sim_ros.core.types import AnyArray, Array, Integers, Mask
from imu_sim_ros.datasets.bodies import add_tables
from imu_sim_ros.datasets.columns import Column, Tables
from imu_sim_ros.inputs.rows import open_regular
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.camera.declaration import cameras_in
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig_parameters import load_rig, rig_parameters_of
from imu_sim_ros.sensors.camera.scene import read_points
from imu_sim_ros.sensors.camera.tracker import TrackedLines, Tracks
from imu_sim_ros.sensors.camera.view import view_of
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.topics import WindowSamples

TRACKS_HEADER: Final = "t_ns,camera,id,u,v,u_true,v_true,depth"
BODY_COLUMN: Final = ",body"
"""Column in scenes with moving bodies: number of the body; 0: at rest."""
LINES_HEADER: Final = "t_ns,camera,id,u1,v1,u2,v2,u1_true,v1_true,u2_true,v2_true"
LANDMARKS_HEADER: Final = "id,x,y,z"


class Blindness:
    """Time spans in which a camera sees no landmark."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.spans: list[list[float]] = []
        self._open = False

    def record(self, tracks: Tracks, t0_ns: int) -> None:
        """Record a block of frames; blocks come in order."""
        counts = np.bincount(tracks.frame, minlength=len(tracks.frames.number))
        times = (tracks.frames.true_t_ns - t0_ns) * 1e-9
        for t, count, delivered in zip(times, counts, tracks.frames.delivered, strict=True):
            if count or not delivered:
                self._open = self._open and not count
            elif self._open:
                self.spans[-1][1] = float(t)
            else:
                self.spans.append([float(t), float(t)])
                self._open = True

    def warnings(self) -> list[str]:
        """Return a line about the spans without landmarks; none if there are no such spans."""
        if not self.spans:
            return []
        spans = ", ".join(f"{a:.2f} to {b:.2f} s" for a, b in self.spans[:5])
        suffix = f" and {len(self.spans) - 5} more times" if len(self.spans) > 5 else ""
        return [f"{self.name}: no landmark in view from {spans}{suffix}"]


class TrackFiles:
    """Output of the tracks of all cameras in a folder; use as a context manager."""

    def __init__(
        self,
        folder: Path,
        sensors: Mapping[str, Mounted[MountedParameters]],
        world: World,
        warn: Callable[[str], object],
    ) -> None:
        """Open the tables, and write landmarks and cameras.

        :param folder: existing folder.
        :param sensors: sensors of the body.
        :param warn: receiver of the time spans without landmarks, at the end.
        """
        self._warn = warn
        cameras, scene = cameras_in(sensors), world.scene
        self._blindness = {name: Blindness(name) for name in cameras}
        self._t0_ns = world.t0_ns
        self._tables = Tables()
        self._moving = scene.crowd is not None
        header = TRACKS_HEADER + BODY_COLUMN if self._moving else TRACKS_HEADER
        self.tracks = self._tables.csv(folder / "tracks.csv", header)
        self._arrays = self._tables.npz(folder / "tracks.npz")
        self.lines = None
        if len(scene.lines):
            self.lines = self._tables.csv(folder / "lines.csv", LINES_HEADER)
        landmarks = self._tables.csv(folder / "landmarks.csv", LANDMARKS_HEADER)
        points = scene.landmarks
        landmarks.write(np.arange(len(points)), points)
        camera = next(iter(cameras.values()))
        add_tables(self._tables, folder, view_of(camera, world), scene)
        files.write(
            flatten(rig_parameters_of(camera.environment)),
            folder / "cameras.yaml",
            comment="The cameras of tracks.csv; a parameter file for generate.",
        )
        self._tables.mark_complete()

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows by table."""
        counts = {"tracks": self.tracks.rows}
        if self.lines is not None:
            counts["lines"] = self.lines.rows
        return counts

    def summary(self) -> str:
        """Return the number of tracks, as text; the frames of all cameras end at the same time."""
        return f"{self.tracks.rows:,} tracks"

    def write(self, window: WindowSamples) -> None:
        """Write the frames of a window, those of all cameras in order of time."""
        tracks: list[dict[str, Column]] = []
        lines: list[dict[str, Column]] = []
        for number, (name, blindness) in enumerate(self._blindness.items()):
            tracked: Tracks = window[name].tracks
            blindness.record(tracked, self._t0_ns)
            columns = _track_columns(tracked, number)
            tracks.append({**columns, "body": tracked.body} if self._moving else columns)
            if self.lines is not None:
                lines.append(_line_columns(tracked, window[name].lines, number))
        rows = _sort_by_time(tracks)
        names = np.array([name.encode() for name in self._blindness])
        self.tracks.write(
            rows["t_ns"],
            names[rows["camera"]],
            *(rows[key] for key in ("id", "uv", "uv_true", "depth", *["body"] * self._moving)),
        )
        self._arrays.write(rows)
        if self.lines is not None:
            rows = _sort_by_time(lines)
            ends = (rows["ends"], rows["ends_true"])
            self.lines.write(rows["t_ns"], names[rows["camera"]], rows["id"], *ends)
        self._tables.mark_complete()

    def __enter__(self) -> "TrackFiles":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._tables.__exit__(kind, error, trace)
        if error is None:
            for line in (
                line for blindness in self._blindness.values() for line in blindness.warnings()
            ):
                self._warn(line)


def _track_columns(tracks: Tracks, number: int) -> dict[str, Column]:
    """Return the features of one camera by the names of the arrays in tracks.npz."""
    frames = tracks.frames
    return {
        "t_ns": frames.t_ns[tracks.frame],
        "true_t_ns": frames.true_t_ns[tracks.frame],
        "camera": np.full(len(tracks.frame), number, dtype=np.int32),
        "frame": frames.number[tracks.frame],
        "id": tracks.id,
        "landmark": tracks.landmark,
        "uv": tracks.uv,
        "uv_true": tracks.uv_true,
        "depth": tracks.depth,
        "wrong": tracks.wrong,
    }


def _line_columns(tracks: Tracks, lines: TrackedLines, number: int) -> dict[str, Column]:
    """Return the columns of the table of tracked lines."""
    return {
        "t_ns": tracks.frames.t_ns[lines.frame],
        "true_t_ns": tracks.frames.true_t_ns[lines.frame],
        "camera": np.full(len(lines.frame), number, dtype=np.int32),
        "id": lines.id,
        "ends": lines.ends.reshape(-1, 4),
        "ends_true": lines.ends_true.reshape(-1, 4),
    }


def _sort_by_time(cameras: list[dict[str, Column]]) -> dict[str, Column]:
    """Return the rows of all cameras in order of true time; equal times in order of the cameras."""
    joined = {key: np.concatenate([rows[key] for rows in cameras]) for key in cameras[0]}
    order = np.argsort(joined["true_t_ns"], kind="stable")
    return {key: values[order] for key, values in joined.items()}


_COLUMNS: Final[dict[str, tuple[str, int]]] = {
    "true_t_ns": ("i", 1),
    "camera": ("i", 1),
    "landmark": ("i", 1),
    "uv": ("f", 2),
    "wrong": ("b", 1),
}
"""Kind and dimensions of each array of tracks.npz that is read."""


class TrackFolder(NamedTuple):
    """Contents of a folder of ``generate --format tracks``: n features in order of time."""

    cameras: dict[str, CameraParameters]
    landmarks: Array
    """(m, 3) landmarks p_w [m]."""
    true_t_ns: Integers
    """(n,) middle of the exposure [ns]."""
    camera: Integers
    """(n,) index of the camera in ``cameras``."""
    landmark: Integers
    """(n,) row of the observed landmark in ``landmarks``."""
    uv: Array
    """(n, 2) measured pixel."""
    wrong: Mask
    """(n,) True for an outlier, or the pixel of another feature."""


def read_track_folder(folder: Path) -> TrackFolder:
    """Return cameras, landmarks and features of a folder.

    :raises InputError: for a folder that ``generate --format tracks`` did not write.
    :raises ConfigurationError: for a cameras.yaml that describes none.
    """
    path = folder / "tracks.npz"
    cameras = load_rig(files.load(folder / "cameras.yaml")).camera_parameters()
    landmarks = read_points(folder / "landmarks.csv")
    columns = _arrays(path)
    for name, count in (("camera", len(cameras)), ("landmark", len(landmarks))):
        values = columns[name]
        if len(values) and not (values.min() >= 0 and values.max() < count):
            raise InputError(f"{path}: {name}: must be 0 to {count - 1}")
    return TrackFolder(cameras, landmarks, **columns)


def _arrays(path: Path) -> dict[str, AnyArray]:
    """Return the arrays of a file of tracks."""
    try:
        with open_regular(path) as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in _COLUMNS}
            moves = archive["body"] != 0 if "body" in archive else np.zeros(0, np.bool_)
    except ImuSimError:
        raise
    except OSError as error:
        raise system_error(path, error) from None
    except Exception as error:  # zipfile and NumPy raise many types for a broken file
        raise InputError(f"{path}: is not the tracks.npz of generate ({error})") from None
    count = len(arrays["uv"]) if arrays["uv"].ndim else 0
    for name, (kind, dimensions) in _COLUMNS.items():
        shape = (count, 2) if dimensions == 2 else (count,)
        if arrays[name].dtype.kind != kind or arrays[name].shape != shape:
            raise InputError(f"{path}: {name}: {arrays[name].dtype} {arrays[name].shape}")
    if not np.isfinite(arrays["uv"]).all():
        raise InputError(f"{path}: uv: must be finite")
    if len(moves) == count:
        return {name: values[~moves] for name, values in arrays.items()}
    return arrays
