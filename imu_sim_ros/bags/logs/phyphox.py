# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of phones by phyphox (phyphox.org): a folder or zip, one CSV a set of data.

The export sets of the experiments (repository phyphox/phyphox-experiments) name their columns
``Time (s)``, ``Acceleration x (m/s^2)``, ``Gyroscope x (rad/s)``, ``Magnetic Field x (µT)``,
``Pressure (hPa)``, ``Latitude (°)``, or ``X (m/s^2)`` in a file named after the sensor; names are
translated, units are not. Separators are commas, semicolons or tabs, with decimal points or commas.
The axes are those of the screen: x to the right, y up, z out of it. phyphox gives accelerations the
signs of a specific force on both systems (``kG = -9.81`` in ``ExperimentSensorInput.swift``).

Times count from the start of the experiment, without its pauses; ``meta/time.csv`` has the UTC of
each start and pause (repository phyphox/phyphox-docs, "Saved states").
"""

import csv
import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.logs import archive, columns, log
from imu_sim_ros.bags.logs.archive import Archive
from imu_sim_ros.bags.logs.columns import ColumnTable
from imu_sim_ros.bags.logs.log import Contents, LogStream, LogTriad
from imu_sim_ros.bags.messages.encode import FLUID_PRESSURE, IMU, MAGNETIC_FIELD
from imu_sim_ros.core.timebase import interpolate_columns
from imu_sim_ros.core.types import Array, Times

MEMORY = 7
"""Memory that reading takes, in sizes of the file."""
_META: Final = ("/meta/device.csv", "/meta/time.csv")
_SECOND: Final = "s"
_FORCE: Final = "m/s^2"
_RATE: Final = "rad/s"
_FIELD: Final = "uT"
_PRESSURE: Final = "hPa"
_ANGLE: Final = "deg"
_UNITS: Final = {
    _SECOND: _SECOND,
    _RATE: _RATE,
    _PRESSURE: _PRESSURE,
    **dict.fromkeys(("m/s^2", "m/s²", "m/s2"), _FORCE),
    **dict.fromkeys(("µT", "μT", "uT"), _FIELD),
    **dict.fromkeys(("°", "deg"), _ANGLE),
}
"""Units of columns by their spellings."""
_NUMBERS: Final = {_FIELD: 1e-6, _PRESSURE: 100.0}
"""SI values of units [T], [Pa]."""
_AXIS: Final = re.compile(r"(?<![a-z])([xyz])(?![a-z])", re.IGNORECASE)
_LINEAR: Final = re.compile(r"lin(i|e)|without g|ohne g|senza g|sin g|sans g", re.IGNORECASE)
"""Names of accelerations without gravity in languages with Latin letters."""
_GRAVITY_NAME: Final = re.compile(r"grav|schwere", re.IGNORECASE)
_HALF_G: Final = 4.9
"""Median length above which an acceleration contains gravity, whatever its name says [m/s^2]."""
_PREFERRED: Final = {
    IMU: ("/gyroscope", "/accelerometer"),
    MAGNETIC_FIELD: ("/magnetometer",),
    FLUID_PRESSURE: ("/barometer",),
}
"""Topics that are read if the user names none."""


class _Set(NamedTuple):
    """One quantity of an export set."""

    name: str
    """Name of the file and of the columns, without accents."""
    unit: str
    """Unit of the columns."""
    t_s: Array
    """(n,) times since the start of the experiment [s]."""
    values: Array
    """(n, m) columns: x, y, z, or a single number."""


class _Clock(NamedTuple):
    """UTC of the times of an experiment."""

    starts_s: Array
    """(n,) times of the experiment at which it was started or continued [s]."""
    offsets_ns: Times
    """(n,) UTC of the experiment's start, with the pauses so far."""

    def t_ns(self, t_s: Array) -> Times:
        """Return stamps (n,) of times of the experiment (n,) [s]."""
        piece = np.searchsorted(self.starts_s, t_s, side="right") - 1
        offsets = self.offsets_ns[np.maximum(piece, 0)]
        stamps: Times = offsets + np.rint(t_s * 1e9).astype(np.int64)
        return stamps


def holds(path: Path, magic: bytes) -> bool:
    """Return True for a folder or zip with export sets of phyphox."""
    if not archive.is_archive(path, magic):
        return False
    with Archive(path, depth=2) as files:
        if files.names_of(*_META):
            return True
        names = [name for name in files.names_of(".csv") if name.count("/") <= 1]
        return any(_is_set(files.read(name, columns.HEAD_BYTES)) for name in names)


def contents(path: Path) -> Contents:
    """Return the topics of a recording; see :class:`imu_sim_ros.bags.logs.log.LogFormat`."""
    damage: list[str] = []
    remarks: list[str] = []
    sets: list[_Set] = []
    locations: list[ColumnTable] = []
    with Archive(path, depth=2) as files:
        clock = _clock(files, remarks)
        names = [name for name in files.names_of(".csv") if "/meta/" not in f"/{name}".lower()]
        files.refuse_several(names)
        for name in names:
            lines = columns.lines_of(f"{path}: {name}", files.read(name))
            table = columns.table_of(name, lines)
            if _time_column(table) is None:
                continue
            sets += _sets(table, damage)
            if len(_columns_of(table, _ANGLE)) >= 2:
                locations.append(table)
    streams = list(_streams(sets, clock, remarks))
    streams += [stream for table in locations for stream in _location(table, clock, damage)]
    if not streams:
        raise log.refuse_empty(path, "a recording of phyphox", names)
    return Contents(streams, _PREFERRED, (), tuple(damage), tuple(remarks))


def _is_set(content: bytes) -> bool:
    """Return True if a file begins with columns of time and of a sensor."""
    table = columns.table_of("", content.split(b"\n")[:1])
    units = {_unit(name) for name in table.names}
    return _SECOND in units and bool(units & {_FORCE, _RATE, _FIELD, _PRESSURE})


def _unit(name: str) -> str | None:
    """Return the unit in the name of a column as in ``_UNITS``; None: an unknown one."""
    return _UNITS.get(columns.split_unit(name)[1])


def _plain(name: str) -> str:
    """Return a name without accents."""
    return unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()


def _time_column(table: ColumnTable) -> str | None:
    """Return the name of the column of times; None: there is none."""
    return next((name for name in table.names if _unit(name) == _SECOND), None)


def _columns_of(table: ColumnTable, unit: str) -> list[str]:
    """Return the names of the columns with a unit."""
    return [name for name in table.names if _unit(name) == unit]


def _sets(table: ColumnTable, damage: list[str]) -> Iterator[_Set]:
    """Yield the quantities of a table: columns x, y, z of one unit and name, or a pressure."""
    time = str(_time_column(table))
    for unit in (_FORCE, _RATE, _FIELD, _PRESSURE):
        axes: dict[str, dict[str, str]] = {}
        for column in _columns_of(table, unit):
            plain = _plain(columns.split_unit(column)[0])
            match = _AXIS.search(plain)
            if match is not None:
                quantity = (plain[: match.start()] + plain[match.end() :]).strip()
                axes.setdefault(quantity, {})[match[1].lower()] = column
            elif unit == _PRESSURE:
                axes.setdefault(plain, {})[""] = column
        for quantity, names in axes.items():
            letters = "xyz" if unit != _PRESSURE else [""]
            if any(letter not in names for letter in letters):
                continue
            numbers = table.numbers([time, *(names[letter] for letter in letters)], damage)
            if len(numbers):
                label = f"{_plain(archive.stem(table.source))} {quantity}"
                scaled = numbers[:, 1:] * _NUMBERS.get(unit, 1.0)
                yield _Set(label, unit, numbers[:, 0], scaled)


def _clock(files: Archive, remarks: list[str]) -> _Clock:
    """Return the UTC of the experiment's times, from meta/time.csv."""
    starts = []
    for name in files.names_of(_META[1])[:1]:
        text = files.read(name).decode("utf-8", "replace").lstrip("\ufeff")
        separator = next((mark for mark in (";", "\t") if mark in text.partition("\n")[0]), ",")
        for row in csv.reader(text.splitlines(), delimiter=separator):
            if row and row[0].strip().upper() == "START" and len(row) > 2:
                starts += _start([cell.replace(",", ".") for cell in row[1:3]])
    if not starts:
        remarks.append("there is no meta/time.csv with a start: the stamps count from it")
        return _Clock(np.zeros(1), np.zeros(1, np.int64))
    times = np.array([start[0] for start in starts])
    return _Clock(times, np.array([start[1] for start in starts], np.int64))


def _start(cells: Sequence[str]) -> list[tuple[float, int]]:
    """Return the time of a start [s] and the UTC [ns] of time 0; nothing for bad cells."""
    try:
        time_s, system_s = float(cells[0]), float(cells[1])
    except ValueError:
        return []
    if not (0.0 <= time_s < 1e9 and 0.0 <= system_s < 2.0**31):
        return []
    # The system's time has milliseconds.
    return [(time_s, round(system_s * 1e3) * 10**6 - round(time_s * 1e9))]


def _streams(sets: Sequence[_Set], clock: _Clock, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the readings of gyroscope, accelerometer, magnetometer and barometer."""
    sets_by_unit: Mapping[str, list[_Set]] = {
        unit: [entry for entry in sets if entry.unit == unit]
        for unit in (_FORCE, _RATE, _FIELD, _PRESSURE)
    }
    gyro = [_triad("/gyroscope", entry, clock) for entry in sets_by_unit[_RATE][:1]]
    accel = _specific_force(sets_by_unit[_FORCE], clock, remarks)
    yield from log.pair(gyro[0] if gyro else None, accel, remarks)
    for entry in sets_by_unit[_FIELD][:1]:
        field = _triad("/magnetometer", entry, clock)
        yield log.magnetic_field(field.topic, field.t_ns, field.values)
    for entry in sets_by_unit[_PRESSURE][:1]:
        pressure = _triad("/barometer", entry, clock)
        yield log.pressure(pressure.topic, pressure.t_ns, pressure.values[:, 0])


def _triad(topic: str, entry: _Set, clock: _Clock) -> LogTriad:
    """Return a quantity with stamps that a message of ROS holds."""
    t_ns = clock.t_ns(entry.t_s)
    rows = columns.valid_stamps(t_ns)
    return LogTriad(topic, (entry.name.strip(),), t_ns[rows], entry.values[rows])


def _specific_force(sets: Sequence[_Set], clock: _Clock, remarks: list[str]) -> LogTriad | None:
    """Return the acceleration with gravity: a quantity of the export, or the sum of two."""
    topic = "/accelerometer"
    gravity = next((entry for entry in sets if _GRAVITY_NAME.search(entry.name)), None)
    motions = [entry for entry in sets if entry is not gravity]
    totals = [entry for entry in motions if not _LINEAR.search(entry.name)]
    total = next((entry for entry in totals if _median_length(entry) > _HALF_G), None)
    if total is not None:
        return _triad(topic, total, clock)
    if not motions:
        return None
    if gravity is None:
        remarks.append(
            "the acceleration is left out: it is without gravity, which was not exported"
        )
        return None
    motion, down = _triad(topic, motions[0], clock), _triad("", gravity, clock)
    values = interpolate_columns(down.t_ns, motion.t_ns, down.values)
    remarks.append("the specific force is the sum of acceleration and gravity")
    return LogTriad(topic, motion.aliases, motion.t_ns, motion.values + values)


def _median_length(entry: _Set) -> float:
    """Return the median norm of the rows of a quantity."""
    return float(np.median(np.linalg.norm(entry.values, axis=1)))


def _location(table: ColumnTable, clock: _Clock, damage: list[str]) -> Iterator[LogStream]:
    """Yield the positions of the phone."""
    column_names = {columns.split_unit(name)[0].lower(): name for name in table.names}
    position_columns = [column_names.get(name) for name in ("latitude", "longitude")]
    heights = ("altitude wgs84", "altitude", "height")
    height = next((column_names[name] for name in heights if name in column_names), None)
    if None in position_columns or height is None:
        return
    accuracies = [column_names.get(f"{name} accuracy") for name in ("horizontal", "vertical")]
    names = [str(_time_column(table)), *map(str, position_columns), height]
    names += [name for name in accuracies if name is not None]
    numbers = table.numbers(names, damage)
    t_ns = clock.t_ns(numbers[:, 0])
    rows = columns.valid_stamps(t_ns)
    if not rows.any():
        return
    numbers, t_ns = numbers[rows], t_ns[rows]
    zeros = np.zeros(len(t_ns))
    deviations = (zeros, zeros) if numbers.shape[1] < 6 else (numbers[:, 4], numbers[:, 5])
    latitude, longitude, altitude = numbers[:, 1:4].T
    has_fix = np.ones(len(t_ns), np.bool_)
    yield log.fix("/location", t_ns, (latitude, longitude, altitude), has_fix, deviations)
