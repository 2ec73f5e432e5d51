# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Columns of text tables as arrays; rows that cannot be read are left out and counted."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array, Mask, Times
from imu_sim_ros.inputs.layout import STAMP_BYTES, nanoseconds, parse_nanoseconds
from imu_sim_ros.inputs.rows import number_of, open_shared

HEAD_BYTES: Final = 1 << 14
"""Length of the start of a file by which its kind is recognised [bytes]."""
_LAST_STAMP: Final = 2**31 * 10**9
"""End of the stamps that a message of ROS holds [ns]."""
_DATE: Final = re.compile(rb"(\d{4})[-/](\d\d)[-/](\d\d)[T ](\d\d:\d\d:\d\d(?:\.\d{1,9})?)")
_BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"
_LONGEST_LINE: Final = 1 << 16
"""Longest line of a table [bytes]; longer ones are no text."""
_TEXT_SUFFIXES: Final = (".csv", ".txt", ".log", ".asc", ".dat", "")


class Columns(NamedTuple):
    """n rows of a text table."""

    t_ns: Times
    """(n,) stamps."""
    values: Array
    """(n, m) numbers."""


class ColumnTable:
    """A text table with a header: names of its columns, and its rows."""

    def __init__(self, source: str, names: Sequence[str], rows: Sequence[bytes], separator: str):
        """Initialise with the lines of a table.

        :param source: name of the table, for messages.
        :param rows: lines behind the header.
        :param separator: a character; a blank: any blanks.
        """
        self.source = source
        self.names = list(names)
        self.rows = rows
        self.separator = separator

    def has(self, *names: str) -> bool:
        """Return True if the table has all of these columns."""
        return all(name in self.names for name in names)

    def columns(
        self,
        stamp: str,
        digits: int,
        names: Sequence[str],
        damage: list[str],
        optional: Sequence[str] = (),
    ) -> Columns:
        """Return stamps and columns.

        :param stamp: name of the column of the stamps.
        :param digits: decimal digits between the unit of the stamps and a nanosecond.
        :param names: columns whose values must be numbers.
        :param damage: receives a line with the number of rows that are left out.
        :param optional: columns whose values may be missing, NaN: in the table, or in a row.
        """
        available = [name for name in optional if name in self.names]
        places = [self.names.index(name) for name in (*names, *available)]
        stamps = [self.names.index(stamp)]
        cells, bad = self._cells(places, len(names), stamps, digits)
        t_ns = nanoseconds(cells["stamp"][:, 0], digits) if len(cells) else np.empty(0, np.int64)
        values = np.full((len(cells), len(names) + len(optional)), np.nan)
        values[:, : len(names)] = cells["values"][:, : len(names)]
        for k, name in enumerate(available, start=len(names)):
            values[:, len(names) + list(optional).index(name)] = cells["values"][:, k]
        good = valid_stamps(t_ns) & np.isfinite(values[:, : len(names)]).all(axis=1)
        bad += int(np.count_nonzero(~good))
        if bad:
            damage.append(f"{self.source}: {bad} rows left out, which are no numbers or times")
        return Columns(t_ns[good], values[good])

    def numbers(self, names: Sequence[str], damage: list[str]) -> Array:
        """Return columns (n, m) of numbers, without the rows in which one is missing.

        :param names: m columns of the header.
        :param damage: receives a line with the number of rows that are left out.
        """
        places = [self.names.index(name) for name in names]
        cells, bad = self._cells(places, required=len(names))
        values: Array = cells["values"]
        good = np.isfinite(values).all(axis=1)
        bad += int(np.count_nonzero(~good))
        if bad:
            damage.append(f"{self.source}: {bad} rows left out, which are no numbers")
        return values[good]

    def _cells(
        self, places: Sequence[int], required: int, stamps: Sequence[int] = (), digits: int = 0
    ) -> tuple[NDArray[np.void], int]:
        """Return the cells of all rows that can be converted, and the number of the others.

        :param places: columns of numbers.
        :param required: number of these, the first ones, that must not be empty.
        :param stamps: columns of stamps, which remain text.
        :param digits: decimal digits between the unit of the stamps and a nanosecond.
        """
        fields = [("values", "<f8", (len(places),))]
        if stamps:
            fields.insert(0, ("stamp", f"S{STAMP_BYTES}", (len(stamps),)))
        kind = np.dtype(fields)
        delimiter = None if self.separator == " " else self.separator
        lines = [row.decode("latin-1") for row in self.rows]
        if not lines:
            return np.empty(0, kind), 0
        try:
            cells = _load_cells(lines, kind, delimiter, (*stamps, *places), len(self.names))
            if stamps:
                nanoseconds(cells["stamp"][:, 0], digits)
            return cells, 0
        except (ValueError, OverflowError):
            pass
        good, count = [], len(self.names)
        for line in lines:
            parts = [part.strip() for part in line.split(delimiter)]
            if len(parts) < count or len(parts) > count + 1:
                continue
            for k in places[required:]:
                parts[k] = parts[k] if _is_number(parts[k]) else "nan"
            if all(_is_number(parts[k]) for k in places) and all(
                _is_stamp(parts[k], digits) for k in stamps
            ):
                good.append("\t".join(parts[k] for k in (*stamps, *places)))
        bad = len(lines) - len(good)
        if not good:
            return np.empty(0, kind), bad
        width = len(stamps) + len(places)
        return _load_cells(good, kind, "\t", range(width), width), bad


def _load_cells(
    lines: Sequence[str],
    kind: np.dtype[np.void],
    delimiter: str | None,
    places: Sequence[int],
    width: int,
) -> NDArray[np.void]:
    """Return cells of lines, all converted at once.

    :param places: columns that are converted.
    :param width: number of columns of a line; a separator may follow the last one.
    :raises ValueError: if one of them cannot be converted.
    """
    for line in lines:
        count = len(line.split(delimiter)) if delimiter is None else line.count(delimiter) + 1
        if not width <= count <= width + 1:
            raise ValueError("columns")
    cells: NDArray[np.void] = np.loadtxt(
        lines, kind, delimiter=delimiter, usecols=places, comments=None, ndmin=1
    )
    if len(cells) != len(lines):
        raise ValueError("empty lines")
    if "stamp" in (kind.names or ()):
        cells["stamp"] = np.char.strip(cells["stamp"])
    return cells


def head_of(path: Path, magic: bytes) -> bytes:
    """Return the start of a text file; empty for folders and for files that are no text.

    :param magic: first bytes of a file; empty for a folder.
    """
    if not magic or b"\0" in magic or path.suffix.lower() not in _TEXT_SUFFIXES:
        return b""
    with open_shared(path) as file:
        content = file.read(HEAD_BYTES)
    return b"" if b"\0" in content else content.removeprefix(_BYTE_ORDER_MARK)


def read_lines(path: Path) -> list[bytes]:
    """Return the lines of a text file without the blanks at their ends; not the empty ones.

    :raises InputError: for a file that is no text.
    """
    with open_shared(path) as file:
        return lines_of(str(path), file.read())


def lines_of(source: str, content: bytes) -> list[bytes]:
    """Return the lines of a content as :func:`read_lines` does.

    :raises InputError: for a content that is no text.
    """
    lines = content.removeprefix(_BYTE_ORDER_MARK).split(b"\n")
    if b"\0" in content or max(map(len, lines)) > _LONGEST_LINE:
        raise InputError(f"{source}: damaged: not text")
    return [line.rstrip(b"\r") for line in lines if line.strip()]


def table_of(source: str, lines: Sequence[bytes]) -> ColumnTable:
    """Return a table of lines, of which the first has the names of the columns.

    The separator is that of the header. Quotes are removed; numbers may have a decimal comma if the
    separator is none.
    """
    head = lines[0].decode("utf-8", "replace") if lines else ""
    separator = next((mark for mark in (";", "\t", ",") if mark in head), " ")
    rows: Sequence[bytes] = lines[1:]
    if b'"' in b"".join(rows[:1]):
        rows = [row.replace(b'"', b"") for row in rows]
    if separator != "," and b"," in b"".join(rows[:2]):
        rows = [row.replace(b",", b".") for row in rows]
    names = head.split() if separator == " " else head.split(separator)
    names = [name.strip().strip('"').strip() for name in names]
    return ColumnTable(source, names[: len(names) - (names[-1:] == [""])], rows, separator)


def utc_ns(text: bytes) -> int | None:
    """Return the time of a text that has a date such as 2011-09-26 13:02:25.96 [ns]; else None."""
    date = _DATE.search(text)
    if date is None:
        return None
    plain = b"-".join(date.groups()[:3]) + b"T" + date[4]
    try:
        return int(np.datetime64(plain.decode(), "ns").astype(np.int64))
    except ValueError:
        return None


def valid_stamps(t_ns: Times) -> Mask:
    """Return True for stamps (n,) that a message of ROS holds."""
    return (t_ns >= 0) & (t_ns < _LAST_STAMP)


def split_unit(name: str) -> tuple[str, str]:
    """Return the name of a column without its unit in brackets, and the unit.

    ``"Acc_X (in m/s2)"`` is ``"Acc_X"`` in ``"m/s2"``.
    """
    match = re.fullmatch(r"(.*?)\s*[(\[](?:in )?([^)\]]*)[)\]]\s*", name)
    return (match[1].strip(), match[2].strip()) if match else (name.strip(), "")


def _is_number(text: str) -> bool:
    """Return True if :func:`number_of` reads a cell."""
    try:
        number_of(text)
    except ValueError:
        return False
    return True


def _is_stamp(text: str, digits: int) -> bool:
    """Return True for a cell whose number of time units is a stamp."""
    try:
        parse_nanoseconds(text, digits, whole=False)
    except (ValueError, OverflowError):
        return False
    return True
