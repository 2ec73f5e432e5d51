# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A folder of feature tracks, written and read."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.datasets.bodies import add_tables
from imu_sim_ros.datasets.columns import Column, Tables
from imu_sim_ros.errors import ImuSimError, InputError, system_error
from imu_sim_ros.inputs.rows import open_regular
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.camera.declaration import cameras_in
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig_parameters import load_rig
from imu_sim_ros.sensors.camera.scene import read_points
from imu_sim_ros.sensors.camera.tracker import TrackedLines, Tracks
from imu_sim_ros.sensors.camera.view import view_of
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.topics import Read
from imu_sim_ros.types import Array, Integers, Mask

TRACKS_HEADER: Final = "t_ns,camera,id,u,v,u_true,v_true,depth"
BODY_COLUMN: Final = ",body"
"""In scenes in which something moves; 0: at rest."""
LINES_HEADER: Final = "t_ns,camera,id,u1,v1,u2,v2,u1_true,v1_true,u2_true,v2_true"
LANDMARKS_HEADER: Final = "id,x,y,z"


class Blindness:
    """Where a camera sees nothing: the time spans without any landmark."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.spans: list[list[float]] = []
        self._open = False

    def look(self, tracks: Tracks, t0_ns: int) -> None:
        """Record a block of frames; blocks come in order."""
        counts = np.bincount(tracks.frame, minlength=len(tracks.frames.number))
        times = (tracks.frames.true_t_ns - t0_ns) * 1e-9
        for t, count, there in zip(times, counts, tracks.frames.delivered, strict=True):
            if count or not there:
                self._open = self._open and not count
            elif self._open:
                self.spans[-1][1] = float(t)
            else:
                self.spans.append([float(t), float(t)])
                self._open = True

    def warnings(self) -> list[str]:
        """Return a line for the spans without landmarks; nothing if there are none."""
        if not self.spans:
            return []
        shown = ", ".join(f"{a:.2f} to {b:.2f} s" for a, b in self.spans[:5])
        more = f" and {len(self.spans) - 5} more times" if len(self.spans) > 5 else ""
        return [f"{self.name}: no landmark in view from {shown}{more}"]


class TrackFiles:
    """The tracks of all cameras in a folder; use as a context manager."""

    def __init__(
        self,
        folder: Path,
        sensors: Mapping[str, Mounted],
        world: World,
        warn: Callable[[str], object],
    ) -> None:
        """Open the tables, and write landmarks and cameras.

        :param folder: that exists.
        :param sensors: of the body.
        :param warn: receives, in the end, when a camera saw nothing.
        """
        self._warn = warn
        cameras, scene = cameras_in(sensors), world.scene
        self._blindness = {name: Blindness(name) for name in cameras}
        self._t0_ns = world.t0_ns
        self._tables = Tables()
        self._moving = scene.crowd is not None
        header = TRACKS_HEADER + BODY_COLUMN * self._moving
        self.tracks = self._tables.csv(folder / "tracks.csv", header)
        self._arrays = self._tables.npz(folder / "tracks.npz")
        self.lines = None
        if len(scene.lines):
            self.lines = self._tables.csv(folder / "lines.csv", LINES_HEADER)
        landmarks = self._tables.csv(folder / "landmarks.csv", LANDMARKS_HEADER)
        points = scene.landmarks
        landmarks.write(np.arange(len(points)), points)
        first = next(iter(cameras.values()))
        add_tables(self._tables, folder, view_of(first, world), scene)
        files.write(
            flatten(first.environment.rig),
            folder / "cameras.yaml",
            comment="The cameras of tracks.csv; a parameter file for generate.",
        )
        self._tables.whole()

    @property
    def counts(self) -> dict[str, int]:
        """Rows by table."""
        result = {"tracks": self.tracks.rows}
        if self.lines is not None:
            result["lines"] = self.lines.rows
        return result

    def described(self) -> str:
        """Return how much was written; all cameras' frames end at the same time."""
        return f"{self.tracks.rows:,} tracks"

    def write(self, read: Read) -> None:
        """Write the frames of a window, those of all cameras in order of time."""
        tracks: list[dict[str, Column]] = []
        lines: list[dict[str, Column]] = []
        for number, (name, blindness) in enumerate(self._blindness.items()):
            found: Tracks = read[name].tracks
            blindness.look(found, self._t0_ns)
            columns = _track_columns(found, number)
            tracks.append({**columns, "body": found.body} if self._moving else columns)
            if self.lines is not None:
                lines.append(_line_columns(found, read[name].lines, number))
        rows = _in_order(tracks)
        names = np.array([name.encode() for name in self._blindness])
        self.tracks.write(
            rows["t_ns"],
            names[rows["camera"]],
            *(rows[key] for key in ("id", "uv", "uv_true", "depth", *["body"] * self._moving)),
        )
        self._arrays.write(rows)
        if self.lines is not None:
            rows = _in_order(lines)
            ends = (rows["ends"], rows["ends_true"])
            self.lines.write(rows["t_ns"], names[rows["camera"]], rows["id"], *ends)
        self._tables.whole()

    def __enter__(self) -> "TrackFiles":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._tables.__exit__(kind, error, trace)
        if error is None:
            for line in (line for one in self._blindness.values() for line in one.warnings()):
                self._warn(line)


def _track_columns(found: Tracks, number: int) -> dict[str, Column]:
    """Return the features of one camera by the names that they have in tracks.npz."""
    frames = found.frames
    return {
        "t_ns": frames.t_ns[found.frame],
        "true_t_ns": frames.true_t_ns[found.frame],
        "camera": np.full(len(found.frame), number, dtype=np.int32),
        "frame": frames.number[found.frame],
        "id": found.id,
        "landmark": found.landmark,
        "uv": found.uv,
        "uv_true": found.uv_true,
        "depth": found.depth,
        "wrong": found.wrong,
    }


def _line_columns(found: Tracks, seen: TrackedLines, number: int) -> dict[str, Column]:
    return {
        "t_ns": found.frames.t_ns[seen.frame],
        "true_t_ns": found.frames.true_t_ns[seen.frame],
        "camera": np.full(len(seen.frame), number, dtype=np.int32),
        "id": seen.id,
        "ends": seen.ends.reshape(-1, 4),
        "ends_true": seen.ends_true.reshape(-1, 4),
    }


def _in_order(cameras: list[dict[str, Column]]) -> dict[str, Column]:
    """Return the rows of all cameras by their true times; of equal ones, the first camera's."""
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
    """What ``generate --format tracks`` wrote: n features of what is at rest, in order of time."""

    cameras: dict[str, CameraParameters]
    landmarks: Array
    """(m, 3) p_w [m]."""
    true_t_ns: Integers
    """(n,) the middle of the exposure [ns]."""
    camera: Integers
    """(n,) index of the camera among ``cameras``."""
    landmark: Integers
    """(n,) row of what is seen."""
    uv: Array
    """(n, 2) measured pixel."""
    wrong: Mask
    """(n,) an outlier, or the pixel of another feature."""


def read_track_folder(folder: Path) -> TrackFolder:
    """Return cameras, landmarks and features of a folder.

    :raises InputError: for a folder that ``generate --format tracks`` did not write.
    :raises ConfigurationError: for a cameras.yaml that describes none.
    """
    path = folder / "tracks.npz"
    cameras = load_rig(files.load(folder / "cameras.yaml")).each()
    landmarks = read_points(folder / "landmarks.csv")
    columns = _arrays(path)
    for name, most in (("camera", len(cameras)), ("landmark", len(landmarks))):
        values = columns[name]
        if len(values) and not (values.min() >= 0 and values.max() < most):
            raise InputError(f"{path}: {name}: must be 0 to {most - 1}")
    return TrackFolder(cameras, landmarks, **columns)


def _arrays(path: Path) -> dict[str, Any]:
    try:
        with open_regular(path) as file, np.load(file, allow_pickle=False) as archive:
            found = {name: archive[name] for name in _COLUMNS}
            moves = archive["body"] != 0 if "body" in archive else np.zeros(0, np.bool_)
    except ImuSimError:
        raise
    except OSError as error:
        raise system_error(path, error) from None
    except Exception as error:  # zipfile and NumPy have many words for a broken file
        raise InputError(f"{path}: is not the tracks.npz of generate ({error})") from None
    count = len(found["uv"]) if found["uv"].ndim else 0
    for name, (kind, dimensions) in _COLUMNS.items():
        shape = (count, 2) if dimensions == 2 else (count,)
        if found[name].dtype.kind != kind or found[name].shape != shape:
            raise InputError(f"{path}: {name}: {found[name].dtype} {found[name].shape}")
    if not np.isfinite(found["uv"]).all():
        raise InputError(f"{path}: uv: must be finite")
    if len(moves) == count:
        return {name: values[~moves] for name, values in found.items()}
    return found
