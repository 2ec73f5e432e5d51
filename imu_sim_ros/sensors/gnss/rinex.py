# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""RINEX: observation and navigation files of GPS are written (3.04), the latter read (2 and 3)."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final, NamedTuple, TextIO

import numpy as np

from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.rows import read_text
from imu_sim_ros.sensors.gnss.satellites import GPS_EPOCH, WEEK, Ephemerides
from imu_sim_ros.types import Array, Times

_VERSION: Final = "     3.04"
_PROGRAM: Final = "imu_sim_ros"
_SIGNALS: Final = (("C1C", "L1C", "D1C", "S1C"), ("C2W", "L2W", "D2W", "S2W"))
_TICKS: Final = 10**7
"""In a second: times have seven decimals."""
_STRENGTH: Final = (35.0, 15.0)
"""[dBHz] Carrier over noise density at elevation 0, and what the zenith has more."""
_RECORD: Final = (
    ("af0", "af1", "af2"),
    ("iode", "crs", "delta_n", "m0"),
    ("cuc", "eccentricity", "cus", "sqrt_a"),
    ("toe", "cic", "omega0", "cis"),
    ("i0", "crc", "omega", "omega_dot"),
    ("idot", "codes", "week", "l2p"),
    ("accuracy", "health", "tgd", "iodc"),
)
"""Numbers of an ephemeris, line by line; those of the first follow satellite and clock's time."""

_MAY_BE_BLANK: Final = ("codes", "l2p", "accuracy", "health", "tgd", "iodc")


class Epochs(NamedTuple):
    """n times at which k satellites were measured."""

    tag_ns: Times
    """(n,) GPS times that the receiver's clock shows, since the beginning of GPS [ns]."""
    pseudorange: Array
    """(n, k, f) [m]; NaN: not measured."""
    carrier_phase: Array
    """(n, k, f) [cycles]"""
    doppler: Array
    """(n, k, f) [Hz]"""
    elevation: Array
    """(n, k) [rad]"""
    slipped: Array
    """(n, k) whether a satellite was found anew."""


def observation_header(
    position: Array, frequencies: int, first: int, interval: float, leap: int
) -> str:
    """Return the header of an observation file.

    :param position: (3,) approximate, of the antenna, Earth-fixed [m].
    :param frequencies: 1 or 2.
    :param first: time of the first epoch, since the beginning of GPS [ns].
    :param interval: [s]
    :param leap: GPS time minus UTC [s].
    """
    kinds = [kind for signals in _SIGNALS[:frequencies] for kind in signals]
    when, rest = _calendar(first // 100)
    seconds = f"{when.second:5d}.{rest:07d}"
    lines = [
        (f"{_VERSION:20}{'OBSERVATION DATA':20}{'G: GPS':20}", "RINEX VERSION / TYPE"),
        (f"{_PROGRAM:20}{'':20}{when:%Y%m%d %H%M%S} GPS", "PGM / RUN BY / DATE"),
        ("SIMULATED", "MARKER NAME"),
        ("", "OBSERVER / AGENCY"),
        (f"{'':20}{_PROGRAM:20}", "REC # / TYPE / VERS"),
        ("", "ANT # / TYPE"),
        ("".join(f"{one:14.4f}" for one in position), "APPROX POSITION XYZ"),
        (f"{0:14.4f}" * 3, "ANTENNA: DELTA H/E/N"),
        (f"G  {len(kinds):3d}" + "".join(f" {kind}" for kind in kinds), "SYS / # / OBS TYPES"),
        ("DBHZ", "SIGNAL STRENGTH UNIT"),
        (f"{interval:10.3f}", "INTERVAL"),
        (
            f"{when.year:6d}{when.month:6d}{when.day:6d}{when.hour:6d}{when.minute:6d}{seconds}"
            f"{'GPS':>8}",
            "TIME OF FIRST OBS",
        ),
        *((f"G {kind}", "SYS / PHASE SHIFT") for kind in kinds if kind[0] == "L"),
        ("  0", "GLONASS SLOT / FRQ #"),
        (" C1C    0.000 C1P    0.000 C2C    0.000 C2P    0.000", "GLONASS COD/PHS/BIS"),
        (f"{leap:6d}", "LEAP SECONDS"),
        ("", "END OF HEADER"),
    ]
    return _joined(lines)


def observations(epochs: Epochs) -> Iterator[str]:
    """Yield the records of epochs; those without any satellite are left out."""
    below, more = _STRENGTH
    strength = below + more * np.sin(epochs.elevation)
    for k, tick in enumerate((epochs.tag_ns // 100).tolist()):
        seen = np.flatnonzero(~np.isnan(epochs.elevation[k]))
        if not len(seen):
            continue
        when, rest = _calendar(tick)
        lines = [f"> {when:%Y %m %d %H %M} {when.second:2d}.{rest:07d}  0{len(seen):3d}\n"]
        for s in seen.tolist():
            lost, power = "1" if epochs.slipped[k, s] else " ", float(strength[k, s])
            bars = min(max(int(power / 6.0), 1), 9)
            columns = zip(
                epochs.pseudorange[k, s].tolist(),
                epochs.carrier_phase[k, s].tolist(),
                epochs.doppler[k, s].tolist(),
                strict=True,
            )
            numbers = "".join(
                f"{code:14.3f} {bars}{phase:14.3f}{lost}{bars}{doppler:14.3f} {bars}{power:14.3f}  "
                for code, phase, doppler in columns
            )
            lines.append(f"G{s + 1:02d}{numbers.rstrip()}\n")
        yield "".join(lines)


def write_navigation(
    file: TextIO, satellites: Iterable[Ephemerides], ionosphere: Array | None, leap: int
) -> None:
    """Write a navigation file.

    :param ionosphere: (8,) Klobuchar's alpha and beta; None: not given.
    :param leap: GPS time minus UTC [s].
    """
    lines = [
        (f"{_VERSION:20}{'N: GNSS NAV DATA':20}{'G: GPS':20}", "RINEX VERSION / TYPE"),
        (f"{_PROGRAM:20}", "PGM / RUN BY / DATE"),
    ]
    if ionosphere is not None:
        for name, four in (("GPSA", ionosphere[:4]), ("GPSB", ionosphere[4:])):
            numbers = "".join(_fortran(value, 4, 12) for value in four)
            lines.append((f"{name} {numbers}", "IONOSPHERIC CORR"))
    lines += [(f"{leap:6d}", "LEAP SECONDS"), ("", "END OF HEADER")]
    file.write(_joined(lines))
    for known in satellites:
        for k in range(len(known.prn)):
            file.write(_ephemeris({name: values[k] for name, values in known._asdict().items()}))


def _ephemeris(numbers: Mapping[str, Any]) -> str:
    when, _ = _calendar(int((numbers["week"] * WEEK + int(numbers["toc"])) * _TICKS))
    extra = {"codes": 1.0, "l2p": 0.0, "accuracy": 2.0, "health": 0.0, "iodc": numbers["iode"]}
    every = {**numbers, **extra}
    rows = ["".join(_fortran(float(every[name])) for name in row) for row in _RECORD]
    first = f"G{numbers['prn']:02d} {when:%Y %m %d %H %M %S}{rows[0]}"
    end = f"    {_fortran(float(numbers['toe']))}{_fortran(4.0)}"
    return "\n".join([first, *(f"    {row}" for row in rows[1:]), end]) + "\n"


def read_navigation(path: Path) -> tuple[Ephemerides, Array | None]:
    """Return the healthy satellites of GPS in a navigation file, and Klobuchar's eight numbers.

    :raises InputError: for a file that is none, or has no satellite of GPS.
    """
    lines = read_text(path).splitlines()
    end = next((k for k, line in enumerate(lines) if "END OF HEADER" in line), None)
    head = lines[: end or 0]
    version = head[0][:9].strip() if head else ""
    if end is None or "RINEX VERSION" not in head[0] or head[0][20:21] != "N":
        raise InputError(f"{path}: is not a RINEX navigation file")
    if version[:1] not in ("2", "3"):
        raise InputError(f"{path}: RINEX version {version}: must be 2 or 3")
    old = version.startswith("2")
    records = list(_records(lines[end + 1 :], old))
    try:
        read = [_read_record(record, old) for record in records]
        ionosphere = _read_ionosphere(head)
    except (ValueError, IndexError, OverflowError) as error:
        raise InputError(f"{path}: not an ephemeris of GPS: {error}") from None
    sound = [one for one in read if one["health"] == 0.0]
    if not sound:
        raise InputError(f"{path}: holds no healthy satellite of GPS")
    whole = ("prn", "week", "iode")
    columns = {
        name: np.array([one[name] for one in sound]).astype(np.int64 if name in whole else float)
        for name in Ephemerides._fields
    }
    return Ephemerides(**columns), ionosphere


def _records(lines: Sequence[str], old: bool) -> Iterator[list[str]]:
    """Yield the eight lines of each ephemeris of GPS."""
    if old:
        yield from (list(lines[k : k + 8]) for k in range(0, len(lines), 8) if any(lines[k:]))
        return
    starts = [k for k, line in enumerate(lines) if line[:1].isalpha()]
    yield from (list(lines[k : k + 8]) for k in starts if lines[k].startswith("G"))


def _read_record(lines: Sequence[str], old: bool) -> dict[str, float]:
    column = 22 if old else 23
    head = lines[0][:column].removeprefix("G").split()
    prn, year, month, day, hour, minute = (int(float(word)) for word in head[:6])
    if old:
        year += 1900 if year >= 80 else 2000
    clock = datetime(year, month, day, hour, minute, tzinfo=GPS_EPOCH.tzinfo)
    toc = (clock - GPS_EPOCH).total_seconds() + float(head[6])
    found: dict[str, float] = {"prn": prn}
    for number, names in enumerate(_RECORD):
        line = lines[number] if number < len(lines) else ""
        first = column if number == 0 else column - 19
        for k, name in enumerate(names):
            word = line[first + 19 * k : first + 19 * (k + 1)].replace("D", "E").rstrip()
            if (word and len(word) < 19) or not (word or name in _MAY_BE_BLANK):
                raise ValueError(f"that of satellite {prn} at {clock} is cut short")
            found[name] = float(word) if word else 0.0
            if not math.isfinite(found[name]):
                raise ValueError(f"{name} = {word.strip()} of satellite {prn}: must be finite")
    # Files of old receivers count weeks modulo 1024; the clock's date says which are meant.
    near = round((toc - found["toe"]) / WEEK)
    return {**found, "week": near, "toc": toc - near * WEEK}


def _read_ionosphere(head: Sequence[str]) -> Array | None:
    """Return Klobuchar's alpha and beta, eight numbers; None if they are not given."""
    rows = {}
    for line in head:
        label = line[60:].strip()
        for name, old in (("GPSA", "ION ALPHA"), ("GPSB", "ION BETA")):
            column = 2 if label == old else 5 if line.startswith(name) else 0
            if column:
                words = [line[column + 12 * k : column + 12 * (k + 1)] for k in range(4)]
                rows[name] = [float(word.replace("D", "E")) for word in words]
    return np.array(rows["GPSA"] + rows["GPSB"]) if len(rows) == 2 else None


def _fortran(value: float, digits: int = 12, width: int = 19) -> str:
    return f"{value:{width}.{digits}E}".replace("E", "D")


def _joined(lines: Sequence[tuple[str, str]]) -> str:
    return "".join(f"{text:60}{label:20}".rstrip() + "\n" for text, label in lines)


def _calendar(tick: int) -> tuple[datetime, int]:
    """Return date and time of a tick, and the ticks behind the second."""
    second, rest = divmod(tick, _TICKS)
    return GPS_EPOCH + timedelta(seconds=second), rest
