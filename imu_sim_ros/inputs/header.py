# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Header of a text table: the quantity, the axis and the unit of each column.

Supported are the headers of this package, EuRoC, kalibr, TUM, OpenVINS, OKVIS2, AirSim, PX4,
rostopic, phone loggers and spreadsheets: each name is split into quantity, axis and unit.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from imu_sim_ros.core.conventions import ABSOLUTE_ZERO, AXES, FAHRENHEIT, STANDARD_GRAVITY

GYRO: Final = "gyroscope"
ACCEL: Final = "accelerometer"
POSITION: Final = "position"
ORIENTATION: Final = "quaternion"
VELOCITY: Final = "velocity"
GYRO_BIAS: Final = "gyroscope bias"
ACCEL_BIAS: Final = "accelerometer bias"
TEMPERATURE: Final = "temperature"
STAMP: Final = "stamp"
_BARE: Final = "x, y, z"
"""Quantity of columns whose names are their axes."""

AXES_OF: Final[Mapping[str, str]] = {
    GYRO: "xyz",
    ACCEL: "xyz",
    POSITION: "xyz",
    ORIENTATION: "wxyz",
    VELOCITY: "xyz",
    GYRO_BIAS: "xyz",
    ACCEL_BIAS: "xyz",
    TEMPERATURE: "",
    _BARE: "xyz",
}
"""Axes of each quantity in the order of the records."""

_RATE_UNITS: Final = {
    **dict.fromkeys(("rad/s", "rads^-1", "rads-1", "rad/sec", "rad", "radps", "rads", "r/s"), 1.0),
    **dict.fromkeys(
        (
            "deg/s",
            "degs^-1",
            "degs-1",
            "deg/sec",
            "dps",
            "deg",
            "degs",
            "degps",
            "°/s",
            "degrees/s",
        ),
        math.pi / 180.0,
    ),
    **dict.fromkeys(("mdps", "mdeg/s"), math.pi / 180.0e3),
    **dict.fromkeys(("mrad/s",), 1e-3),
    **dict.fromkeys(("deg/h", "deg/hr"), math.pi / 180.0 / 3600.0),
}
_FORCE_UNITS: Final = {
    **dict.fromkeys(
        (
            "m/s^2",
            "m/s2",
            "m/s²",
            "ms^-2",
            "ms-2",
            "mps2",
            "mpss",
            "ms2",
            "m/sec^2",
            "m/s/s",
            "mss",
        ),
        1.0,
    ),
    **dict.fromkeys(("g", "g0", "gs"), STANDARD_GRAVITY),
    "mg": STANDARD_GRAVITY * 1e-3,
    **dict.fromkeys(("ug", "µg", "μg"), STANDARD_GRAVITY * 1e-6),
}
_LENGTH_UNITS: Final = {"m": 1.0, "meters": 1.0, "metres": 1.0, "cm": 1e-2, "mm": 1e-3}
_SPEED_UNITS: Final = {
    **dict.fromkeys(("m/s", "ms^-1", "ms-1", "mps", "m/sec"), 1.0),
    **dict.fromkeys(("km/h", "kmh"), 1.0 / 3.6),
    "cm/s": 1e-2,
}
_CELSIUS: Final = ("degc", "c", "°c", "celsius", "deg", "degree", "degrees", "°", "ºc", "℃")
_KELVIN: Final = ("k", "kelvin", "degk", "°k")
_FAHRENHEIT: Final = ("f", "degf", "°f", "fahrenheit", "℉")
_MILLIKELVIN: Final = ("mk", "millikelvin")
_TEMPERATURE_UNITS: Final = {
    **dict.fromkeys(_CELSIUS, 1.0),
    **dict.fromkeys(_KELVIN, 1.0),
    **dict.fromkeys(_FAHRENHEIT, FAHRENHEIT[0]),
    **dict.fromkeys(("mdegc", "mdeg", "m°c", "mc", "millicelsius", "millidegc"), 1e-3),
    **dict.fromkeys(("millideg", "millidegree", "millidegrees", "millidegreesc"), 1e-3),
    **dict.fromkeys(("cdegc", "cdeg", "centidegc", "centidegrees", "c°c"), 1e-2),
    **dict.fromkeys(("ddegc", "ddeg", "decidegc", "decidegrees"), 1e-1),
    **dict.fromkeys(_MILLIKELVIN, 1e-3),
}
ZEROS: Final[Mapping[str, float]] = {
    **dict.fromkeys((*_KELVIN, *_MILLIKELVIN), ABSOLUTE_ZERO),
    **dict.fromkeys(_FAHRENHEIT, FAHRENHEIT[1]),
}
"""Temperature at the zero of a unit that does not begin at 0 degC [degC]."""
UNITS: Final[Mapping[str, Mapping[str, float]]] = {
    GYRO: _RATE_UNITS,
    ACCEL: _FORCE_UNITS,
    POSITION: _LENGTH_UNITS,
    ORIENTATION: {"1": 1.0, "-": 1.0},
    VELOCITY: _SPEED_UNITS,
    GYRO_BIAS: _RATE_UNITS,
    ACCEL_BIAS: _FORCE_UNITS,
    TEMPERATURE: _TEMPERATURE_UNITS,
    _BARE: {**_LENGTH_UNITS, **_FORCE_UNITS, **_RATE_UNITS},
}
"""SI value of each unit of a quantity, in lower case and without blanks."""
TIME_UNITS: Final[Mapping[str, int]] = {
    **dict.fromkeys(("ns", "nsec", "nanoseconds", "nanosecond", "nanosec", "nsecs"), 0),
    **dict.fromkeys(("us", "µs", "μs", "usec", "microseconds", "microsecond", "usecs"), 3),
    **dict.fromkeys(("ms", "msec", "milliseconds", "millisecond", "millis", "msecs"), 6),
    **dict.fromkeys(("s", "sec", "seconds", "second", "secs"), 9),
}
"""Decimal digits between a unit of time and a nanosecond."""
TIME_NAMES: Final[Mapping[int, str]] = {0: "ns", 3: "us", 6: "ms", 9: "s"}

_WORDS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("gyro", "gyr", "gyroscope", "omega", "angular", "angvel", "imugyro"), GYRO),
    **dict.fromkeys(("gyroskop", "drehrate", "winkelgeschwindigkeit"), GYRO),
    **dict.fromkeys(("angulaire", "giroscopio", "角速度", "陀螺仪", "角速率"), GYRO),
    **dict.fromkeys(
        ("accel", "acc", "accelerometer", "acceleration", "alpha", "specific", "linacc"), ACCEL
    ),
    **dict.fromkeys(("beschleunigung", "accélération", "aceleración", "accelerazione"), ACCEL),
    **dict.fromkeys(("acelerometro", "acelerómetro", "加速度", "加速度计"), ACCEL),
    **dict.fromkeys(("position", "pos", "translation", "posición", "位置"), POSITION),
    **dict.fromkeys(("quaternion", "quat", "orientation", "四元数"), ORIENTATION),
    **dict.fromkeys(("velocity", "vel", "speed", "geschwindigkeit", "vitesse"), VELOCITY),
    **dict.fromkeys(("temperature", "temp", "temperatur", "température", "温度"), TEMPERATURE),
    "tmp": TEMPERATURE,
    "bg": GYRO_BIAS,
    "ba": ACCEL_BIAS,
}
_LETTERS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("w", "g", "r"), GYRO),
    **dict.fromkeys(("a", "f"), ACCEL),
    **dict.fromkeys(("p", "t"), POSITION),
    "q": ORIENTATION,
    "v": VELOCITY,
}
"""Quantity of a single letter in front of an axis."""
_TIMES: Final = (
    *("timestamp", "time", "stamp", "t", "elapsed", "epoch", "ts", "nanosec", "sec"),
    *("zeit", "zeitstempel", "temps", "tiempo", "tempo", "时间", "时间戳"),
)
_TURNS: Final[Mapping[str, str]] = {"roll": "x", "pitch": "y", "yaw": "z"}
"""Axis of the rate of an Euler angle, which programs of flight control name for the gyroscope."""
_RATES: Final = frozenset(("rate", "rates", "vel", "velocity", "speed"))
_RATES_OF_FLIGHT: Final[Mapping[str, str]] = {"p": "gyro_x", "q": "gyro_y", "r": "gyro_z"}
"""Rates about x, y and z by the letters of flight mechanics, which mean them together alone."""
_OTHER: Final = frozenset(
    (
        *("covariance", "cov", "std", "stddev", "var", "variance", "sigma", "gravity", "user"),
        *("integral", "relative", "clipping", "mag", "magnetic", "magnetometer", "euler", "delta"),
        *("gps", "baro", "pressure", "reference", "earth", "calibration", "error", "index", "seq"),
        *("column", "frame", "id", "counter", "packet", "status", "label"),
        *("ambient", "chamber", "room", "cpu", "battery", "motor", "esc"),
    )
)
"""Words of columns that are none of the quantities."""
_GLUED: Final = re.compile(
    rf"({'|'.join(sorted(_WORDS, key=len, reverse=True))}|[wgrafptqv])([xyzw])"
)
"""Quantity and axis in a word: ``gyrox``, ``bgx``, ``ax``."""
_GLUED_TEMPERATURE: Final = re.compile(
    r"(?:imu|gyroscope|gyro|gyr|accel|acc|die|chip|sensor|core)?(?:temperature|temp)"
    r"(c|k|f|degc|degk|degf|celsius|kelvin)?\d*"
)
"""Name of a column of temperatures without separators: ``imutemp``, ``tempC``, ``temp0``."""
_BRACKETS: Final = re.compile(r"\[([^\]]*)\]|\(([^)]*)\)")
KNOWN: Final[Mapping[str, str]] = {
    POSITION: "p_x, tx, pos_x, for all axes",
    ORIENTATION: "q_w, qw, orientation.w, for w, x, y, z",
}
"""Names of the columns of a pose, for messages."""
_KNOWN: Final = (
    "timestamp [ns], gyro_x [rad/s], accel_x [m/s^2] (or omega_x, alpha_x, w_RS_S_x, a_RS_S_x, gx, "
    "ax); p_x [m], q_w (or tx, qw), v_x [m/s], for all axes, with units in brackets"
)


@dataclass(frozen=True)
class ColumnName:
    """Meaning of the name of a column."""

    quantity: str
    """One of the quantities, or :data:`STAMP`."""
    axis: str
    """Letter of the axis; empty: a single number."""
    unit: str
    """Unit in lower case; empty: not stated."""


@dataclass(frozen=True)
class TableHeader:
    """Columns of a table by quantity."""

    count: int
    """Number of columns."""
    stamp: int
    """Index of the column of the stamps."""
    nanosecond: int | None
    """Index of the column of nanoseconds next to the seconds of the stamp; None: there is none."""
    digits: int | None
    """Decimal digits between the unit of the stamp and a nanosecond; None: not stated."""
    columns: Mapping[str, tuple[int, ...]]
    """Indices of the columns of each quantity in the order of :data:`AXES_OF`."""
    factors: Mapping[str, float]
    """SI value of the unit of each quantity."""
    units: Mapping[str, str]
    """Stated units of the quantities."""
    notes: tuple[str, ...] = ()
    """Lines about columns that are not read, or are read in place of others."""


def split_names(line: str) -> list[str]:
    """Return the names in a header line, without comment sign and without blanks in brackets."""
    line = line.lstrip("\ufeff").strip().lstrip("#%").strip().strip('"')
    line = _BRACKETS.sub(lambda match: re.sub(r"\s|[*·]", "", match[0]), line)
    for separator in (",", ";", "\t"):
        if separator in line:
            names = [name.strip().strip('"').strip() for name in line.split(separator)]
            return names[:-1] if not names[-1] else names
    return re.sub(r"\s+(?=[\[(])", "", line).split()


def column_of(name: str) -> ColumnName | None:
    """Return the meaning of a column's name; None: none of the quantities."""
    unit, axis = "", ""
    for square, round_ in _BRACKETS.findall(name):
        content = (square or round_).strip().lower()
        if content.isdigit():
            axis = "xyz"[int(content)] if int(content) < 3 else "w"
        elif content:
            unit = content
    plain = re.sub(r"([a-z])([A-Z])", r"\1_\2", _BRACKETS.sub(" ", name))
    tokens = [word for word in re.split(r"(?:[^\w°/^]|_)+", plain.lower()) if word]
    if tokens[:1] == ["field"]:  # rostopic echo -p
        tokens = tokens[1:]
    if not tokens or any(word in _OTHER for word in tokens):
        return None
    temperature_unit = _unit_of_temperature(_BRACKETS.sub(" ", name).strip(), tokens, unit)
    if temperature_unit is not None:
        return ColumnName(TEMPERATURE, "", temperature_unit)
    if not axis and _is_time(tokens):
        unit = unit or next((word for word in tokens if word in TIME_UNITS), "")
        return ColumnName(
            STAMP, "", unit or tokens[0].removeprefix("t") * (tokens[0] in ("tns", "tus"))
        )
    tokens = _with_axis_of_turn(tokens)
    tokens, suffix = _strip_unit(tokens)
    unit = unit or suffix
    if not axis:
        tokens, axis = _strip_axis(tokens)
    quantity = _quantity(tokens)
    if quantity in (None, TEMPERATURE) or not axis:
        return None
    return ColumnName(str(quantity), axis, unit)


def _unit_of_temperature(name: str, tokens: Sequence[str], unit: str) -> str | None:
    """Return the unit of a column of temperatures, empty: not stated; None: another column.

    An upper-case T is a temperature if its unit, or the name of a sensor, says so.

    :param name: name of the column without what is in brackets.
    :param tokens: words of the name in lower case.
    :param unit: unit in brackets; empty: there is none.
    """
    if {*AXES, *_TIMES[:3]} & set(tokens) or {*_TIMES, *TIME_UNITS} & set(tokens[1:]):
        return None
    glued = next(filter(None, map(_GLUED_TEMPERATURE.fullmatch, tokens)), None)
    is_letter = re.match(r"T(?![a-zA-Z])", name) is not None
    if (
        glued is None
        and not is_letter
        and not any(_WORDS.get(word) == TEMPERATURE for word in tokens)
    ):
        return None
    endings = ("".join(tokens[k:]) for k in range(1, len(tokens)))
    suffix = next((ending for ending in endings if ending in _TEMPERATURE_UNITS), "")
    stated = unit or suffix or (glued[1] if glued is not None and glued[1] else "")
    if glued is None and is_letter and stated not in _TEMPERATURE_UNITS:
        sensors = {"imu", "gyro", "acc", "accel", "sensor", "die", "chip"}
        return None if unit in TIME_UNITS or not sensors & set(tokens) else stated
    return stated


def _is_time(tokens: Sequence[str]) -> bool:
    """Return True for the words of a column of times."""
    meaning = [word for word in tokens if word in _TIMES or word in TIME_UNITS]
    physical = any(word in _WORDS for word in tokens)
    return bool(meaning) and not physical and (len(tokens) < 4 and tokens[-1] not in "xyzw")


def _with_axis_of_turn(tokens: list[str]) -> list[str]:
    """Return ``roll rate`` and ``rollspeed`` as ``gyro x``; other words unchanged."""
    for turn, axis in _TURNS.items():
        glued = any(turn + rate in tokens for rate in _RATES)
        if glued or (turn in tokens and _RATES & set(tokens)):
            rest = [word for word in tokens if word not in _RATES and not word.startswith(turn)]
            return ["gyro", *rest, axis]
    return tokens


def _strip_unit(tokens: list[str]) -> tuple[list[str], str]:
    """Return words of a name without those of its unit, and the unit: ``gyro x deg s``."""
    for parts, unit in (
        (("m", "s", "2"), "m/s^2"),
        (("m", "s2"), "m/s^2"),
        (("rad", "s"), "rad/s"),
        (("deg", "s"), "deg/s"),
        (("m", "s"), "m/s"),
        *(((word,), word) for word in ("rad", "deg", "dps", "mdps", "radps", "mps2", "mss", "mg")),
        (("g",), "g"),
        (("m",), "m"),
    ):
        for k in range(1, len(tokens) - len(parts) + 1):
            if tuple(tokens[k : k + len(parts)]) == parts:
                rest = tokens[:k] + tokens[k + len(parts) :]
                if rest[0] not in ("b",):  # b_g of OKVIS2 is a bias
                    return rest, unit
    return tokens, ""


def _strip_axis(tokens: list[str]) -> tuple[list[str], str]:
    """Return the words of a name without its axis, and the axis: ``omega z``, ``gz``, ``q w``."""
    for k in (*range(len(tokens) - 1, 0, -1), 0):
        if tokens[k] in AXES or (tokens[k] == "w" and k > 0 and k == len(tokens) - 1):
            return tokens[:k] + tokens[k + 1 :], tokens[k]
    match = _GLUED.fullmatch(tokens[-1])
    if match is not None:
        return [*tokens[:-1], match[1]], match[2]
    return tokens, ""


def _quantity(tokens: Sequence[str]) -> str | None:
    """Return the quantity that the words of a column's name mean; None: none is known."""
    if not tokens:
        return _BARE
    first_token, meanings = tokens[0], {_WORDS[word] for word in tokens if word in _WORDS}
    if "bias" in tokens or first_token == "b":
        kinds = meanings | {_LETTERS[word] for word in tokens if word in _LETTERS}
        return GYRO_BIAS if GYRO in kinds else ACCEL_BIAS if ACCEL in kinds else None
    turns = {"rotation", "angular", "ang"} & set(tokens)
    if turns and {"rate", "vel", "velocity"} & set(tokens):
        return GYRO
    if GYRO in meanings:  # angular velocity
        return GYRO
    if meanings:
        return next(kind for kind in UNITS if kind in meanings)
    return _LETTERS.get(first_token)


def is_unit(text: str) -> bool:
    """Return True for the name of a unit of time or of a quantity."""
    unit = re.sub(r"[\s*·]", "", text).lower()
    return unit in TIME_UNITS or any(unit in units for units in UNITS.values())


def is_unknown(name: str) -> bool:
    """Return True for a name that says nothing: no quantity, and nothing that is left out."""
    tokens = re.split(r"(?:\W|_)+", name.lower())
    return column_of(name) is None and not _OTHER & set(tokens)


def is_complete(names: Sequence[str]) -> bool:
    """Return True for a header with a stamp and a quantity with all of its axes."""
    try:
        return bool(header_of(names).columns)
    except ValueError:
        return False


def header_of(names: Sequence[str], place: str = "") -> TableHeader:
    """Return the columns of a header.

    :param names: names of the columns, as :func:`split_names` returns them.
    :param place: name of the file, which decides the quantity of ``x, y, z`` without a name.
    :raises ValueError: with a line for a header that is unknown or contradicts itself.
    """
    is_flight_log = {name.lower() for name in names} >= set(_RATES_OF_FLIGHT)
    columns, notes = _keep_one_temperature(
        names,
        [
            column_of(_RATES_OF_FLIGHT.get(name.lower(), name) if is_flight_log else name)
            for name in names
        ],
    )
    columns = _resolve_bare_axes(columns, place)
    problems = list(_problems(names, columns))
    if problems:
        raise ValueError("; ".join(problems))
    places, units = _columns_by_quantity(columns)
    stamp, nanosecond = _stamp_columns(names, columns)
    return TableHeader(
        len(names),
        stamp,
        nanosecond,
        _stamp_digits(names, columns[stamp]),
        {
            quantity: tuple(axes[axis] for axis in AXES_OF[quantity] or ("",))
            for quantity, axes in places.items()
        },
        {quantity: UNITS[quantity][unit] if unit else 1.0 for quantity, unit in units.items()},
        {quantity: unit for quantity, unit in units.items() if unit},
        notes,
    )


def _columns_by_quantity(
    columns: Sequence[ColumnName | None],
) -> tuple[dict[str, dict[str, int]], dict[str, str]]:
    """Return the number of each axis' column, and the unit, of each quantity except stamps.

    All columns of a quantity have the same unit.
    """
    places: dict[str, dict[str, int]] = {}
    units: dict[str, str] = {}
    for k, column in enumerate(columns):
        if column is None or column.quantity == STAMP:
            continue
        places.setdefault(column.quantity, {})[column.axis] = k
        units.setdefault(column.quantity, column.unit)
    return places, units


def _stamp_columns(
    names: Sequence[str], columns: Sequence[ColumnName | None]
) -> tuple[int, int | None]:
    """Return the column of the stamp, and that of its nanoseconds; None: it is one column.

    Of several stamps, that with ``stamp`` in its name is read, else the first.
    """
    stamps = [k for k, column in enumerate(columns) if _is_stamp(column)]
    stamp = next((k for k in stamps if "stamp" in names[k].lower()), stamps[0])
    return _pair(names, columns, stamps, stamp)


def _stamp_digits(names: Sequence[str], stamp: ColumnName | None) -> int | None:
    """Return the decimal digits between a stamp's unit and a nanosecond; None: no unit is named."""
    if stamp is not None and stamp.unit:
        return TIME_UNITS[stamp.unit]
    if any("accelerometer_m_s2" in name or "gyro_rad" in name for name in names):
        return TIME_UNITS["us"]  # PX4's uORB topics
    return None


def _is_stamp(column: ColumnName | None) -> bool:
    return column is not None and column.quantity == STAMP


def _keep_one_temperature(
    names: Sequence[str], columns: Sequence[ColumnName | None]
) -> tuple[list[ColumnName | None], tuple[str, ...]]:
    """Return columns with at most one of temperatures, and lines about those that are not read.

    A column ``T`` is one if the stamps have another column. Of several, that of the IMU is read,
    else the first; one in an unknown unit is not read, since readings do not depend on it.
    """
    chosen = list(columns)
    stamps = [name for name, column in zip(names, columns, strict=True) if _is_stamp(column)]
    if set(stamps) - {"T"}:
        for k, name in enumerate(names):
            if name == "T":
                chosen[k] = ColumnName(TEMPERATURE, "", "")
    notes = []
    places = [k for k, column in enumerate(chosen) if column and column.quantity == TEMPERATURE]
    for k in list(places):
        column = chosen[k]
        if column is not None and column.unit and column.unit not in _TEMPERATURE_UNITS:
            usual = "degC, K, degF, mdegC"
            notes.append(f"{names[k]} is not read: the unit {column.unit} is not one of {usual}")
            chosen[k] = None
            places.remove(k)
    if len(places) > 1:
        best = next((k for k in places if "imu" in names[k].lower()), places[0])
        unread = [k for k in places if k != best]
        for k in unread:
            chosen[k] = None
        text = ", ".join(names[k] for k in unread)
        notes.append(f"the temperature is that of {names[best]}; {text} is not read")
    return chosen, tuple(notes)


def _pair(
    names: Sequence[str],
    columns: Sequence[ColumnName | None],
    stamps: Sequence[int],
    stamp: int,
) -> tuple[int, int | None]:
    """Return the columns of seconds and of nanoseconds that are one stamp: ``sec, nsec``.

    :param stamps: columns of stamps.
    :param stamp: column of stamps that is read.
    :returns: the stamp and None if it is in one column.
    """

    def digits(k: int) -> int | None:
        column = columns[k]
        return None if column is None else TIME_UNITS.get(column.unit)

    def name_without_unit(k: int) -> list[str]:
        tokens = re.split(r"[^0-9a-zµ]+", _BRACKETS.sub(" ", names[k]).lower())
        return [token for token in tokens if token and token not in TIME_UNITS]

    alike = [k for k in stamps if name_without_unit(k) == name_without_unit(stamp)]
    seconds = [k for k in alike if digits(k) == TIME_UNITS["s"]]
    nanoseconds = [k for k in alike if digits(k) == TIME_UNITS["ns"]]
    if len(seconds) == len(nanoseconds) == 1 and stamp in (*seconds, *nanoseconds):
        return seconds[0], nanoseconds[0]
    return stamp, None


_STATE_OF_OPENVINS: Final = ("q", "p", "v", "bg", "ba")
"""Names of the columns of an OpenVINS state, each for all of its axes; others follow."""


def expand_names(names: Sequence[str], count: int) -> list[str]:
    """Return the names of a header, one for each column of a row.

    OpenVINS' state files name ``q p v bg ba`` once for all axes, the quaternion in the order
    x, y, z, w, and what follows them likewise.

    :param count: number of columns of a row.
    """
    if tuple(names[1:6]) != _STATE_OF_OPENVINS:
        return list(names)
    axes = (("q", "xyzw"), *((name, "xyz") for name in _STATE_OF_OPENVINS[1:]))
    columns = [names[0], *(f"{name}_{axis}" for name, letters in axes for axis in letters)]
    return columns + [f"column {k}" for k in range(len(columns), count)]


def is_known(names: Sequence[str]) -> bool:
    """Return True if a name of a line is that of a quantity, so that the line is a header."""
    columns = [column_of(name) for name in names]
    return any(column is not None and column.quantity != _BARE for column in columns)


def _resolve_bare_axes(columns: Sequence[ColumnName | None], place: str) -> list[ColumnName | None]:
    """Return columns in which ``x, y, z`` without a name have their quantity, if it is known."""
    quantity = _quantity_of_bare_axes(columns, place)
    return [
        replace(column, quantity=quantity)
        if quantity is not None and column is not None and column.quantity == _BARE
        else column
        for column in columns
    ]


def _quantity_of_bare_axes(columns: Sequence[ColumnName | None], place: str) -> str | None:
    """Return the quantity of columns x, y, z; None: unknown."""
    kinds = {column.quantity for column in columns if column is not None}
    if ORIENTATION in kinds:
        return POSITION
    name = place.lower()
    for kind, keywords in ((GYRO, ("gyro", "angular")), (ACCEL, ("accel", "acc"))):
        if any(word in name for word in keywords):
            return kind
    return None


def _problems(names: Sequence[str], columns: Sequence[ColumnName | None]) -> Iterator[str]:
    """Yield the unknown and contradictory parts of a header."""
    kinds = [column for column in columns if column is not None]
    if not any(column.quantity == STAMP for column in kinds):
        yield f"the header {_names_text(names)} has no stamp; known are {_KNOWN}"
        return
    names_by_axis: dict[tuple[str, str], str] = {}
    for name, column in zip(names, columns, strict=True):
        if column is None:
            continue
        if column.quantity == STAMP:
            if column.unit and column.unit not in TIME_UNITS:
                yield f"{name}: the unit {column.unit} is not one of ns, us, ms, s"
            continue
        key = (column.quantity, column.axis)
        if key in names_by_axis:
            line = f"{names_by_axis[key]} and {name} are both {column.quantity} {column.axis}"
            yield line.rstrip()
        names_by_axis[key] = name
        allowed = UNITS[column.quantity]
        if column.unit and column.unit not in allowed:
            usual = ("rad/s", "deg/s", "m/s^2", "g", "mg", "m", "m/s", "degc")
            fitting = ", ".join(unit for unit in usual if unit in allowed)
            yield f"{name}: the unit {column.unit} is not one of {fitting or 'none'}"
    quantities = {column.quantity for column in kinds} - {STAMP}
    if _BARE in quantities:
        yield (
            f"the header {_names_text(names)} does not say whose x, y, z they are; name them "
            "gyro_x, accel_x, or the file gyroscope or accelerometer"
        )
    if not quantities - {TEMPERATURE}:
        yield f"the header {_names_text(names)} has no known quantity; known are {_KNOWN}"
    for quantity in quantities:
        axes = [axis for axis in AXES_OF[quantity] if (quantity, axis) not in names_by_axis]
        if axes and len(AXES_OF[quantity]):
            yield f"the header {_names_text(names)} has no {quantity} {', '.join(axes)}"
        units = {column.unit for column in kinds if column.quantity == quantity}
        if len(units) > 1:
            unit_names = " and ".join(sorted(unit or "none" for unit in units))
            yield f"the columns of the {quantity} have different units: {unit_names}"


def _names_text(names: Sequence[str]) -> str:
    """Return the names of a header as text, shortened."""
    line = ",".join(names)
    return repr(line if len(line) <= 100 else line[:97] + "...")
