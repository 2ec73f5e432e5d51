# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text exports of Xsens' MTi, MTw and DOT (MT Manager, DOT app): a table under lines with ``//``.

The header names the columns: ``PacketCounter``, ``SampleTimeFine``, ``Acc_X`` [m/s^2], ``Gyr_X``
[rad/s], ``Quat_q0``, ``Mat[1][1]``, ``Roll`` [deg], ``VelInc_X`` [m/s], ``OriInc_q0``, ... ("MT
Low-Level Communication Protocol" and "MT Manager User Manual"); separators are tabs, semicolons,
commas or blanks, and cells may be empty. The sensor's axes are those printed on it; its orientation
is that in ENU, unless the head says NWU or NED. Magnetic fields have arbitrary units and are left
out.

Times are ``SampleTimeFine``, in 0.1 ms (DOT: us) since the start, and without it the packets at the
update rate of the head.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.logs import axes, columns, log
from imu_sim_ros.bags.logs.columns import ColumnTable
from imu_sim_ros.bags.logs.log import Contents, LogStream
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.geodesy import tangent_plane
from imu_sim_ros.core.rotation import from_euler, from_matrix, multiply
from imu_sim_ros.core.rotation import log as rotation_vector
from imu_sim_ros.core.types import Array, Integers, Times
from imu_sim_ros.recordings.clock import estimate_clock

MEMORY = 7
"""Memory that reading takes, in sizes of the file."""
_COUNTER: Final = "packetcounter"
_TIME: Final = "sampletimefine"
_KNOWN: Final = frozenset(("accx", "gyrx", "velincx", "oriincq0"))
"""Columns of which a table has at least one."""
_HEAD_LINES: Final = 60
"""Largest number of lines in front of the table."""
_RATE: Final = re.compile(rb"(?:update|sampling|output) ?rate:?[^0-9]*([0-9.]+)", re.IGNORECASE)
_WORLD: Final = re.compile(rb"coordinate system:?.*?\b(ENU|NWU|NED)\b", re.IGNORECASE)
_USUAL_RATE: Final = 100.0
"""Factory setting of the output rate [Hz]."""
_TICKS_PER_SECOND: Final = (10_000, 1_000_000)
"""Units of SampleTimeFine: of MTi and MTw, of DOT."""
_COUNTER_PERIOD: Final = 1 << 16
"""Number of packets after which ``PacketCounter`` begins anew."""
_TIME_PERIOD: Final = 1 << 32
"""Number of ticks after which ``SampleTimeFine`` begins anew."""
_NORTH_IS_X: Final = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""Quaternion of the axes north, west, up in ENU."""
_NAMES: Final = {
    **{f"gyro{axis}": f"gyr{axis}" for axis in "xyz"},
    **{f"q{k}": f"quatq{k}" for k in range(4)},
    **{f"quat{letter}": f"quatq{k}" for k, letter in enumerate("wxyz")},
    **dict(zip(("eulerx", "eulery", "eulerz"), ("roll", "pitch", "yaw"), strict=True)),
}
"""Names of columns that other exports spell differently."""
_MATRIX: Final = tuple(f"mat{row}{column}" for row in "123" for column in "123")


def holds(path: Path, magic: bytes) -> bool:
    """Return True for a text file whose table has a counter or a time of Xsens, and readings."""
    lines = columns.head_of(path, magic).split(b"\n")[:_HEAD_LINES]
    return _header(lines) is not None


def contents(path: Path) -> Contents:
    """Return the topics of an export; see :class:`imu_sim_ros.bags.logs.log.LogFormat`."""
    damage: list[str] = []
    remarks: list[str] = []
    lines = columns.read_lines(path)
    header = _header(lines[:_HEAD_LINES])
    if header is None:
        raise InputError(f"{path}: damaged: its header is missing")
    head = b"\n".join(lines[:header])
    table = columns.table_of(str(path), lines[header:])
    export = _Export(table, head, damage, remarks)
    streams = list(export.streams())
    if not streams:
        raise log.refuse_empty(path, "an export of Xsens", table.names)
    return Contents(streams, damage=tuple(damage), remarks=tuple(remarks))


def _canonical(name: str) -> str:
    """Return the name of a column in lower case, without unit and punctuation."""
    plain = re.sub(r"[^a-z0-9]", "", _bare(name).lower())
    return _NAMES.get(plain, plain)


def _bare(name: str) -> str:
    """Return a name without its unit; the brackets of ``Mat[1][1]`` are none."""
    return name if name.strip().lower().startswith("mat") else columns.split_unit(name)[0]


def _header(lines: Sequence[bytes]) -> int | None:
    """Return the number of the line that names the columns; None: there is none."""
    for number, line in enumerate(lines):
        if line.lstrip().startswith(b"//"):
            continue
        names = {
            _canonical(name) for name in re.split("[;\t,]| {1,}", line.decode("utf-8", "replace"))
        }
        if names & {_COUNTER, _TIME} and names & _KNOWN:
            return number
    return None


class _Export:
    """Table of an export while it becomes streams."""

    def __init__(
        self, table: ColumnTable, head: bytes, damage: list[str], remarks: list[str]
    ) -> None:
        self._units = {_canonical(name): columns.split_unit(name)[1] for name in table.names}
        table.names = [_canonical(name) for name in table.names]
        self._table, self._damage, self._remarks = table, damage, remarks
        rate = _RATE.search(head)
        self._rate = float(rate[1].strip(b".") or 0) if rate else 0.0
        world = _WORLD.search(head)
        self._world = world[1].decode().upper() if world else "ENU"
        self._is_dot = b"dot" in head.lower()

    def streams(self) -> Iterator[LogStream]:
        """Yield readings with orientation, temperatures, pressures, positions."""
        groups = {
            "accel": [f"acc{axis}" for axis in "xyz"],
            "gyro": [f"gyr{axis}" for axis in "xyz"],
            "velocity": [f"velinc{axis}" for axis in "xyz"],
            "turn": [f"oriincq{k}" for k in range(4)],
        }
        needed = {name: names for name, names in groups.items() if self._has_values(names)}
        if "accel" in needed:
            needed.pop("velocity", None)
        if "gyro" in needed:
            needed.pop("turn", None)
        optional = [
            *(f"quatq{k}" for k in range(4)),
            *_MATRIX,
            *("roll", "pitch", "yaw", "temperature", "pressure"),
            *("latitude", "longitude", "altitude"),
        ]
        names = [name for group in needed.values() for name in group]
        if not names:
            return
        t_ns, values = self._rows(names, optional)
        if not len(t_ns):
            return
        table = {name: values[:, k] for k, name in enumerate([*names, *optional])}
        parts = {name: _stack(table, fields) for name, fields in needed.items()}
        seconds = _interval(t_ns)
        if "velocity" in parts:
            parts["accel"] = parts["velocity"] / seconds
        if "turn" in parts:
            parts["gyro"] = rotation_vector(parts["turn"]) / seconds
        elif "gyro" in parts and self._has_degrees():
            parts["gyro"] = np.radians(parts["gyro"])
        q_wi = self._orientation(table)
        yield log.imu("/imu", t_ns, parts.get("gyro"), parts.get("accel"), q_wi=q_wi)
        for name, encode in (("temperature", log.temperature), ("pressure", log.pressure)):
            rows = np.isfinite(table[name])
            if rows.any():
                yield encode(f"/{name}", t_ns[rows], table[name][rows])
        yield from _position_streams(t_ns, table, q_wi)

    def _has_values(self, names: Sequence[str]) -> bool:
        """Return True for columns that are not empty in all of the first rows."""
        if not self._table.has(*names):
            return False
        sample = ColumnTable("", self._table.names, self._table.rows[:100], self._table.separator)
        return bool(len(sample.numbers(names, [])))

    def _rows(self, names: Sequence[str], optional: Sequence[str]) -> columns.Columns:
        """Return the stamps and the columns of all rows that have the needed ones.

        :param names: columns whose values must be numbers.
        :param optional: columns whose values may be missing, NaN.
        """
        for stamp, times in ((_TIME, self._sample_times), (_COUNTER, self._packet_times)):
            if not self._has_values([stamp]):
                continue
            numbers = self._table.columns(stamp, 0, [*names], self._damage, optional)
            t_ns = times(numbers.t_ns)
            rows = columns.valid_stamps(t_ns)
            return columns.Columns(t_ns[rows], numbers.values[rows])
        return columns.Columns(np.empty(0, np.int64), np.empty((0, len(names) + len(optional))))

    def _sample_times(self, ticks: Integers) -> Times:
        """Return the times (n,) [ns] of SampleTimeFine (n,)."""
        unwrapped = _unwrap_counter(ticks, _TIME_PERIOD)
        per_second = _TICKS_PER_SECOND[self._is_dot]
        if len(ticks) > 1 and self._rate > 0.0:
            step = max(float(np.median(np.diff(unwrapped))), 1.0)
            per_second = min(
                _TICKS_PER_SECOND, key=lambda count: abs(np.log(count / step / self._rate))
            )
        return unwrapped * (10**9 // per_second)

    def _packet_times(self, packets: Integers) -> Times:
        """Return the times (n,) [ns] of packet numbers (n,) at the update rate."""
        rate = self._rate
        if rate <= 0.0:
            rate = _USUAL_RATE
            self._remarks.append(
                f"the export has no times and no update rate: {rate:g} Hz are assumed, the "
                f"factory setting; a line // Update Rate: RATE at its start states another one"
            )
        unwrapped = _unwrap_counter(packets, _COUNTER_PERIOD)
        stamps: Times = np.rint((unwrapped - unwrapped[:1]) * (1e9 / rate)).astype(np.int64)
        return stamps

    def _has_degrees(self) -> bool:
        """Return True for rates in degrees: by the header, or those of DOT."""
        unit = self._units.get("gyrx", "").lower()
        return unit.startswith("deg") or unit == "dps" or (not unit and self._is_dot)

    def _orientation(self, table: Mapping[str, Array]) -> Array | None:
        """Return the orientation (n, 4) of the sensor in ENU; None: not all rows have one.

        The export states it in its local frame l: ENU, NWU or NED.

        :param table: columns (n,) by their names; NaN where a cell is empty.
        """
        q = _stack(table, [f"quatq{k}" for k in range(4)])
        matrix = _stack(table, _MATRIX).reshape(-1, 3, 3)
        angles = _stack(table, ("roll", "pitch", "yaw"))
        if np.isfinite(q).all() and (np.linalg.norm(q, axis=1) > 0.5).all():
            q_li = q
        elif np.isfinite(matrix).all() and (np.abs(np.linalg.det(matrix) - 1.0) < 0.1).all():
            q_li = from_matrix(matrix)
        elif np.isfinite(angles).all():
            q_li = from_euler(np.radians(angles))
        else:
            return None
        if self._world == "NWU":
            return multiply(_NORTH_IS_X, q_li)
        return q_li if self._world == "ENU" else axes.q_enu_of_ned(q_li)


def _stack(table: Mapping[str, Array], names: Sequence[str]) -> Array:
    """Return the columns of some names side by side, (n, m)."""
    return np.column_stack([table[name] for name in names])


def _position_streams(
    t_ns: Times, table: Mapping[str, Array], q_wi: Array | None
) -> Iterator[LogStream]:
    """Yield the fixes of rows that have one, and the poses in the tangent plane at the first.

    :param table: columns (n,) with latitude, longitude [deg] and altitude [m].
    :param q_wi: (n, 4) orientations in ENU; None: there are no poses.
    """
    position = _stack(table, ("latitude", "longitude", "altitude"))
    rows = np.isfinite(position).all(axis=1) & (position[:, :2] != 0.0).any(axis=1)
    if not rows.any():
        return
    fixes = position[rows]
    latitude, longitude, height = fixes.T
    zeros = np.zeros(len(fixes))
    has_fix = np.ones(len(fixes), np.bool_)
    yield log.fix("/position", t_ns[rows], (latitude, longitude, height), has_fix, (zeros, zeros))
    if q_wi is not None:
        yield log.poses("/pose", t_ns[rows], tangent_plane(fixes, fixes[0]), q_wi[rows])


def _interval(t_ns: Times) -> float:
    """Return the time between two samples [s]: of the clock, since stamps may be rounded."""
    try:
        return 1.0 / estimate_clock(t_ns).rate
    except InputError:  # a sample alone
        return 1.0 / _USUAL_RATE


def _unwrap_counter(numbers: Integers, period: int) -> Integers:
    """Return the numbers (n,) of a counter without its restarts at multiples of a period."""
    steps = np.diff(numbers, prepend=numbers[:1])
    turns: Integers = numbers + period * np.cumsum(steps < -(period // 2))
    return turns
