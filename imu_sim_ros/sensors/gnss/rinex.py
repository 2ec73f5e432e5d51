# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""RINEX of GPS: writing of observations and navigation data (3.04), reading of the latter."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final, NamedTuple, TextIO

import numpy as np

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.gps_time import GPS_EPOCH, WEEK
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.inputs.rows import read_text
from imu_sim_ros.sensors.gnss.satellites import Ephemerides

_VERSION: Final = "     3.04"
_PROGRAM: Final = "imu_sim_ros"
_SIGNALS: Final = (("C1C", "L1C", "D1C", "S1C"), ("C2W", "L2W", "D2W", "S2W"))
_TICKS: Final = 10**7
"""Ticks in a second: times have seven decimals."""
_STRENGTH: Final = (35.0, 15.0)
"""Carrier-to-noise density at elevation 0, and its increase at the zenith [dBHz]."""
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
    """Measurements of k satellites at n times."""

    tag_ns: Times
    """(n,) GPS times of the receiver's clock, since the beginning of GPS [ns]."""
    pseudorange: Array
    """(n, k, f) pseudorange [m]; NaN: not measured."""
    carrier_phase: Array
    """(n, k, f) carrier phase [cycles]."""
    doppler: Array
    """(n, k, f) Doppler shift [Hz]."""
    elevation: Array
    """(n, k) elevation [rad]."""
    slipped: Array
    """(n, k) True if a satellite was acquired again."""


def observation_header(
    position: Array, frequencies: int, start_ns: int, interval: float, leap: int
) -> str:
    """Return the header of an observation file.

    :param position: (3,) approximate, Earth-fixed position of the antenna [m].
    :param frequencies: 1 or 2.
    :param start_ns: time of the first epoch, since the beginning of GPS [ns].
    :param interval: interval of the epochs [s].
    :param leap: GPS time minus UTC [s].
    """
    kinds = [kind for signals in _SIGNALS[:frequencies] for kind in signals]
    when, rest = _calendar(start_ns // 100)
    seconds = f"{when.second:5d}.{rest:07d}"
    lines = [
        (f"{_VERSION:20}{'OBSERVATION DATA':20}{'G: GPS':20}", "RINEX VERSION / TYPE"),
        (f"{_PROGRAM:20}{'':20}{when:%Y%m%d %H%M%S} GPS", "PGM / RUN BY / DATE"),
        ("SIMULATED", "MARKER NAME"),
        ("", "OBSERVER / AGENCY"),
        (f"{'':20}{_PROGRAM:20}", "REC # / TYPE / VERS"),
        ("", "ANT # / TYPE"),
        ("".join(f"{coordinate:14.4f}" for coordinate in position), "APPROX POSITION XYZ"),
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
    return _header_text(lines)


def observations(epochs: Epochs) -> Iterator[str]:
    """Yield the records of epochs; those without any satellite are left out."""
    at_horizon, increase = _STRENGTH
    strength = at_horizon + increase * np.sin(epochs.elevation)
    for k, tick in enumerate((epochs.tag_ns // 100).tolist()):
        measured = np.flatnonzero(~np.isnan(epochs.elevation[k]))
        if not len(measured):
            continue
        when, rest = _calendar(tick)
        lines = [f"> {when:%Y %m %d %H %M} {when.second:2d}.{rest:07d}  0{len(measured):3d}\n"]
        for s in measured.tolist():
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

    :param ionosphere: (8,) Klobuchar's alpha and beta; None: not stated.
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
    file.write(_header_text(lines))
    for ephemerides in satellites:
        for k in range(len(ephemerides.prn)):
            file.write(
                _ephemeris({name: values[k] for name, values in ephemerides._asdict().items()})
            )


def _ephemeris(numbers: Mapping[str, float]) -> str:
    """Return the record of an ephemeris in RINEX."""
    when, _ = _calendar(int((numbers["week"] * WEEK + int(numbers["toc"])) * _TICKS))
    extra = {"codes": 1.0, "l2p": 0.0, "accuracy": 2.0, "health": 0.0, "iodc": numbers["iode"]}
    all_numbers = {**numbers, **extra}
    rows = ["".join(_fortran(float(all_numbers[name])) for name in row) for row in _RECORD]
    first_line = f"G{numbers['prn']:02d} {when:%Y %m %d %H %M %S}{rows[0]}"
    end = f"    {_fortran(float(numbers['toe']))}{_fortran(4.0)}"
    return "\n".join([first_line, *(f"    {row}" for row in rows[1:]), end]) + "\n"


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
    is_version_2 = version.startswith("2")
    records = list(_records(lines[end + 1 :], is_version_2))
    try:
        ephemerides = [_read_record(record, is_version_2) for record in records]
        ionosphere = _read_ionosphere(head)
    except (ValueError, IndexError, OverflowError) as error:
        raise InputError(f"{path}: not an ephemeris of GPS: {error}") from None
    healthy = [ephemeris for ephemeris in ephemerides if ephemeris["health"] == 0.0]
    if not healthy:
        raise InputError(f"{path}: holds no healthy satellite of GPS")
    whole = ("prn", "week", "iode")
    columns = {
        name: np.array([ephemeris[name] for ephemeris in healthy]).astype(
            np.int64 if name in whole else float
        )
        for name in Ephemerides._fields
    }
    return Ephemerides(**columns), ionosphere


def _records(lines: Sequence[str], is_version_2: bool) -> Iterator[list[str]]:
    """Yield the eight lines of each ephemeris of GPS."""
    if is_version_2:
        yield from (list(lines[k : k + 8]) for k in range(0, len(lines), 8) if any(lines[k:]))
        return
    starts = [k for k, line in enumerate(lines) if line[:1].isalpha()]
    yield from (list(lines[k : k + 8]) for k in starts if lines[k].startswith("G"))


def _read_record(lines: Sequence[str], is_version_2: bool) -> dict[str, float]:
    """Return an ephemeris of its lines."""
    column = 22 if is_version_2 else 23
    head = lines[0][:column].removeprefix("G").split()
    prn, year, month, day, hour, minute = (int(float(word)) for word in head[:6])
    if is_version_2:
        year += 1900 if year >= 80 else 2000
    clock = datetime(year, month, day, hour, minute, tzinfo=GPS_EPOCH.tzinfo)
    toc = (clock - GPS_EPOCH).total_seconds() + float(head[6])
    numbers: dict[str, float] = {"prn": prn}
    for number, names in enumerate(_RECORD):
        line = lines[number] if number < len(lines) else ""
        start = column if number == 0 else column - 19
        for k, name in enumerate(names):
            word = line[start + 19 * k : start + 19 * (k + 1)].replace("D", "E").rstrip()
            if (word and len(word) < 19) or not (word or name in _MAY_BE_BLANK):
                raise ValueError(f"that of satellite {prn} at {clock} is cut short")
            numbers[name] = float(word) if word else 0.0
            if not math.isfinite(numbers[name]):
                raise ValueError(f"{name} = {word.strip()} of satellite {prn}: must be finite")
    # Files of old receivers count weeks modulo 1024; the clock's date decides which.
    weeks = round((toc - numbers["toe"]) / WEEK)
    return {**numbers, "week": weeks, "toc": toc - weeks * WEEK}


def _read_ionosphere(head: Sequence[str]) -> Array | None:
    """Return Klobuchar's alpha and beta, eight numbers; None if they are not stated."""
    rows = {}
    for line in head:
        label = line[60:].strip()
        for name, version_2_label in (("GPSA", "ION ALPHA"), ("GPSB", "ION BETA")):
            column = 2 if label == version_2_label else 5 if line.startswith(name) else 0
            if column:
                entries = [line[column + 12 * k : column + 12 * (k + 1)] for k in range(4)]
                rows[name] = [float(entry.replace("D", "E")) for entry in entries]
    return np.array(rows["GPSA"] + rows["GPSB"]) if len(rows) == 2 else None


def _fortran(value: float, digits: int = 12, width: int = 19) -> str:
    """Return a number in Fortran's notation with D."""
    return f"{value:{width}.{digits}E}".replace("E", "D")


def _header_text(lines: Sequence[tuple[str, str]]) -> str:
    """Return header lines, each with its label in column 61."""
    return "".join(f"{text:60}{label:20}".rstrip() + "\n" for text, label in lines)


def _calendar(tick: int) -> tuple[datetime, int]:
    """Return date and time of a tick, and the ticks behind the second."""
    second, rest = divmod(tick, _TICKS)
    return GPS_EPOCH + timedelta(seconds=second), rest
