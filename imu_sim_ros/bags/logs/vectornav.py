# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ASCII logs of VectorNav's sensors: ``$VNYMR,...*68``, ``$VNIMU,...*66``, a message a line.

Messages, their fields and units are those of the manuals UM001 (VN-100) and UM004 (VN-200),
"Asynchronous Data Output Type" and "Communication Protocol Control": a checksum of 8 bits
(exclusive or) or 16 bits (CRC-CCITT) follows the asterisk, a status ``S0000`` and a counter
``T1162704`` may precede it. Bodies are forward-right-down, worlds north-east-down, angles are
yaw, pitch and roll [deg].

Messages have no times of their own. The time is that which a logger puts in front of each line
(seconds, milliseconds, ... or ISO 8601), else the counter if it increases as microseconds do
(SyncIn time), else the GPS time of the message, else the rate of register 7 in the log, else 40 Hz,
the factory setting.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.logs import axes, columns, log
from imu_sim_ros.bags.logs.log import Contents, LogStream
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY
from imu_sim_ros.core.geodesy import tangent_plane
from imu_sim_ros.core.gps_time import GPS_EPOCH, WEEK, leap_seconds
from imu_sim_ros.core.rotation import from_euler
from imu_sim_ros.core.types import Array, Bytes, Mask, Times
from imu_sim_ros.inputs.layout import parse_nanoseconds
from imu_sim_ros.inputs.rows import number_of, open_shared

MEMORY = 8
"""Memory that reading takes, in sizes of the file."""
_ANGLES, _Q, _FIELD, _ACCEL, _GYRO = "angles", "q", "field", "accel", "gyro"
_TEMPERATURE, _PRESSURE, _SKIPPED = "temperature", "pressure", "skipped"
_PLACE, _VELOCITY, _GPS, _DELTA = "place", "velocity", "gps", "delta"
_WIDTHS: Final = {
    **dict.fromkeys((_ANGLES, _FIELD, _ACCEL, _GYRO, _PLACE, _VELOCITY, _SKIPPED), 3),
    **dict.fromkeys((_TEMPERATURE, _PRESSURE), 1),
    _Q: 4,
    _GPS: 4,
    _DELTA: 7,
}
"""Numbers of each part of a message."""
_MESSAGES: Final[Mapping[str, tuple[str, ...]]] = {
    "QMR": (_Q, _FIELD, _ACCEL, _GYRO),
    "YMR": (_ANGLES, _FIELD, _ACCEL, _GYRO),
    "MAR": (_FIELD, _ACCEL, _GYRO),
    "IMU": (_FIELD, _ACCEL, _GYRO, _TEMPERATURE, _PRESSURE),
    "MAG": (_FIELD,),
    "ACC": (_ACCEL,),
    "GYR": (_GYRO,),
    "YBA": (_ANGLES, _SKIPPED, _GYRO),
    "YIA": (_ANGLES, _SKIPPED, _GYRO),
    "DTV": (_DELTA,),
    "ISL": (_ANGLES, _PLACE, _VELOCITY, _ACCEL, _GYRO),
    "INS": (_GPS, _ANGLES, _PLACE, _VELOCITY),
    "GPS": (_GPS, _PLACE, _VELOCITY),
}
"""Parts of the messages that are read, in their order; accelerations without gravity are skipped.
"""
_GPS_HEADS: Final = {"INS": 3, "GPS": 4}
"""Numbers in front of the others: time of week [s], week, status or fix, satellites."""
_LINE: Final = re.compile(
    rb"(?P<prefix>[^\r\n$]*)\$VN(?P<name>[A-Z]{3}),(?P<cells>[^*\r\n$]*)\*"
    rb"(?P<sum>[0-9A-Fa-f]{4}|[0-9A-Fa-f]{2}|XX)"
)
_START: Final = re.compile(rb"\$VN[A-Z]{3},")
_REGISTER: Final = re.compile(rb"\$VN[RW]RG,0?7,([0-9]+)")
_COUNTER: Final = re.compile(rb",T([0-9]+)$")
_SUFFIX: Final = re.compile(rb"(,[ST][0-9A-Fa-f]+)+$")
_NUMBER: Final = re.compile(rb"\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
_FACTORY_RATE: Final = 40.0
"""Output rate of a sensor in its factory settings [Hz]."""
_GAUSS: Final = 1e-4
"""One gauss [T]."""
_KILOPASCAL: Final = 1e3
"""One kilopascal [Pa]."""
_DIGITS_OF_CLOCKS: Final = ((1e17, 0), (1e14, 3), (1e11, 6), (0.0, 9))
"""Least size of host times, and the decimal digits between their unit and a nanosecond: UTC in ns,
us, ms; seconds."""
_PREFERRED: Final = {
    IMU: tuple(f"/VN{name}" for name in ("IMU", "QMR", "YMR", "MAR", "ISL", "DTV")),
    ODOMETRY: ("/VNINS/odom", "/VNISL/odom"),
}
"""Topics that are read if the user names none."""


class _Line(NamedTuple):
    """One message of the log, its fields as numbers."""

    number: int
    """Number among the messages of its name, those of wrong checksum included."""
    host_ns: int | None
    """Time in front of the message [ns]."""
    counter: int | None
    """Counter at the end."""
    numbers: list[float]
    """Fields of the message."""


def holds(path: Path, magic: bytes) -> bool:
    """Return True for a text file with messages of VectorNav at its start."""
    return _START.search(columns.head_of(path, magic)) is not None


def contents(path: Path) -> Contents:
    """Return the topics of a log; see :class:`imu_sim_ros.bags.logs.log.LogFormat`."""
    with open_shared(path) as file:
        content = file.read()
    damage: list[str] = []
    remarks: list[str] = []
    messages, names = _messages(content, damage)
    register = _REGISTER.search(content)
    rate = float(register[1]) if register else 0.0
    streams = [
        stream
        for name, lines in messages.items()
        for stream in _streams(name, lines, rate, remarks)
    ]
    if not streams:
        raise log.refuse_empty(path, "a log of VectorNav", sorted(names))
    return Contents(streams, _PREFERRED, (), tuple(damage), tuple(remarks))


def _messages(content: bytes, damage: list[str]) -> tuple[dict[str, list[_Line]], set[str]]:
    """Return the messages that are read by name, and the names of all."""
    matches = list(_LINE.finditer(content))
    valid = _has_right_checksum(content, matches)
    messages: dict[str, list[_Line]] = {}
    counts: dict[str, int] = {}
    names: set[str] = set()
    bad = len(_START.findall(content)) - len(matches)
    for match, is_valid in zip(matches, valid.tolist(), strict=True):
        name = match["name"].decode()
        names.add(f"VN{name}")
        if name not in _MESSAGES:
            continue
        number = counts.get(name, 0)
        counts[name] = number + 1
        cells = match["cells"]
        counter = _COUNTER.search(cells)
        numbers = _numbers(_SUFFIX.sub(b"", cells), name) if is_valid else None
        if numbers is None:
            bad += 1
            continue
        host_ns = _host_time(match["prefix"])
        ticks = int(counter[1]) if counter else None
        messages.setdefault(name, []).append(_Line(number, host_ns, ticks, numbers))
    if bad > 0:
        damage.append(f"{bad} messages left out, whose checksum or fields are wrong")
    return messages, names


def _has_right_checksum(content: bytes, matches: Sequence[re.Match[bytes]]) -> Mask:
    """Return True for the messages whose checksum is right, or was not computed (XX)."""
    if not matches:
        return np.zeros(0, np.bool_)
    # From behind the dollar sign to the asterisk.
    spans = np.array([(match.start("name") - 2, match.end("cells")) for match in matches])
    letters = np.frombuffer(content, np.uint8)
    sums = np.bitwise_xor.reduceat(letters, spans.ravel())[::2]
    valid = np.empty(len(matches), np.bool_)
    for k, match in enumerate(matches):
        stated = match["sum"]
        if stated == b"XX":
            valid[k] = True
        elif len(stated) == 2:
            valid[k] = int(stated, 16) == sums[k]
        else:
            valid[k] = int(stated, 16) == _crc(letters[spans[k, 0] : spans[k, 1]])
    return valid


def _crc(letters: Bytes) -> int:
    """Return the CRC of 16 bits (polynomial 0x1021, start 0) of letters."""
    crc = 0
    for letter in letters.tolist():
        crc = ((crc >> 8) | (crc << 8)) & 0xFFFF
        crc ^= letter
        crc ^= (crc & 0xFF) >> 4
        crc ^= (crc << 12) & 0xFFFF
        crc ^= ((crc & 0xFF) << 5) & 0xFFFF
    return crc


def _numbers(cells: bytes, name: str) -> list[float] | None:
    """Return the fields of a message; None: they are too few, or no numbers."""
    parts = cells.decode("latin-1").split(",")
    if name in _GPS_HEADS:
        # The status of VNINS is hexadecimal, and no field that is read.
        parts = [*parts[:2], "0", parts[3] if name == "GPS" else "1", *parts[_GPS_HEADS[name] :]]
    count = sum(_WIDTHS[part] for part in _MESSAGES[name])
    try:
        numbers = [number_of(part.strip()) for part in parts[:count]]
    except (ValueError, IndexError):
        return None
    return numbers if len(numbers) == count and np.isfinite(numbers).all() else None


def _host_time(prefix: bytes) -> int | None:
    """Return the time that a logger put in front of a message [ns]; None: there is none."""
    if not prefix.strip():
        return None
    date_ns = columns.utc_ns(prefix)
    if date_ns is not None:
        return date_ns
    number = _NUMBER.search(prefix)
    if number is None:
        return None
    digits = next(digits for size, digits in _DIGITS_OF_CLOCKS if float(number[0]) >= size)
    try:
        return parse_nanoseconds(number[0].decode(), digits, whole=False)
    except (ValueError, OverflowError):
        return None


def _times(
    lines: Sequence[_Line], parts: Mapping[str, Array], rate: float, remarks: list[str]
) -> Times:
    """Return the times (n,) of messages [ns].

    :param rate: rate that the log states [Hz]; 0: none.
    """
    hosts = [line.host_ns for line in lines if line.host_ns is not None]
    if len(hosts) == len(lines):
        return np.array(hosts, np.int64)
    counters = np.array([line.counter for line in lines if line.counter is not None], np.int64)
    # A counter of SyncIn events increases by whole events, and may stand still.
    if len(counters) == len(lines) > 1 and np.median(np.diff(counters)) >= 100:
        wrapped = np.cumsum(np.diff(counters, prepend=counters[:1]) < -(1 << 31))
        stamps: Times = (counters + (wrapped << 32)) * 1000
        return stamps
    if _GPS in parts and (parts[_GPS][:, 1] > 0).all():
        seconds, week = parts[_GPS][:, 0], parts[_GPS][:, 1].astype(np.int64)
        start = int(GPS_EPOCH.timestamp()) + week * WEEK
        leap = leap_seconds(float(start[0] + seconds[0]))
        return (start - leap) * 10**9 + np.rint(seconds * 1e9).astype(np.int64)
    if not rate:
        rate = _FACTORY_RATE
        remarks.append(
            f"the log has no times: {rate:g} Hz are assumed, the factory setting; a line "
            "$VNRRG,07,RATE at its start states another one"
        )
    numbers = np.array([line.number for line in lines])
    return np.rint(numbers * (1e9 / rate)).astype(np.int64)


def _streams(
    name: str, lines: Sequence[_Line], rate: float, remarks: list[str]
) -> Iterator[LogStream]:
    """Yield the topics of the messages of one name, such as IMU.

    :param rate: rate that the log states [Hz]; 0: none.
    """
    values = np.array([line.numbers for line in lines])
    ends = np.cumsum([_WIDTHS[part] for part in _MESSAGES[name]])
    parts = dict(zip(_MESSAGES[name], np.split(values, ends[:-1], axis=1), strict=True))
    t_ns = _times(lines, parts, rate, remarks)
    rows = columns.valid_stamps(t_ns)
    t_ns, parts = t_ns[rows], {part: column[rows] for part, column in parts.items()}
    if not len(t_ns):
        return
    topic = f"/VN{name}"
    if _DELTA in parts:
        seconds, turn, change = np.split(parts[_DELTA], [1, 4], axis=1)
        moving = seconds[:, 0] > 0.0
        t_ns, seconds = t_ns[moving], seconds[moving]
        parts[_GYRO] = np.radians(turn[moving]) / seconds
        parts[_ACCEL] = change[moving] / seconds
    q_wi = _orientation(parts)
    triads = [axes.flu(parts[part]) if part in parts else None for part in (_GYRO, _ACCEL)]
    if any(triad is not None for triad in triads) and len(t_ns):
        yield log.imu(topic, t_ns, *triads, q_wi=q_wi)
    if _FIELD in parts:
        suffix = "" if name == "MAG" else "/magnetic_field"
        field = axes.flu(parts[_FIELD]) * _GAUSS
        yield log.magnetic_field(f"{topic}{suffix}", t_ns, field)
    if _TEMPERATURE in parts:
        yield log.temperature(f"{topic}/temperature", t_ns, parts[_TEMPERATURE][:, 0])
    if _PRESSURE in parts and parts[_PRESSURE].any():
        yield log.pressure(f"{topic}/pressure", t_ns, parts[_PRESSURE][:, 0] * _KILOPASCAL)
    if _PLACE in parts:
        yield from _motion(topic, t_ns, parts, q_wi)


def _orientation(parts: Mapping[str, Array]) -> Array | None:
    """Return the orientation (n, 4) of the sensor in ENU; None: the message has none."""
    if _ANGLES in parts:
        return axes.q_enu_flu(from_euler(np.radians(parts[_ANGLES][:, ::-1])))
    if _Q in parts:
        q_ned = parts[_Q][:, [3, 0, 1, 2]]
        valid = (np.linalg.norm(q_ned, axis=1) > 0.5).all()
        return axes.q_enu_flu(q_ned) if valid else None
    return None


def _motion(
    topic: str, t_ns: Times, parts: Mapping[str, Array], q_wb: Array | None
) -> Iterator[LogStream]:
    """Yield poses with velocities, and the positions of a receiver."""
    has_fix = (parts[_PLACE][:, :2] != 0.0).any(axis=1)
    place, t_ns = parts[_PLACE][has_fix], t_ns[has_fix]
    if not len(t_ns):
        return
    velocity = axes.enu(parts[_VELOCITY][has_fix])
    if q_wb is not None:
        local = tangent_plane(place, place[0])
        gyro = None if _GYRO not in parts else axes.flu(parts[_GYRO])[has_fix]
        yield log.odometry(f"{topic}/odom", t_ns, local, q_wb[has_fix], velocity, gyro)
        return
    zeros = np.zeros(len(t_ns))
    latitude, longitude, height = place.T
    position = (latitude, longitude, height)
    yield log.fix(topic, t_ns, position, np.ones(len(t_ns), np.bool_), (zeros, zeros))
    yield log.velocity(f"{topic}/velocity", t_ns, velocity, zeros)
