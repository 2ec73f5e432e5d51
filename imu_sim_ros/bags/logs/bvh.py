# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""BVH files of motion capture: the skeleton is read by bvhio, the frames as rows of numbers.

bvhio makes an object of each joint and frame; the page motion_capture.md says what they would cost.
A joint's pose in that of its parent (Meredith and Maddock, "Motion Capture File Formats Explained",
University of Sheffield, 2001): the offset, or its position channels in place of it, and the
rotations of its channels, each about the axes that the one before has turned: ``R = R_1 R_2 R_3``.
"""

import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.logs import segments
from imu_sim_ros.bags.logs.log import Contents
from imu_sim_ros.bags.logs.segments import Segment
from imu_sim_ros.core.conventions import AXES
from imu_sim_ros.core.errors import InputError, MissingDependencyError
from imu_sim_ros.core.rotation import multiply, rotate
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.rows import open_shared

if TYPE_CHECKING:
    from bvhio import BvhContainer, BvhJoint

MEMORY = 3
"""Memory that reading takes, in sizes of the file, if all of it are readings."""
_MAGIC: Final = b"HIERARCHY"
_BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"
_LONGEST_SKELETON: Final = 1 << 22
"""Size of a skeleton that is read [bytes]; those of people have some 10 kB."""
_END: Final = "END"
"""Word behind the skeleton, at which bvhio stops: at the end of a file it would wait for ever."""
_ROWS: Final = 4096
"""Frames that are parsed at a time."""
_CHANNELS: Final = {
    f"{axis.upper()}{kind}": (kind, k)
    for kind in ("position", "rotation")
    for k, axis in enumerate(AXES)
}
"""Kind and axis of the channels by name."""
_SMALLEST: Final = 1.0
"""Least height of a person [m]."""
_TALLEST: Final = 2.2
"""Greatest height of a person [m]."""
_UPRIGHT: Final = 1.5
"""Ratio of height and depth from which on a rest pose stands."""


class _Joint(NamedTuple):
    """A joint of the skeleton and the segment from it to its children or its end site."""

    name: str
    parent: int
    """Index of its parent; -1: the root."""
    offset: Array
    """(3,) position in the parent's axes, in units of the file."""
    channels: tuple[tuple[str, int], ...]
    """Kind and axis of each channel."""
    column: int
    """Column of its first channel."""
    tip: Array
    """(3,) end of the segment, in its axes."""


def holds(path: Path, magic: bytes) -> bool:
    """Return True for a text that begins with the word HIERARCHY."""
    return magic.removeprefix(_BYTE_ORDER_MARK).lstrip().startswith(_MAGIC)


def contents(path: Path) -> Contents:
    """Return the joints of a BVH file; see :class:`imu_sim_ros.bags.logs.log.LogFormat`.

    :raises MissingDependencyError: without bvhio.
    :raises InputError: for a file without a complete skeleton, or without frames.
    """
    with open_shared(path) as file:
        skeleton = _skeleton(path, file)
        joints = _joints(path, skeleton.Root)
        columns = sum(len(joint.channels) for joint in joints)
        frames, damage = _frames(path, file, columns, skeleton.FrameCount)
    rate = _rate(path, skeleton.FrameTime)
    t_ns = segments.frame_times(len(frames), rate)
    axis, unit, remark = _axes_and_unit(joints)
    if rate * skeleton.FrameTime != 1.0:
        remark += f"; a frame time of {skeleton.FrameTime:g} s is taken as {rate:g} Hz"

    def segment(index: int) -> Segment:
        def poses(rows: slice) -> tuple[Array, Array]:
            return segments.convert_to_z_up(*_chain(joints, index, frames[rows]), axis, unit)

        return Segment(joints[index].name, t_ns, poses)

    streams = segments.streams([segment(index) for index in range(len(joints))])
    return Contents(streams, damage=damage, remarks=(remark,))


def _skeleton(path: Path, file: IO[bytes]) -> "BvhContainer":
    """Return the skeleton, the number of frames and their interval; reads up to the frames.

    :raises MissingDependencyError: without bvhio.
    :raises InputError: for what bvhio does not read.
    """
    lines: list[bytes] = []
    size = 0
    for line in iter(lambda: file.readline(_LONGEST_SKELETON), b""):
        lines.append(line)
        size += len(line)
        if line.lstrip().startswith(b"Frame Time"):
            break
        if size > _LONGEST_SKELETON:
            raise InputError(f"{path}: damaged: a skeleton of more than {_LONGEST_SKELETON} bytes")
    else:
        raise InputError(f"{path}: damaged: ends before its frames, in line {len(lines)}")
    text = b"".join(lines).removeprefix(_BYTE_ORDER_MARK).decode("utf-8", "replace")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PendingDeprecationWarning)  # its way to import PyGLM
            import bvhio
    except ImportError:
        raise MissingDependencyError(
            f"{path}: a BVH file is read by bvhio: pip install bvhio"
        ) from None
    with tempfile.NamedTemporaryFile(
        "w", suffix=".bvh", encoding="ascii", errors="replace"
    ) as copy:
        copy.write(f"{text}\n{_END}\n")
        copy.flush()
        try:
            return bvhio.readAsBvh(copy.name, loadKeyFrames=False)
        except (OSError, MemoryError):
            raise
        except Exception as error:  # whatever the library raises for a malformed text
            reason = error.msg if isinstance(error, SyntaxError) else str(error)
            raise InputError(f"{path}: damaged: its skeleton: {reason}") from error


def _joints(path: Path, root: "BvhJoint") -> list[_Joint]:
    """Return the joints, each after its parent, in the order of their channels.

    :raises InputError: for offsets that are no numbers, and unknown channels.
    """
    joints: list[_Joint] = []
    column = 0
    waiting: list[tuple[BvhJoint, int]] = [(root, -1)]
    while waiting:
        joint, parent = waiting.pop()
        for name in joint.Channels:
            if name not in _CHANNELS:
                choices = ", ".join(_CHANNELS)
                raise InputError(
                    f"{path}: joint {joint.Name} has a channel {name}; known: {choices}"
                )
        offset, tip = np.array(joint.Offset, np.float64), np.array(joint.EndSite, np.float64)
        if not (np.isfinite(offset).all() and np.isfinite(tip).all()):
            raise InputError(f"{path}: joint {joint.Name} has an offset that is not finite")
        channels = tuple(_CHANNELS[name] for name in joint.Channels)
        tip = np.zeros(3) if joint.Children else tip
        joints.append(_Joint(joint.Name, parent, offset, channels, column, tip))
        column += len(channels)
        waiting += [(child, len(joints) - 1) for child in reversed(joint.Children)]
    if not column:
        raise InputError(f"{path}: a skeleton without channels")
    return joints


def _frames(
    path: Path, file: IO[bytes], columns: int, stated: int
) -> tuple[Array, tuple[str, ...]]:
    """Return the values (n, columns) of the frames up to the first damage, with a line for it.

    :param stated: number of frames that the file states.
    :raises InputError: if the first frame is no row of numbers.
    """
    parts: list[Array] = []
    count, damage = 0, ""
    # Longer lines are no rows of this skeleton: cut off, they still have too many values.
    lines = (line for line in iter(lambda: file.readline(64 * columns + 4096), b"") if line.strip())
    for block in iter(lambda: list(islice(lines, _ROWS)), []):
        values, damage = _values(block, columns)
        parts.append(values)
        count += len(values)
        if damage:
            break
    if not count:
        raise InputError(f"{path}: damaged: {damage or 'no frames'}")
    if damage:
        damage = f"frame {count + 1} of {stated}: {damage}; read up to it"
    elif count != stated:
        damage = f"{count} frames, though it states {stated}"
    return np.concatenate(parts), (damage,) if damage else ()


def _values(lines: Sequence[bytes], columns: int) -> tuple[Array, str]:
    """Return the values (n, columns) of lines up to the first bad one, and why that one is bad."""
    try:
        values = np.loadtxt([line.decode("latin-1") for line in lines], comments=None, ndmin=2)
        if values.shape[1] == columns and np.isfinite(values).all():
            return values, ""
    except ValueError:
        pass
    rows: list[list[float]] = []
    for line in lines:
        fields = line.split()
        try:
            numbers = [float(field) for field in fields]
        except ValueError:
            return _table(rows, columns), "not a number"
        if len(numbers) != columns:
            return _table(rows, columns), f"{len(numbers)} values, the skeleton has {columns}"
        if not np.isfinite(numbers).all():
            return _table(rows, columns), "a value that is not finite"
        rows.append(numbers)
    return _table(rows, columns), ""


def _table(rows: Sequence[Sequence[float]], columns: int) -> Array:
    """Return rows of numbers as an array (n, columns), also without rows."""
    return np.array(rows, np.float64).reshape(-1, columns)


def _rate(path: Path, interval: float) -> float:
    """Return the rate of the frames [Hz]; 0.0166667 s are 60 Hz.

    :param interval: as the file states it, rounded to a few decimals [s].
    :raises InputError: for an interval that is none.
    """
    if not interval > 0.0 or not np.isfinite(1.0 / interval):
        raise InputError(f"{path}: Frame Time: {interval:g}: must be more than 0 s")
    whole = round(1.0 / interval)
    decimals = len(repr(interval).partition(".")[2]) if "e" not in repr(interval) else 16
    if whole and abs(1.0 / whole - interval) <= 0.51 * 10.0**-decimals:
        return float(whole)
    return 1.0 / interval


def _chain(joints: Sequence[_Joint], index: int, frames: Array) -> tuple[Array, Array]:
    """Return positions (n, 3) and attitudes (n, 4) of a joint in the axes of the file."""
    position = np.zeros((len(frames), 3))
    attitude = np.tile([1.0, 0.0, 0.0, 0.0], (len(frames), 1))
    for joint in reversed([*_upwards(joints, index)]):
        translation = np.tile(joint.offset, (len(frames), 1))
        turn = attitude
        for k, (kind, axis) in enumerate(joint.channels):
            values = frames[:, joint.column + k]
            if kind == "position":
                translation[:, axis] = values
            else:
                half = np.deg2rad(values) / 2.0
                about_axis = np.zeros((len(frames), 4))
                about_axis[:, 0], about_axis[:, 1 + axis] = np.cos(half), np.sin(half)
                turn = multiply(turn, about_axis)
        position = position + rotate(attitude, translation)
        attitude = turn
    return position, attitude


def _upwards(joints: Sequence[_Joint], index: int) -> Iterator[_Joint]:
    """Yield a joint, its parent, and so on up to the root."""
    while index >= 0:
        yield joints[index]
        index = joints[index].parent


def _axes_and_unit(joints: Sequence[_Joint]) -> tuple[str, float, str]:
    """Return axis up, length of the unit [m], and a line about them.

    The format states neither. The pose without rotations stands: it is as high as a person in the
    right unit, and higher than deep. Else the axis is y and the unit the centimetre.
    """
    ends: list[Array] = []
    starts: list[Array] = []
    for joint in joints:
        base = starts[joint.parent] if joint.parent >= 0 else np.zeros(3) - joint.offset
        starts.append(base + joint.offset)
        ends += [starts[-1], starts[-1] + joint.tip]
    extent = np.ptp(np.array(ends), axis=0)
    axis = "z" if extent[2] > _UPRIGHT * extent[1] else "y"
    height = float(extent[AXES.index(axis)])
    stands = height > _UPRIGHT * extent[1 if axis == "z" else 2]
    matching = _units_of(height, segments.UNITS)
    name = matching[0] if matching else "cm"
    assumed = [] if stands else ["the axis up"]
    assumed += [] if matching else ["the unit"]
    line = (
        f"{height:.4g} units high without rotations: read in {name}; {segments.axes_sentence(axis)}"
    )
    if assumed:
        line += (
            f"; {' and '.join(assumed)} cannot be told from the skeleton: BVH's usual, which "
            "trajectory.scale and trajectory.up correct"
        )
    return axis, segments.UNITS[name], line


def _units_of(height: float, units: Mapping[str, float]) -> list[str]:
    """Return the units in which a height is that of a person."""
    return [name for name, unit in units.items() if _SMALLEST <= height * unit <= _TALLEST]
