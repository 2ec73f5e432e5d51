# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""DataFlash logs of ArduPilot, binary (.bin) and text (.log), read by pymavlink.

Messages, fields and units are those of ArduPilot's log messages (ardupilot.org, "Onboard Message
Log Messages"). Of a binary log pymavlink gives the formats and the places of the messages, from
which NumPy takes the columns; a text log is read message by message.
"""

import contextlib
import mmap
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.logs import axes, log
from imu_sim_ros.bags.logs.log import Contents, LogStream, LogTriad
from imu_sim_ros.bags.messages.encode import FLUID_PRESSURE, IMU, MAGNETIC_FIELD, ODOMETRY
from imu_sim_ros.core.conventions import TRIADS, TRUTH_TOPIC
from imu_sim_ros.core.errors import InputError, MissingDependencyError
from imu_sim_ros.core.geodesy import tangent_plane
from imu_sim_ros.core.rotation import from_euler
from imu_sim_ros.core.timebase import interpolate_columns
from imu_sim_ros.core.types import AnyArray, Array, Mask, Times
from imu_sim_ros.inputs.rows import open_regular, open_shared
from imu_sim_ros.recordings.findings.clipping import ClippingCounts

if TYPE_CHECKING:
    from pymavlink.DFReader import DFReader_binary, DFReader_text

MEMORY = 4
"""Memory that reading takes, in sizes of the file, if all of it are readings."""
_HEAD: Final = b"\xa3\x95"
_FORMAT: Final = re.compile(rb"\xa3\x95\x80(.)(.)([A-Z0-9]{1,4}\0{0,3})", re.DOTALL)
"""Start of the definition of a message: its number, its length and its name."""
_HEAD_BYTES: Final = 3
"""Bytes in front of each message: two magic ones and the message's number."""
_TEXT_HEADS: Final = (b"FMT, ", b"FMT,")
_BATCH: Final = 32
"""Number of samples in a message ISBD."""
_MICROSECOND: Final = 1000
"""Unit of the stamps [ns]."""
_LAST_STAMP: Final = 2**31 * 10**6
"""End of the stamps that a message of ROS holds [us]."""
_MILLIGAUSS: Final = 1e-7
"""One milligauss [T]."""
_FIX_2D: Final = 2
"""Status of a receiver that has a position."""
_CELLS: Final = {
    "b": "i1",
    "B": "u1",
    "M": "u1",
    "h": "<i2",
    "H": "<u2",
    "i": "<i4",
    "I": "<u4",
    "q": "<i8",
    "Q": "<u8",
    "g": "<f2",
    "f": "<f4",
    "d": "<f8",
    "c": "<i2",
    "C": "<u2",
    "e": "<i4",
    "E": "<u4",
    "L": "<i4",
    "n": "S4",
    "N": "S16",
    "Z": "S64",
    "a": "(32,)<i2",
}
"""Types of fields by the letters of a format."""
_DIVISORS: Final = {"c": 100.0, "C": 100.0, "e": 100.0, "E": 100.0, "L": 1e7}
"""Divisors of fields that are stored as whole numbers."""
_NAMES: Final = (
    *("IMU", "IMU2", "IMU3", "ACC", "ACC1", "ACC2", "ACC3", "GYR", "GYR1", "GYR2", "GYR3"),
    *("ISBH", "ISBD", "XKF1", "NKF1", "XKQ", "XKQ1", "AHR2", "ATT", "POS", "SIM", "SIM2"),
    *("GPS", "GPS2", "GPA", "MAG", "MAG2", "MAG3", "BARO", "BAR2", "BAR3", "VIBE"),
)
"""Names of the messages that are read."""
_INSTANCE_FIELDS: Final = ("I", "IMU", "C")
"""Fields that number the instances of a message."""
_PREFERRED: Final = {
    IMU: ("/IMU_0",),
    ODOMETRY: (f"/{TRUTH_TOPIC}", "/XKF1_0", "/NKF1_0"),
    MAGNETIC_FIELD: ("/MAG_0",),
    FLUID_PRESSURE: ("/BARO_0",),
}
"""Topics that are read if the user names none."""


class _Table(NamedTuple):
    """Columns of one instance of a message."""

    name: str
    """Name of the message without the number of the instance."""
    instance: int
    """Number of the instance, from 0."""
    columns: Mapping[str, AnyArray]
    """(n,) numbers by name of the field, or (n, 32) of batches."""

    @property
    def topic(self) -> str:
        """Name of the topic in the bag."""
        return f"/{self.name}_{self.instance}"

    @property
    def aliases(self) -> tuple[str, ...]:
        """Names of ArduPilot's tools."""
        plain = self.name if self.instance == 0 else f"{self.name}{self.instance + 1}"
        return (f"{self.name}/{self.instance}", f"{self.name}[{self.instance}]", plain)

    @property
    def t_ns(self) -> Times:
        """(n,) times since the start."""
        sampled = self.columns.get("SampleUS", self.columns["TimeUS"])
        return sampled.astype(np.int64) * _MICROSECOND

    def vector(self, *names: str) -> Array | None:
        """Return fields as columns (n, m); None without them."""
        if any(name not in self.columns for name in names):
            return None
        return np.column_stack([self.columns[name] for name in names]).astype(np.float64)

    def rows(self, rows: Mask) -> "_Table":
        """Return the messages (m,) of which a mask (n,) is True."""
        return self._replace(columns={key: column[rows] for key, column in self.columns.items()})


Tables = Mapping[str, Sequence[_Table]]
"""Instances of each message of a log."""


def holds(path: Path, magic: bytes) -> bool:
    """Return True for a DataFlash log: messages with a head, or lines that define formats."""
    return magic.startswith((_HEAD, *_TEXT_HEADS))


def contents(path: Path) -> Contents:
    """Return the topics of a log; see :class:`imu_sim_ros.bags.logs.log.LogFormat`.

    :raises MissingDependencyError: without pymavlink.
    :raises InputError: for a file that is damaged at its start, or has no known message.
    """
    with open_shared(path) as file:
        is_binary = file.read(len(_HEAD)) == _HEAD
    if is_binary:
        _check_formats(path)
    remarks: list[str] = []
    columns, names, printed = _load(path, is_binary)
    tables = _tables(columns, remarks)
    streams = [stream for reader in _READERS for stream in reader(tables, remarks)]
    if not streams:
        raise log.refuse_empty(path, "a log of ArduPilot", names)
    damage = (f"damaged: pymavlink says: {printed}",) if printed else ()
    clippings = tuple(_clippings(tables))
    return Contents(streams, _PREFERRED, clippings, damage, tuple(remarks))


def _check_formats(path: Path) -> None:
    """Refuse definitions of messages that are shorter than their head, which would be read forever.

    :raises InputError: for those.
    """
    with (
        open_regular(path) as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
    ):
        for definition in _FORMAT.finditer(content):
            if definition[2][0] < _HEAD_BYTES:
                name = definition[3].rstrip(b"\0").decode("ascii")
                raise InputError(f"{path}: damaged: defines {name} with {definition[2][0]} bytes")


def _load(path: Path, is_binary: bool) -> tuple[dict[str, dict[str, AnyArray]], list[str], str]:
    """Return columns of the known messages, the names of all messages, and printed lines."""
    try:
        from pymavlink.DFReader import DFReader_binary, DFReader_text
    except ImportError:
        raise MissingDependencyError(
            f"{path}: a log of ArduPilot is read by pymavlink: pip install pymavlink"
        ) from None
    lines: list[str] = []
    try:
        with log.capture_output(lines):
            if is_binary:
                with contextlib.closing(DFReader_binary(str(path), zero_time_base=True)) as binary:
                    columns = _binary_columns(binary)
                    names = sorted(binary.name_to_id)
            else:
                with contextlib.closing(DFReader_text(str(path), zero_time_base=True)) as text:
                    columns, names = _text_columns(text), sorted(text.formats)
    except (OSError, MemoryError):
        raise
    except Exception as error:  # whatever the library raises for malformed bytes
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path}: damaged: {reason}") from None
    return columns, names, lines[0] if lines else ""


def _binary_columns(log_file: "DFReader_binary") -> dict[str, dict[str, AnyArray]]:
    """Return the columns of a binary log by message and field, in the units of the log.

    The log defines a letter for each field of a message: its type, and the divisor of integers.
    """
    content = np.frombuffer(log_file.data_map, np.uint8)
    tables = {}
    for name in _NAMES:
        number = log_file.name_to_id.get(name)
        form = log_file.formats.get(number)
        if number is None or form is None or len(form.format) != len(form.columns):
            continue
        letters = zip(form.columns, form.format, strict=True)
        row = np.dtype([(column, _CELLS[letter]) for column, letter in letters])
        offsets = np.asarray(log_file.offsets[number], np.int64)
        offsets = offsets[offsets + form.len <= len(content)]
        if row.itemsize + _HEAD_BYTES != form.len or not len(offsets):
            continue
        windows = np.lib.stride_tricks.sliding_window_view(content, row.itemsize)
        table = np.ascontiguousarray(windows[offsets + _HEAD_BYTES]).view(row)[:, 0]
        tables[name] = {
            column: table[column] / _DIVISORS[letter] if letter in _DIVISORS else table[column]
            for column, letter in zip(form.columns, form.format, strict=True)
            if letter not in "nNZ"  # texts
        }
    del content
    return tables


def _text_columns(log_file: "DFReader_text") -> dict[str, dict[str, AnyArray]]:
    """Return the columns of a text log by message and field."""
    rows: dict[str, list[list[object]]] = {}
    fields: dict[str, list[str]] = {}
    while (message := log_file.recv_match(type=list(_NAMES))) is not None:
        name = message.get_type()
        columns = [
            column
            for column, letter in zip(message.fmt.columns, message.fmt.format, strict=False)
            if letter not in "nNZa"
        ]
        if fields.setdefault(name, columns) != columns:
            continue  # defined anew in the middle of the log
        rows.setdefault(name, []).append([getattr(message, column) for column in columns])
    return {
        name: dict(zip(fields[name], np.array(values).T, strict=True))
        for name, values in rows.items()
    }


def _tables(columns: Mapping[str, Mapping[str, AnyArray]], remarks: list[str]) -> Tables:
    """Return a table for each instance of a message.

    Instances have numbers in the name (IMU, IMU2) or in a field (I).

    :param columns: numbers (n,) by field, of each message by name.
    :param remarks: receives a line about messages that are left out.
    """
    tables: dict[str, list[_Table]] = {}
    for name, fields in columns.items():
        if "TimeUS" not in fields:
            continue
        stem = name.rstrip("123") if name not in ("XKF1", "NKF1", "XKQ1", "AHR2", "SIM2") else name
        stem = {"BAR": "BARO", "XKQ1": "XKQ"}.get(stem, stem)
        table = _Table(stem, 0, fields)
        stamps = fields.get("SampleUS", fields["TimeUS"])
        valid = (stamps >= 0) & (stamps < _LAST_STAMP)
        if not valid.all():
            remarks.append(
                f"{name}: {np.count_nonzero(~valid)} messages left out, whose stamps are no times "
                "since the start"
            )
            table = table.rows(valid)
        numbered = next((field for field in _INSTANCE_FIELDS if field in table.columns), None)
        if numbered is None:
            digit = name[len(stem) :] if name.startswith(stem) else name[-1]
            instance = int(digit) - 1 if digit.isdigit() else 0
            parts = {instance: table}
        else:
            numbers = table.columns[numbered]
            parts = {int(k): table.rows(numbers == k) for k in np.unique(numbers)}
        tables.setdefault(stem, []).extend(
            part._replace(instance=instance)
            for instance, part in parts.items()
            if len(part.columns["TimeUS"])
        )
    return tables


def _readings(tables: Tables, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the readings of IMU, with the temperature, and of GYR with ACC."""
    for table in tables.get("IMU", ()):
        gyro = table.vector("GyrX", "GyrY", "GyrZ")
        accel = table.vector("AccX", "AccY", "AccZ")
        if gyro is None or accel is None:
            continue
        yield log.imu(
            table.topic, table.t_ns, axes.flu(gyro), axes.flu(accel), aliases=table.aliases
        )
        degrees = table.columns.get("T")
        if degrees is not None and degrees.any():
            name = f"{table.topic}/temperature"
            yield log.temperature(name, table.t_ns, degrees.astype(np.float64))
    triads = [
        {
            table.instance: LogTriad(table.topic, table.aliases, table.t_ns, axes.flu(values))
            for table in tables.get(name, ())
            if (values := table.vector(*(f"{field}{axis}" for axis in "XYZ"))) is not None
        }
        for name, field in (("GYR", "Gyr"), ("ACC", "Acc"))
    ]
    for number in sorted({*triads[0], *triads[1]}):
        yield from log.pair(triads[0].get(number), triads[1].get(number), remarks)


def _batches(tables: Tables, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the samples of the batches of ISBH and ISBD, each triad alone.

    ArduPilot samples one triad after the other, so that they have no time in common.
    """
    heads, parts = (list(tables.get(name, ())) for name in ("ISBH", "ISBD"))
    if not heads or not parts or any(axis not in parts[0].columns for axis in "xyz"):
        return
    head, data = heads[0].columns, parts[0].columns
    samples: dict[tuple[int, int], list[tuple[Times, Array]]] = {}
    lost = 0
    runs = np.flatnonzero(np.diff(data["N"].astype(np.int64), prepend=-1))
    place = 0
    for start, stop in zip(runs, [*runs[1:], len(data["N"])], strict=True):
        match = np.flatnonzero(head["N"][place:] == data["N"][start])
        if not len(match):
            lost += 1
            continue
        row = place + int(match[0])
        place = row + 1
        rate, scale = float(head["smp_rate"][row]), float(head["mul"][row])
        if not (np.isfinite(rate) and rate > 0.0 and scale > 0.0):
            lost += 1
            continue
        number = data["seqno"][start:stop, None].astype(np.int64) * _BATCH + np.arange(_BATCH)
        valid = number < int(head["smp_cnt"][row])
        values = np.stack([data[axis][start:stop] for axis in "xyz"], axis=-1) / scale
        began_ns = int(head["SampleUS"][row]) * _MICROSECOND
        t_ns = began_ns + np.rint(number * (1e9 / rate)).astype(np.int64)
        key = int(head["type"][row]), int(head["instance"][row])
        samples.setdefault(key, []).append((t_ns[valid], values[valid]))
    if lost:
        remarks.append(f"ISBD: {lost} batches left out, which have no head ISBH")
    for (kind, instance), pieces in sorted(samples.items()):
        t_ns = np.concatenate([times for times, _ in pieces])
        values = axes.flu(np.concatenate([rows for _, rows in pieces]))
        name = "gyro" if kind else "accel"
        columns = (values, None) if kind else (None, values)
        names = (f"ISBH/{name}/{instance}",)
        if len(t_ns):
            yield log.imu(f"/ISBH_{name}_{instance}", t_ns, *columns, aliases=names)


def _filters(tables: Tables, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the estimates of the extended Kalman filters, and the truth of the simulator."""
    for name in ("XKF1", "NKF1"):
        quaternions = {table.instance: table for table in tables.get("XKQ", ())}
        for table in tables.get(name, ()):
            exact = quaternions.get(table.instance) if name == "XKF1" else None
            attitudes = table if exact is None else exact
            yield from _odometry(table, attitudes, table.topic, remarks)
    for table in tables.get("SIM2", ())[:1]:
        for attitudes in tables.get("SIM", ())[:1]:
            yield from _odometry(table, attitudes, f"/{TRUTH_TOPIC}", remarks)


def _odometry(
    table: _Table, attitudes: _Table, topic: str, remarks: list[str]
) -> Iterator[LogStream]:
    """Yield poses of a local NED frame with velocities, and attitudes of another message."""
    position, velocity = table.vector("PN", "PE", "PD"), table.vector("VN", "VE", "VD")
    q_wb = _attitude(attitudes)
    if position is None or velocity is None or q_wb is None:
        return
    times, t_ns = attitudes.t_ns, table.t_ns
    rows = (t_ns >= times.min()) & (t_ns <= times.max())
    if not rows.all():
        count = np.count_nonzero(~rows)
        remarks.append(f"{table.name}: {count} poses left out, which have no attitude")
    if rows.any():
        yield log.odometry(
            topic,
            t_ns[rows],
            axes.enu(position[rows]),
            log.attitudes_at(times, t_ns[rows], q_wb),
            axes.enu(velocity[rows]),
            aliases=table.aliases,
        )


def _attitude(table: _Table) -> Array | None:
    """Return the attitudes (n, 4) in ENU of quaternions, or of angles in degrees."""
    q = table.vector("Q1", "Q2", "Q3", "Q4")
    if q is None:
        angles = table.vector("Roll", "Pitch", "Yaw")
        q = None if angles is None else from_euler(np.radians(angles))
    if q is None or not (np.linalg.norm(q, axis=1) > 0.5).all():
        return None
    return axes.q_enu_flu(q)


def _positions(tables: Tables, remarks: list[str]) -> Iterator[LogStream]:
    """Yield POS with the attitude ATT, and AHR2, in the tangent plane of their first position."""
    for name, source in (("POS", "ATT"), ("AHR2", "AHR2")):
        for table in tables.get(name, ())[:1]:
            attitudes = next(iter(tables.get(source, ())), None)
            geodetic = table.vector("Lat", "Lng", "Alt")
            q_wb = None if attitudes is None else _attitude(attitudes)
            if geodetic is None or attitudes is None or q_wb is None:
                continue
            times, t_ns = attitudes.t_ns, table.t_ns
            rows = (t_ns >= times.min()) & (t_ns <= times.max())
            rows &= (np.abs(geodetic[:, :2]) > 0.0).any(axis=1)  # 0, 0: not known yet
            if not rows.any():
                continue
            place = geodetic[rows]
            q_wb = log.attitudes_at(times, t_ns[rows], q_wb)
            local = tangent_plane(place, place[0])
            yield log.poses(table.topic, t_ns[rows], local, q_wb, aliases=table.aliases)


def _receivers(tables: Tables, remarks: list[str]) -> Iterator[LogStream]:
    """Yield positions and velocities of GNSS receivers, with the accuracies of GPA."""
    accuracies = {table.instance: table for table in tables.get("GPA", ())}
    for table in tables.get("GPS", ()):
        place = table.vector("Lat", "Lng", "Alt")
        if place is None:
            continue
        t_ns = table.t_ns
        status = table.columns.get("Status", np.full(len(t_ns), _FIX_2D))
        has_fix = status >= _FIX_2D
        deviations = np.zeros((len(t_ns), 3))
        accuracy = accuracies.get(table.instance)
        stated = None if accuracy is None else accuracy.vector("HAcc", "VAcc", "SAcc")
        if accuracy is not None and stated is not None:
            deviations = interpolate_columns(accuracy.t_ns, t_ns, stated)
        latitude, longitude, height = place.T
        yield log.fix(
            table.topic,
            t_ns,
            (latitude, longitude, height),
            has_fix,
            (deviations[:, 0], deviations[:, 1]),
            table.aliases,
        )
        motion = table.vector("Spd", "GCrs", "VZ")
        if motion is not None:
            speed, course, down = motion[has_fix].T
            course = np.radians(course)
            velocity = np.column_stack([speed * np.sin(course), speed * np.cos(course), -down])
            name = f"{table.topic}/velocity"
            yield log.velocity(name, t_ns[has_fix], velocity, deviations[has_fix, 2])


def _clippings(tables: Tables) -> Iterator[ClippingCounts]:
    """Yield the counts of clipped accelerometer readings: Clip by IMU, or Clip0, Clip1, Clip2."""
    for table in tables.get("VIBE", ()):
        for field, number in (("Clip", table.instance), *((f"Clip{k}", k) for k in range(3))):
            if field in table.columns:
                total = table.columns[field].astype(np.int64)
                yield ClippingCounts(f"IMU/{number}", TRIADS[1], table.t_ns, total)


def _environment(tables: Tables, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the magnetic fields of MAG and the pressures of BARO."""
    for table in tables.get("MAG", ()):
        field = table.vector("MagX", "MagY", "MagZ")
        if field is not None:
            field_t = axes.flu(field) * _MILLIGAUSS
            yield log.magnetic_field(table.topic, table.t_ns, field_t, table.aliases)
    for table in tables.get("BARO", ()):
        pressure = table.vector("Press")
        if pressure is not None:
            yield log.pressure(table.topic, table.t_ns, pressure[:, 0], table.aliases)


_READERS: Final = (_readings, _batches, _filters, _positions, _receivers, _environment)
"""Functions that yield streams of the tables, in the order in which they are listed."""
