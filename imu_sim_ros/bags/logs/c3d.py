# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""C3D files of motion capture, read by ezc3d: rotation data, and markers on segments.

The group POINT is that of the C3D User Guide (c3d.org), ROTATION that of C-Motion (Visual3D,
"ROTATION DATA TYPE"), in which markerless systems such as Theia3D write a pose (4, 4) per segment.

The pose of markers on one segment is the least-squares fit of their positions in the first complete
frame to those of each other one (Kabsch, Acta Cryst. A32, 1976). In that frame the axes of the
segment are those of the world, and its origin is the centroid of the markers.
"""

import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.logs import c3d_process, segments
from imu_sim_ros.bags.logs.log import Contents, LogStream
from imu_sim_ros.bags.logs.segments import Segment
from imu_sim_ros.core.errors import InputError, MissingDependencyError, name_source
from imu_sim_ros.core.rotation import from_matrix
from imu_sim_ros.core.types import Array, Mask, Times
from imu_sim_ros.inputs.rows import open_shared

_KEY: Final = 0x50
"""Second byte of a C3D file."""
_BLOCK: Final = 512
"""Unit of positions in the file [bytes]."""
_PROCESSORS: Final = (84, 85, 86)
"""Byte in the head of the parameters: Intel, DEC, SGI/MIPS."""
_LEAST_TIME: Final = 60.0
"""Time that reading a small file may take [s]."""
_SLOWEST: Final = 1e6
"""Speed below which reading is given up [bytes/s]."""
_LEAST_MARKERS: Final = 3
"""Smallest number of markers that determine the attitude of a segment."""
_ON_A_LINE: Final = 1e-3
"""Ratio of the singular values of markers [m^2/m^2] below which they are on a line."""
_ORTHOGONAL: Final = 1e-3
"""Largest deviation of ``R^T R`` from the identity."""
_UP: Final = re.compile(r"([+-]?)([XYZ])", re.IGNORECASE)
_NUMBERED: Final = re.compile(r"(.*?\D)[ _.-]?\d+|(.+)[_.-][A-Za-z]")
"""Label of a marker of a cluster: its segment and a number, or a separator and a letter."""
_MODEL_OUTPUTS: Final = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
"""Parameters of POINT with the labels of values that are no markers."""
_UNIT_NAMES: Final = {"m": "m", "meters": "m", "cm": "cm", "mm": "mm", "in": "inches"}
"""Units of :data:`segments.UNITS` by the texts of files."""
MEMORY = c3d_process.MEMORY
"""Memory that reading takes, in sizes of the file."""
_USUAL_UNIT: Final = "mm"
_USUAL_AXIS: Final = "z"


class _File(NamedTuple):
    """Parameters and arrays of a file."""

    parameters: Mapping[str, Mapping[str, Sequence[str | float]]]
    """Values of the parameters by group and name."""
    points: Array
    """(4, m, n) x, y, z and 1 of the markers in each frame; NaN: not visible."""
    rotations: Array
    """(4, 4, m, n) poses of the segments in each frame."""


class _Markers(NamedTuple):
    """Markers of a file with their positions over time."""

    labels: Sequence[str]
    """Names of the markers."""
    t_ns: Times
    """(n,) times since the first frame."""
    position: Array
    """(n, m, 3) positions in units of the file; NaN: not visible."""


class _World(NamedTuple):
    """Vertical axis and unit of length of a file."""

    axis: str
    """Axis up, as :func:`~imu_sim_ros.core.rotation.upright` takes it."""
    unit: float
    """Length of the unit [m]."""


def holds(path: Path, magic: bytes) -> bool:
    """Return True if the head of the file and that of its parameters are those of a C3D file.

    The first byte is the number of the block, from 1, in which the parameters begin; the second a
    key. The fourth byte of the parameters names the processor that wrote the numbers.
    """
    if len(magic) < 2:
        return False
    parameter_block, key = magic[:2]
    if key != _KEY or parameter_block == 0:
        return False
    with open_shared(path) as file:
        file.seek(_BLOCK * (parameter_block - 1))
        parameter_head = file.read(4)
    return len(parameter_head) == 4 and parameter_head[3] in _PROCESSORS


def contents(path: Path) -> Contents:
    """Return the segments of a C3D file; see :class:`imu_sim_ros.bags.logs.log.LogFormat`.

    Segments of rotation data, and those of three or more markers whose labels differ in a number or
    letter at the end. A list of markers, ``LELB,LWRA,LWRB``, is a topic, too.

    :raises MissingDependencyError: without ezc3d.
    :raises InputError: for a file that cannot be read, or has neither rotations nor markers.
    """
    file = _load(path)
    remarks: list[str] = []
    markers = _markers(file)
    world = _world(file, remarks)
    parts = [*_rotations(file, world, remarks), *_clusters(markers, world, remarks)]
    if not parts and len(markers.labels) < _LEAST_MARKERS:
        raise InputError(
            f"{path}: a C3D file without rotation data and with {len(markers.labels)} markers; a "
            f"segment needs {_LEAST_MARKERS}"
        )
    if not parts:
        remarks.append(
            "no labels of markers tell a segment; name some markers as its topic, as in "
            f"{','.join(markers.labels[:_LEAST_MARKERS])}; it has {_format_labels(markers.labels)}"
        )
    derived = _derived_topic_maker(path, markers, world)
    return Contents(segments.streams(parts), remarks=tuple(remarks), derived=derived)


def _load(path: Path) -> _File:
    """Return a file as ezc3d reads it, in a process of its own.

    :raises MissingDependencyError: without ezc3d.
    :raises InputError: for what it does not read.
    """
    if importlib.util.find_spec("ezc3d") is None:
        raise MissingDependencyError(f"{path}: a C3D file is read by ezc3d: pip install ezc3d")
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", c3d_process.__name__, str(path.absolute()), folder]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        seconds = _LEAST_TIME + path.stat().st_size / _SLOWEST
        try:
            process = subprocess.run(
                command, capture_output=True, env=environment, timeout=seconds, check=False
            )
        except subprocess.TimeoutExpired:
            raise InputError(f"{path}: damaged: not read within {seconds:.0f} s") from None
        if process.returncode:
            lines = [*process.stdout.splitlines(), *process.stderr.splitlines()]
            reason = lines[-1].decode("utf-8", "replace") if lines else "ezc3d crashes"
            raise InputError(f"{path}: damaged: {reason.strip().removeprefix('what():').strip()}")
        text = Path(folder, c3d_process.PARAMETERS).read_text(encoding="utf-8")
        arrays = (np.load(Path(folder, f"{name}.npy")) for name in c3d_process.ARRAYS)
        return _File(json.loads(text), *arrays)


def _parameter(file: _File, group: str, name: str) -> list[str | float]:
    """Return the values of a parameter; none if it does not exist."""
    return [*file.parameters.get(group, {}).get(name, [])]


def _labels(file: _File, group: str, count: int) -> list[str]:
    """Return ``count`` labels of a group; LABELS has 255 at most, LABELS2 those that follow."""
    texts: list[str] = []
    for k in range(1, 2 + count // 255):
        texts += map(str, _parameter(file, group, "LABELS" if k == 1 else f"LABELS{k}"))
    texts = [text.strip() for text in texts[:count]]
    texts += [""] * (count - len(texts))
    return [text or f"{group.lower()}_{k + 1}" for k, text in enumerate(texts)]


def _rate(file: _File, group: str) -> float:
    """Return the rate of a group [Hz]; 0 if the file states none."""
    values = _parameter(file, group, "RATE")
    return float(values[0] or 0.0) if values else 0.0


def _markers(file: _File) -> _Markers:
    """Return the markers of a file, without the results of models."""
    points = file.points
    labels = _labels(file, "POINT", points.shape[1])
    results = {
        str(text).strip() for name in _MODEL_OUTPUTS for text in _parameter(file, "POINT", name)
    }
    columns = [k for k, label in enumerate(labels) if label not in results]
    position = np.moveaxis(points[:3, columns], 2, 0).transpose(0, 2, 1)
    visible = np.isfinite(position).all(axis=2) & (position != 0.0).any(axis=2)
    t_ns = np.empty(0, np.int64)
    if columns and len(position):
        t_ns = segments.frame_times(len(position), _rate(file, "POINT"))
    names = [labels[k] for k in columns] if len(position) else []
    return _Markers(names, t_ns, np.where(visible[..., None], position, np.nan))


def _world(file: _File, remarks: list[str]) -> _World:
    """Return axes and unit that a file states, else the usual ones.

    :param remarks: receives a line about them.
    """
    stated = [str(text).strip() for text in _parameter(file, "POINT", "UNITS")[:1]]
    unit = _UNIT_NAMES.get(stated[0].lower()) if stated else None
    matches = [
        _UP.fullmatch(str(text).strip()) for text in _parameter(file, "POINT", "Y_SCREEN")[:1]
    ]
    match = matches[0] if matches else None
    axis = _USUAL_AXIS
    if match is not None:
        axis = ("-" if match[1] == "-" else "") + match[2].lower()
    unit_text = f"in {unit}" if unit else f"in {_USUAL_UNIT}, since POINT:UNITS states no unit"
    reason = "POINT:Y_SCREEN" if match is not None else "usual: no POINT:Y_SCREEN"
    line = f"{unit_text}; {segments.axes_sentence(axis)} ({reason})"
    if unit is None or match is None:
        line += "; trajectory.scale and trajectory.up correct that"
    remarks.append(line)
    return _World(axis, segments.UNITS[unit or _USUAL_UNIT])


def _rotations(file: _File, world: _World, remarks: list[str]) -> Iterator[Segment]:
    """Yield the segments of rotation data.

    :param remarks: receives a line for each segment without poses.
    """
    matrices = file.rotations
    count, frames = matrices.shape[2:]
    if not count or not frames:
        return
    ratio = _parameter(file, "ROTATION", "RATIO")
    rate = _rate(file, "ROTATION") or _rate(file, "POINT") * float((ratio and ratio[0]) or 1.0)
    t_ns = segments.frame_times(frames, rate)
    for k, label in enumerate(_labels(file, "ROTATION", count)):
        poses = np.moveaxis(matrices[:, :, k], 2, 0)
        turns = poses[:, :3, :3]
        with np.errstate(invalid="ignore", over="ignore"):
            products = np.swapaxes(turns, 1, 2) @ turns
            off = np.abs(products - np.eye(3)).max(axis=(1, 2))
            rigid = (off < _ORTHOGONAL) & (np.linalg.det(turns) > 0.0)
        visible = rigid & np.isfinite(poses[:, :3, 3]).all(axis=1)
        name = re.sub(r"_4x4$", "", label, flags=re.IGNORECASE)
        if visible.sum() < 2:
            remarks.append(f"{name}: left out, its rotation data have no poses")
            continue
        lines = _gap_lines(name, visible, t_ns, "a pose")
        q = from_matrix(turns[visible])
        segment = _segment(name, t_ns[visible], poses[visible, :3, 3], q, world, lines)
        yield segment._replace(label=label)


def _clusters(markers: _Markers, world: _World, remarks: list[str]) -> Iterator[Segment]:
    """Yield the segments of three or more markers whose labels differ in their end.

    :param remarks: receives a line for each segment that cannot be used.
    """
    clusters: dict[str, list[int]] = {}
    for k, label in enumerate(markers.labels):
        match = _NUMBERED.fullmatch(label)
        if match is not None:
            clusters.setdefault((match[1] or match[2]).rstrip(" _.-"), []).append(k)
    clusters = {name: rows for name, rows in clusters.items() if len(rows) >= _LEAST_MARKERS}
    plain_names = [name.rpartition(":")[2] for name in clusters]
    for name, columns in clusters.items():
        subject, _, plain = name.rpartition(":")
        unique = plain_names.count(plain) == 1 and plain.lower() != "marker"
        short = plain if unique else (subject if plain.lower() == "marker" else name)
        try:
            yield _segment_of_markers(short, markers, columns, world)
        except InputError as error:
            remarks.append(f"left out: {error}")


def _derived_topic_maker(
    path: Path, markers: _Markers, world: _World
) -> Callable[[str], LogStream | None]:
    """Return the function that makes the topic of a name ``LABEL,LABEL,LABEL``."""

    def stream(name: str) -> LogStream | None:
        labels = [label.strip() for label in name.split(",")]
        if len(labels) < _LEAST_MARKERS:
            return None
        plain = {label.rpartition(":")[2]: k for k, label in enumerate(markers.labels)}
        columns = {**plain, **{label: k for k, label in enumerate(markers.labels)}}
        unknown = [label for label in labels if label not in columns]
        if unknown:
            raise InputError(
                f"{path}: has no marker {', '.join(unknown)}; "
                f"it has {_format_labels(markers.labels)}"
            )
        with name_source(path):
            segment = _segment_of_markers(
                name, markers, [columns[label] for label in labels], world
            )
        return segments.stream(f"/{name}", segment)

    return stream


def _segment_of_markers(
    name: str, markers: _Markers, columns: Sequence[int], world: _World
) -> Segment:
    """Return the segment that carries some markers.

    :param columns: indices of the markers.
    :raises InputError: if no frame is complete, or the markers are on a line.
    """
    position = markers.position[:, columns]
    visible: Mask = np.all(np.isfinite(position), axis=2)
    complete = np.flatnonzero(np.all(visible, axis=1))
    if not len(complete):
        raise InputError(f"{name}: no frame has all of its {len(columns)} markers")
    start = int(complete[0])
    reference = position[start] - position[start].mean(axis=0)
    values = np.linalg.svd(reference, compute_uv=False) ** 2
    if values[1] <= _ON_A_LINE * values[0]:
        raise InputError(f"{name}: its markers are on a line, which tells no attitude")
    turns, origins, usable, residual = _kabsch(reference, position, visible)
    labels = ", ".join(markers.labels[k] for k in columns)
    lines = [
        f"{name}: {labels}; axes and centroid of the frame at "
        f"{markers.t_ns[start] * 1e-9:.3f} s; {residual * world.unit * 1e3:.2g} mm RMS of the "
        "markers from a rigid body",
        *_gap_lines(name, usable, markers.t_ns, f"{_LEAST_MARKERS} markers"),
    ]
    q = from_matrix(turns[usable])
    return _segment(name, markers.t_ns[usable], origins[usable], q, world, lines)


def _kabsch(reference: Array, position: Array, visible: Mask) -> tuple[Array, Array, Mask, float]:
    """Return the rotations and positions that map a reference to the visible markers of each frame.

    ``R = V diag(1, 1, det(V U^T)) U^T`` with the decomposition ``U S V^T`` of the covariance.

    :param reference: (m, 3) markers on the body.
    :param position: (n, m, 3) markers in each frame; arbitrary where they are not visible.
    :param visible: (n, m) True where a marker is visible.
    :returns: R (n, 3, 3), p (n, 3), the frames that have a pose (n,), and the RMS residual.
    """
    weight = visible[..., None].astype(np.float64)
    count = np.maximum(weight.sum(axis=1), 1.0)
    measured = np.where(visible[..., None], position, 0.0)
    body_mean = (weight * reference).sum(axis=1) / count
    world_mean = measured.sum(axis=1) / count
    body = weight * (reference - body_mean[:, None])
    world = weight * (measured - world_mean[:, None])
    u, values, vt = np.linalg.svd(np.swapaxes(body, 1, 2) @ world)
    v, ut = np.swapaxes(vt, 1, 2), np.swapaxes(u, 1, 2)
    signs = np.ones((len(position), 3))
    signs[:, 2] = np.sign(np.linalg.det(v @ ut))
    turns = (v * signs[:, None]) @ ut
    origins = world_mean - np.einsum("nij,nj->ni", turns, body_mean)
    usable = (visible.sum(axis=1) >= _LEAST_MARKERS) & (values[:, 1] > _ON_A_LINE * values[:, 0])
    rest = world - body @ np.swapaxes(turns, 1, 2)
    markers = visible[usable].sum()
    residual = float(np.sqrt((rest[usable] ** 2).sum() / max(markers, 1)))
    return turns, origins, usable, residual


def _segment(
    name: str, t_ns: Times, position: Array, q: Array, world: _World, remarks: Sequence[str]
) -> Segment:
    """Return a segment of poses in the axes and the unit of the file."""
    position, q_wb = segments.convert_to_z_up(position, q, world.axis, world.unit)
    return Segment(name, t_ns, lambda rows: (position[rows], q_wb[rows]), remarks=tuple(remarks))


def _gap_lines(name: str, visible: Mask, t_ns: Times, need: str) -> list[str]:
    """Return a line about the frames without a pose, if there are any.

    :param visible: (n,) True for frames with a pose.
    :param t_ns: (n,) times of all frames.
    """
    missing = int(np.count_nonzero(~visible))
    if not missing:
        return []
    longest = np.diff(t_ns[visible]).max(initial=0) * 1e-9
    return [
        f"{name}: {missing} of {len(visible)} frames do not show {need} and are left out; the "
        f"longest gap is {longest:.3g} s"
    ]


def _format_labels(labels: Sequence[str]) -> str:
    """Return the first labels as text, and the number of the others."""
    remainder = f" and {len(labels) - 12} more" if len(labels) > 12 else ""
    return ", ".join(labels[:12]) + remainder
