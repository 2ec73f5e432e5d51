# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layout of a text table: separator, columns and units, and its rows as numbers.

A header decides the columns. Without one the columns are those of a form that the reader names,
and the unit of the stamps follows from their size and their steps.
"""

import re
import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.bad_rows import COLUMNS, NUMBERS, BadRows
from imu_sim_ros.core.errors import InputError, Remark, warn
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.core.types import Array, Bytes, Integers, Mask, Times
from imu_sim_ros.inputs.header import (
    ACCEL,
    AXES_OF,
    GYRO,
    ORIENTATION,
    TEMPERATURE,
    TIME_NAMES,
    ZEROS,
    TableHeader,
    expand_names,
    header_of,
    is_complete,
    is_known,
    is_unit,
    is_unknown,
    split_names,
)
from imu_sim_ros.inputs.rows import Row, number_of, shorten_word

STAMP_BYTES: Final = 48
"""Length of the longest stamp of text."""
_LAST_SECOND: Final = 9_223_372_035  # int64 nanoseconds hold no more
_LAST_STAMP: Final = _LAST_SECOND * NANOSECONDS_PER_SECOND
_ZERO, _POINT, _NINE = ord("0"), ord("."), ord("9")
_MOST_DIGITS: Final = 19  # of int64
_SAMPLE: Final = 200
"""Number of the first rows whose stamps decide their unit."""
_LEAST_ROWS: Final = 10
"""Smallest number of stamps that determines their unit."""
_LONGEST_NUMBER: Final = 8
"""Most digits of the number of a row; Unix times have more."""
_EARLIEST_UNIX: Final = 8e8
_LATEST_UNIX: Final = 4.2e9
"""Unix times of the years 1995 and 2103 [s]."""
_SHORTEST_STEP: Final = 10_000
"""Smallest step of stamps that may be in nanoseconds [ns]: no IMU has more than 100 kHz."""
_LEAST_MICROSECONDS: Final = 100
"""Smallest step of stamps in microseconds [us]; smaller ones may be milliseconds or row numbers."""
_SLOWEST: Final = 200_000
"""Step from which stamps are nanoseconds, even if they could be UTC in microseconds [ns]."""
_SECONDS: Final = 9
"""Decimal digits between a second and a nanosecond."""
_DATE: Final = re.compile(r"\d{4}[-/]\d\d?[-/]\d\d?|\d\d?[./]\d\d?[./]\d{4}|\d\d?:\d\d:")
"""Beginning of a date or a time of day."""
_SHOWN_NAMES: Final = 8
"""Largest number of columns that a message names."""
_NO_NUMBER: Final = frozenset(("", "nan", "na", "n/a", "null", "none", "-", "--"))
"""Cells of a column that may lack numbers."""
_DIGITS_OF_PART: Final = 9
"""Most digits of nanoseconds below a second."""


class TableForm(NamedTuple):
    """Columns of a table without a header, after the stamp."""

    columns: Mapping[str, tuple[int, ...]]
    """Columns of each quantity in the order of the records."""
    counts: tuple[int, ...]
    """Numbers of columns that a row may have."""
    digits: int
    """Decimal digits between the usual unit of the stamps and a nanosecond."""
    expected: str
    """Expected columns, for messages."""


class RowFormat(NamedTuple):
    """Characters between and in the cells of a row."""

    separator: str
    """Comma or semicolon; a blank: any blanks and tabs."""
    decimal_comma: bool
    """True if numbers have a comma, as in spreadsheets of some languages."""
    trailing: bool
    """True if rows end with a separator."""

    def plain(self, text: bytes) -> bytes:
        """Return a row without quotes, trailing separator and decimal commas."""
        if b'"' in text:
            text = (_unquote_row(text) if self.separator == ";" else None) or text
            text = text.replace(b'"', b"")
        if self.trailing:
            text = text.rstrip().removesuffix(self.separator.encode())
        return text.replace(b",", b".") if self.decimal_comma else text

    def cells(self, text: bytes) -> list[bytes]:
        """Return the cells of a row."""
        text = self.plain(text)
        return text.split() if self.separator == " " else text.split(self.separator.encode())


def _unquote_row(text: bytes) -> bytes | None:
    """Return the cells of a row ``"1","2"`` joined by semicolons; None: not all are in quotes."""
    text = text.strip().removesuffix(b",")
    inner = text[1:-1].split(b'","')
    if text[:1] + text[-1:] != b'""' or any(b'"' in cell for cell in inner):
        return None
    return b";".join(inner)


@dataclass(frozen=True)
class TableLayout:
    """Row format, columns and units of a text table."""

    row_format: RowFormat
    """Separator and decimal sign."""
    counts: tuple[int, ...]
    """Numbers of columns that a row may have."""
    stamp: int
    """Column of the stamps."""
    digits: int
    """Decimal digits between the unit of the stamps and a nanosecond."""
    whole: bool
    """True if stamps must be whole nanoseconds; digits are 0."""
    columns: Mapping[str, tuple[int, ...]]
    """Columns of each quantity in the order of the records."""
    factors: Mapping[str, float]
    """SI value of the unit of each quantity; 1 where it is missing."""
    expected: str
    """Expected columns, for messages."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Units that the header states, by quantity."""
    nanosecond: int | None = None
    """Column of nanoseconds, from 0 to 999,999,999, that are added to stamps in seconds."""
    remarks: tuple[str, ...] = ()
    """Lines about columns that are not read, or are read in place of others."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Lines about columns in another order, and about units that are converted to SI units."""
        units = [
            f"the {name} in {unit}"
            for name, unit in self.units.items()
            if self.factors[name] != 1.0 or unit in ZEROS
        ]
        target = "SI units" if set(self.units) != {TEMPERATURE} else "degC"
        line = f"{' and '.join(units)}, as the header says: converted to {target}"
        return (*self._order_notes(), *((line,) if units else ()), *self.remarks)

    def _order_notes(self) -> Iterator[str]:
        """Yield a line for each quantity whose columns the header orders unusually."""
        columns = self.columns
        if GYRO in columns and ACCEL in columns and columns[ACCEL][0] < columns[GYRO][0]:
            yield "the accelerometer before the gyroscope, as the header says"
        for name, axes in AXES_OF.items():
            order = np.argsort(columns.get(name, ()))
            is_usual = name == ORIENTATION and self.row_format.separator == " "  # TUM's
            if np.any(np.diff(order) < 0) and not is_usual:
                names = ", ".join(axes[k] for k in order)
                yield f"the {name} as {names}, as the header says"

    def quantities(self, names: Collection[str]) -> dict[str, tuple[int, ...]]:
        """Return the columns of those quantities that the table has."""
        return {name: self.columns[name] for name in names if name in self.columns}

    def parse(self, rows: Sequence[Row], names: Collection[str]) -> tuple[Times, dict[str, Array]]:
        """Return stamps (n,) [ns] and the values (n, m) of quantities in SI units, or in degC.

        A temperature is NaN where its cell has no number: it may have a lower rate than the rest.

        :param names: quantities; those that the table lacks are not returned.
        :raises ValueError, OverflowError: if a row cannot be converted.
        """
        chosen = self.quantities(names)
        (degrees,) = chosen.pop(TEMPERATURE, (None,))
        table = self._table(rows, [k for columns in chosen.values() for k in columns], degrees)
        t_ns = table["stamp"]
        if self.nanosecond is not None:
            fraction_ns = nanoseconds(
                np.char.strip(table["nanosecond"]).astype(f"S{STAMP_BYTES}"), 0
            )
            if np.any((fraction_ns < 0) | (fraction_ns >= NANOSECONDS_PER_SECOND)):
                raise OverflowError("nanoseconds of more than a second")
            seconds = nanoseconds(np.char.strip(t_ns).astype(f"S{STAMP_BYTES}"), self.digits)
            t_ns = seconds + fraction_ns
        elif self.whole:
            if np.any((t_ns > _LAST_STAMP) | (t_ns < -_LAST_STAMP)):
                raise OverflowError(f"a stamp above {_LAST_SECOND} s")
            t_ns = np.ascontiguousarray(t_ns)
        else:
            t_ns = nanoseconds(np.char.strip(t_ns).astype(f"S{STAMP_BYTES}"), self.digits)
        values: dict[str, Array] = {}
        offset = 0
        for name, columns in chosen.items():
            part = table["values"][:, offset : offset + len(columns)]
            factor = self.factors.get(name, 1.0)
            values[name] = part * factor if factor != 1.0 else np.ascontiguousarray(part)
            offset += len(columns)
        if degrees is not None:
            zero = ZEROS.get(self.units.get(TEMPERATURE, ""), 0.0)
            factor = self.factors.get(TEMPERATURE, 1.0)
            values[TEMPERATURE] = _numbers_or_nan(table["degrees"]) * factor + zero
        return t_ns, values

    def _table(
        self, rows: Sequence[Row], indices: Sequence[int], degrees: int | None = None
    ) -> NDArray[np.void]:
        """Return stamps, integers [ns] if they are whole and else text, and columns as numbers.

        :param indices: columns of the numbers.
        :param degrees: column of a temperature, which may be empty, as text; None: there is none.
        :raises ValueError: if a row has another number of columns, or cannot be converted.
        """
        separator, decimal_comma, trailing = self.row_format
        delimiter = None if separator == " " else separator
        lines = [text.decode("latin-1") for _, text in rows]
        edited = trailing or decimal_comma or any('"' in line for line in lines)
        if edited:
            lines = [self.row_format.plain(text).decode("latin-1") for _, text in rows]
        stamps = [self.stamp] if self.nanosecond is None else [self.stamp, self.nanosecond]
        columns = [*stamps, *indices, *([] if degrees is None else [degrees])]
        # NumPy compares the widths of rows only if all columns are read, and skips empty lines,
        # which an edited row may be.
        complete = columns == list(range(len(columns))) and self.counts == (len(columns),)
        if edited or not complete:
            widths = {len(line.split(delimiter)) for line in lines}
            if not widths <= set(self.counts):
                raise ValueError("columns")
        stamp = "<i8" if self.whole else f"S{STAMP_BYTES}"
        stamp_fields = [(name, stamp) for name in ("stamp", "nanosecond")[: len(stamps)]]
        text_fields = [] if degrees is None else [("degrees", f"S{STAMP_BYTES}")]
        with warnings.catch_warnings():
            # NumPy reads 1.5 as the integer 1 with this warning.
            warnings.simplefilter("error", DeprecationWarning)
            try:
                table: NDArray[np.void] = np.loadtxt(
                    lines,
                    dtype=np.dtype(
                        [*stamp_fields, ("values", "<f8", (len(indices),)), *text_fields]
                    ),
                    delimiter=delimiter,
                    usecols=None if complete else columns,
                    comments=None,
                    ndmin=1,
                )
            except DeprecationWarning as warning:
                raise ValueError("a stamp is not a whole number") from warning
        return table

    def note(self, bad: BadRows, number: int, text: bytes, names: Collection[str]) -> None:
        """Note why a row cannot be converted; nothing if it can."""
        fields = [field.strip().decode("utf-8", "replace") for field in self.row_format.cells(text)]
        if len(fields) not in self.counts:
            bad.note(COLUMNS, number, f"{len(fields)} columns; {self.expected}")
            return
        stamp = fields[self.stamp]
        try:
            parse_nanoseconds(stamp, self.digits, self.whole)
        except (ValueError, OverflowError):
            unit = "whole nanoseconds" if self.whole else _LONG_NAMES[self.digits]
            bad.note(NUMBERS, number, f"{shorten_word(stamp)} is not a stamp in {unit}")
        if self.nanosecond is not None:
            part = fields[self.nanosecond]
            try:
                good = 0 <= parse_nanoseconds(part, 0, whole=False) < NANOSECONDS_PER_SECOND
            except (ValueError, OverflowError):
                good = False
            if not good:
                problem = f"{shorten_word(part)} is not nanoseconds from 0 to 999999999"
                bad.note(NUMBERS, number, problem)
        for name, columns in self.quantities(names).items():
            convert = _number_or_nan if name == TEMPERATURE else number_of
            for k in columns:
                try:
                    convert(fields[k])
                except ValueError:
                    bad.note(NUMBERS, number, f"{shorten_word(fields[k])} is not a number")


def _numbers_or_nan(texts: NDArray[np.bytes_]) -> Array:
    """Return the numbers in cells (n,); NaN where a cell is empty, or says that it has none.

    :raises ValueError: for other text.
    """
    try:
        numbers = texts.astype(np.float64)
    except ValueError:
        numbers = np.array([_number_or_nan(text.decode("latin-1")) for text in texts])
    return np.where(np.isfinite(numbers), numbers, np.nan)


def _number_or_nan(text: str) -> float:
    """Return the number in a cell; NaN if it is empty, or says that it has none."""
    return np.nan if text.strip().lower() in _NO_NUMBER else number_of(text.strip())


_LONG_NAMES: Final = {0: "nanoseconds", 3: "microseconds", 6: "milliseconds", 9: "seconds"}


def layout_of(
    path: Path,
    comments: Sequence[bytes],
    rows: list[Row],
    forms: Mapping[str, TableForm],
    required: Sequence[str],
) -> TableLayout:
    """Return the layout of a table, and remove its header from the rows.

    Assumptions are reported: units of the header, and units of stamps that follow from their size.

    :param comments: comment lines in front of the first row.
    :param rows: first rows of the table; a header is removed.
    :param forms: form of a table without a header, by separator; a blank: any blanks.
    :param required: quantities of which the header must have at least one; none: the form decides,
        whatever the header says.
    :raises InputError: for a header that is unknown or contradicts itself or its rows, and stamps
        whose unit cannot be told.
    """
    names: list[str] | None
    if rows and (_is_header(rows) or (not required and not _is_numeric(rows[0][1]))):
        names = split_names(_text_of(rows.pop(0)[1]))
        names = _join_units_below(names, rows)
    else:
        names = _names_in_comments(path, comments, rows, forms)
    sample = rows[:_SAMPLE]
    if names is not None and sample and required:
        return _header_layout(path, names, sample, required, forms)
    return _form_layout(path, sample, forms)


def _text_of(line: bytes) -> str:
    """Return a line of names: UTF-8, or Latin-1 as spreadsheets write it."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def _is_header(rows: Sequence[Row]) -> bool:
    """Return True if the first row has names of columns, not numbers."""
    if _is_numeric(rows[0][1]):
        return False
    names = split_names(_text_of(rows[0][1]))
    second_row = rows[1][1] if len(rows) > 1 else b""
    return is_known(names) or (_is_numeric(second_row) and len(names) == len(_cells(second_row)))


def _join_units_below(names: list[str], rows: list[Row]) -> list[str]:
    """Return names with the units in the row below them, which is removed; else the names."""
    if not rows or _is_numeric(rows[0][1]):
        return names
    units = [_text_of(cell).strip(" []()") for cell in _cells(rows[0][1])]
    if len(units) != len(names) or not all(unit == "" or is_unit(unit) for unit in units):
        return names
    rows.pop(0)
    return [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]


def _names_in_comments(
    path: Path, comments: Sequence[bytes], rows: Sequence[Row], forms: Mapping[str, TableForm]
) -> list[str] | None:
    """Return the names of the columns in the last comment line that has them; else None."""
    count = len(_cells(rows[0][1])) if rows else None
    form = _form(forms, _row_format(rows))
    for comment in reversed(comments):
        names = split_names(_text_of(comment))
        if count is None:
            if is_known(names):
                return names
            continue
        names = expand_names(names, count)
        if not is_known(names):
            continue
        if len(names) == count:
            return names
        if len(names) + 1 == count and _are_numbered(rows):
            return ["index", *names]  # UZH-FPV numbers its rows without a name for that
        fitted = [*names[:count], *(f"column {k}" for k in range(len(names), count))]
        if is_complete(names) and is_complete(fitted):
            columns = header_of(fitted).columns
            if count in form.counts and all(
                columns.get(name) == place for name, place in form.columns.items()
            ):
                return None  # OpenVINS' header names covariances, whether the rows have them or not
            warn(
                f"{path}: the header names {len(names)} columns, the rows have {count}: the names "
                "are those of the first columns",
                Remark,
            )
            return fitted
    return None


def _are_numbered(rows: Sequence[Row]) -> bool:
    """Return True for rows whose first cells are consecutive numbers, and no times."""
    cells = [_cells(text)[0].strip() for _, text in rows[:_SAMPLE]]
    if not all(cell.isdigit() and len(cell) <= _LONGEST_NUMBER for cell in cells):
        return False
    return bool(np.all(np.diff([int(cell) for cell in cells]) == 1))


def _header_layout(
    path: Path,
    names: Sequence[str],
    sample: Sequence[Row],
    required: Sequence[str],
    forms: Mapping[str, TableForm],
) -> TableLayout:
    """Return the layout of a table whose header names the columns.

    :param sample: first rows below the header.
    :param required: quantities of which one must be there.
    :param forms: known forms of tables by their separator.
    """
    try:
        header = header_of(names, path.name)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    if not any(name in header.columns for name in required):
        available = ", ".join(name for name in header.columns) or "none"
        raise InputError(f"{path}: the header has no {required[0]}; it has {available}")
    row_format = _row_format(sample)
    counts = [len(_cells(text)) for _, text in sample]
    if header.count not in counts:
        first_line, _ = sample[0]
        raise InputError(
            f"{path}: the header names {header.count} columns, line {first_line} has {counts[0]}"
        )
    form = _form(forms, row_format)
    stamp, part, digits = header.stamp, header.nanosecond, header.digits
    if part is not None and not _are_parts(sample, row_format, part):
        stamp, part, digits = part, None, 0  # the same time twice, in seconds and nanoseconds
    if digits is None:
        digits = _digits(path, sample, row_format, stamp, form.digits)
    elif part is None:
        _check_unit(path, _stamps(sample, row_format, stamp), digits)
    layout = TableLayout(
        row_format,
        (header.count,),
        stamp,
        digits,
        digits == 0 and not _has_points(sample, row_format, stamp),
        header.columns,
        header.factors,
        f"the header names {header.count}",
        header.units,
        part,
        header.notes,
    )
    for note in (*layout.notes, *_unused_column_lines(names, header, required)):
        warn(f"{path}: {note}", Remark)
    return layout


def _unused_column_lines(
    names: Sequence[str], header: TableHeader, required: Sequence[str]
) -> Iterator[str]:
    """Yield a line about columns of unknown names in a table that lacks a triad."""
    missing = [name for name in (GYRO, ACCEL) if name in required and name not in header.columns]
    unknown = [name for name in names if name and is_unknown(name)]
    if missing and unknown:
        yield (
            f"no {' and no '.join(missing)}; the columns {', '.join(unknown[:_SHOWN_NAMES])} have "
            "names that are not known"
        )


def _check_unit(path: Path, times: Array, digits: int) -> None:
    """Refuse a unit of the header that contradicts the steps of the stamps.

    :param times: (n,) stamps in their unit.
    """
    step = _step(times)
    if step and step * 10.0**digits < _SHORTEST_STEP:
        raise InputError(
            f"{path}: the header says {TIME_NAMES[digits]}, and the stamps increase by {step:.3g}: "
            f"no IMU has more than {1_000_000 // _SHORTEST_STEP} kHz"
        )


def _form_layout(path: Path, sample: Sequence[Row], forms: Mapping[str, TableForm]) -> TableLayout:
    """Return the layout of a table without a header.

    :param sample: first rows.
    :param forms: known forms of tables by their separator.
    """
    row_format = _row_format(sample)
    form = _form(forms, row_format)
    digits = _digits(path, sample, row_format, 0, form.digits)
    if ORIENTATION in form.columns and row_format.separator != " " and digits != form.digits:
        warn(f"{path}: no header: the quaternion as w, x, y, z, as in EuRoC's tables", Remark)
    return TableLayout(
        row_format,
        form.counts,
        0,
        digits,
        digits == 0 and not (form.digits and _has_points(sample, row_format, 0)),
        form.columns,
        {},
        form.expected,
    )


def _form(forms: Mapping[str, TableForm], row_format: RowFormat) -> TableForm:
    """Return the form of a table without a header."""
    return forms.get(row_format.separator) or forms[","]


def _are_parts(sample: Sequence[Row], row_format: RowFormat, column: int) -> bool:
    """Return True if a column of nanoseconds has parts of seconds, not whole stamps."""
    texts = _stamp_texts(sample, row_format, column)
    whole = sum(len(text.partition(".")[0].lstrip("-+0")) > _DIGITS_OF_PART for text in texts)
    return 2 * whole <= len(texts)


def _row_format(sample: Sequence[Row]) -> RowFormat:
    """Return the format of rows, by the first ones."""
    text = sample[0][1].rstrip() if sample else b","
    quoted = _unquote_row(text) if b'"' in text else None
    if quoted is not None and b"," in quoted:
        return RowFormat(";", True, False)
    if b";" in text:
        return RowFormat(";", b"," in text, text.endswith(b";"))
    if b"\t" in text and b"," in text:
        cells = text.split(b"\t")
        # Decimal commas, at most one in each cell; a comma at the end of a cell is a separator.
        if all(cell.count(b",") <= 1 and not cell.strip().endswith(b",") for cell in cells):
            return RowFormat(" ", True, False)
    if b"," in text:
        return RowFormat(",", False, text.endswith(b","))
    return RowFormat(" ", False, False)


def _cells(text: bytes) -> list[bytes]:
    """Return the cells of a row in the row's own format."""
    return _row_format([(0, text)]).cells(text)


def _is_numeric(text: bytes) -> bool:
    """Return True if one of the first two cells of a row is a number."""
    for cell in _cells(text)[:2]:
        try:
            number_of(cell.decode("latin-1").strip().strip('"').replace(",", "."))
        except ValueError:
            continue
        return True
    return False


def _has_points(sample: Sequence[Row], row_format: RowFormat, stamp: int) -> bool:
    """Return True if most stamps have a decimal point or an exponent."""
    texts = _stamp_texts(sample, row_format, stamp)
    return bool(texts) and 2 * sum("." in text or "e" in text.lower() for text in texts) > len(
        texts
    )


def _stamp_texts(sample: Sequence[Row], row_format: RowFormat, stamp: int) -> list[str]:
    """Return the cells of the stamps' column."""
    rows = [row_format.cells(text) for _, text in sample]
    return [row[stamp].decode("latin-1").strip() for row in rows if stamp < len(row)]


def _stamps(sample: Sequence[Row], row_format: RowFormat, stamp: int) -> Array:
    """Return the finite stamps (n,) of rows in their unit."""
    values = []
    for text in _stamp_texts(sample, row_format, stamp):
        try:
            values.append(number_of(text))
        except ValueError:
            continue
    times = np.array(values)
    return times[np.isfinite(times)]


def _step(times: Array) -> float:
    """Return the median positive step of stamps; 0: they are too few, or do not increase."""
    steps = np.diff(times)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if len(steps) and len(times) >= _LEAST_ROWS else 0.0


def _digits(
    path: Path, sample: Sequence[Row], row_format: RowFormat, stamp: int, usual: int
) -> int:
    """Return the decimal digits between the unit of stamps and a nanosecond, from the stamps.

    :param usual: digits of the form of the table.
    :raises InputError: for dates, numbers of rows, and steps that fit no unit.
    """
    texts = _stamp_texts(sample, row_format, stamp)
    if texts and _DATE.match(texts[0]):
        raise InputError(
            f"{path}: the stamps are dates: {shorten_word(texts[0])}; write them as seconds since "
            "1970"
        )
    times = _stamps(sample, row_format, stamp)
    if len(times) < _LEAST_ROWS:
        return usual
    step = _step(times)
    size = float(np.median(np.abs(times)))
    points = _has_points(sample, row_format, stamp)
    digits = _digits_by_size(size, step, points, usual)
    if digits is None:
        raise InputError(
            f"{path}: the stamps increase by {step:g}: they may be milliseconds or numbers of "
            "rows, not nanoseconds; name the unit in a header, such as timestamp [ms]"
        )
    if digits != usual:
        warn(
            f"{path}: the stamps are taken as {TIME_NAMES[digits]}: {shorten_word(texts[0])}",
            Remark,
        )
    elif usual == _SECONDS and not points and step and step.is_integer() and size < _EARLIEST_UNIX:
        warn(
            f"{path}: the stamps increase by {step:g} and have no decimals: taken as s; if they "
            "are milliseconds or numbers of rows, name the unit in a header: timestamp [ms]",
            Remark,
        )
    return digits


def _digits_by_size(size: float, step: float, points: bool, usual: int) -> int | None:
    """Return the digits of the unit of stamps; None: undetermined.

    :param size: median of the stamps.
    :param step: median of the positive steps; 0: there are none.
    :param points: True if the stamps have a decimal point.
    """
    # Digits d of a unit of 10**-(9 - d) s in which the stamps are Unix times.
    unix_digits = (
        d for d in (0, 3, 6, 9) if _EARLIEST_UNIX <= size * 10.0 ** (d - 9) <= _LATEST_UNIX
    )
    utc = next(unix_digits, None)
    if usual == _SECONDS:
        if utc is not None:
            return utc
        return usual if size <= _LAST_SECOND else 0
    if utc == 0 or (utc == _SECONDS and (points or step < _LEAST_MICROSECONDS)):
        return utc
    if utc in (3, 6) and step < (_SLOWEST if utc == 3 else _SHORTEST_STEP):
        return utc
    if points and size <= _LAST_SECOND:
        return _SECONDS
    if not step or step >= _SHORTEST_STEP:
        return usual
    return 3 if step >= _LEAST_MICROSECONDS else None


def nanoseconds(stamps: NDArray[np.bytes_], digits: int) -> Integers:
    """Return stamps (n,) of text in nanoseconds.

    :param stamps: (n,) stamps of type ``S48``.
    :param digits: decimal digits between the unit of the stamps and a nanosecond: 9 for seconds.
    :raises ValueError, OverflowError: for a stamp that is not a number, or does not fit.
    """
    letters = np.ascontiguousarray(stamps).view(np.uint8).reshape(len(stamps), -1)
    letters = letters[:, : int(np.char.str_len(stamps).max(initial=1))]
    digit = (letters >= _ZERO) & (letters <= _NINE)
    point = letters == _POINT
    count, points = digit.sum(axis=1), point.sum(axis=1)
    decimals = (digit & (np.cumsum(point, axis=1) > 0)).sum(axis=1)
    # Plain: digits that int64 holds, at most one point among them, and nothing else.
    plain = (digit | point | (letters == 0)).all(axis=1) & (points <= 1)
    plain &= (count > decimals) & (decimals <= digits) & (count - decimals <= _MOST_DIGITS - digits)
    plain &= (count < _MOST_DIGITS) | ((count == _MOST_DIGITS) & (letters[:, 0] < _NINE))
    numbers = _combine_digits(letters, digit)
    units = numbers // 10**decimals
    if np.any(plain & (units > _LAST_SECOND * 10 ** (_SECONDS - digits))):
        raise OverflowError(f"a stamp above {_LAST_SECOND} s")
    numbers *= 10 ** (digits - np.minimum(decimals, digits))
    for k in np.flatnonzero(~plain):
        numbers[k] = parse_nanoseconds(stamps[k].decode("latin-1"), digits, whole=False)
    return numbers


def parse_nanoseconds(stamp: str, digits: int, whole: bool) -> int:
    """Return a stamp in nanoseconds; it may have an exponent, or many digits.

    :param digits: as for :func:`nanoseconds`.
    :param whole: the stamp must be a whole number.
    :raises ValueError, OverflowError: for a stamp that is not a number, or does not fit.
    """
    if len(stamp) >= STAMP_BYTES or "_" in stamp or not stamp.isascii():
        raise ValueError(stamp)  # Python accepts 1_000 and digits of other scripts
    if whole:
        t_ns = int(stamp) * 10**digits
    else:
        try:
            value = Decimal(stamp)
        except InvalidOperation:
            raise ValueError(stamp) from None
        if value.adjusted() >= _MOST_DIGITS - digits:  # 1e999999999 would fill the memory
            raise OverflowError(stamp)
        t_ns = round(value * 10**digits)
    if abs(t_ns) > _LAST_STAMP:
        raise OverflowError(stamp)
    return t_ns


def _combine_digits(letters: Bytes, digit: Mask) -> Integers:
    """Return the digits of each row (n, letters) as one number (n,); too many wrap around."""
    numbers = np.zeros(len(letters), dtype=np.int64)
    for column in range(letters.shape[1]):
        is_digit = digit[:, column]
        value = letters[:, column].astype(np.int64) - _ZERO
        numbers = np.where(is_digit, numbers * 10 + value, numbers)
    return numbers
