# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of a text table as numbers, block by block; rows that are none are noted."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from imu_sim_ros.core.bad_rows import NUMBERS, BadRows
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.inputs.layout import TableLayout
from imu_sim_ros.inputs.rows import Row, row_blocks


class NumberRows(NamedTuple):
    """n rows of a table."""

    lines: Times
    """(n,) numbers of the lines."""
    t_ns: Times
    """(n,) stamps [ns]."""
    values: dict[str, Array]
    """Quantities (n, m) by name, in SI units."""


class RowReader(ABC):
    """Reader of one text table of stamps and numbers, with its bad rows so far."""

    def __init__(self, path: Path, content: str, names: Collection[str]) -> None:
        """Initialise without rows.

        :param content: expected content of the file, for messages.
        :param names: quantities that are read if the table has them.
        """
        self.bad = BadRows(path)
        self.comments: list[bytes] = []
        """Comments in front of the first row."""
        self.layout: TableLayout | None = None
        """Columns of the table; None before the first row."""
        self.path, self.content, self.names = path, content, names

    @abstractmethod
    def layout_of(self, rows: list[Row]) -> TableLayout:
        """Return the layout of the table, and remove its header from its first rows."""

    def blocks(self) -> Iterator[Iterator[NumberRows]]:
        """Yield the rows of a block of lines that are numbers, in pieces; note the others.

        Use each piece before the next one: rows that are counted as good prevent giving up.

        :raises InputError: for a file of another form.
        """
        for rows in row_blocks(self.path, self.content, self.comments):
            if rows:
                self.layout = self.layout or self.layout_of(rows)
                yield self._pieces(self.layout, rows)

    def parse(self, layout: TableLayout, rows: list[Row]) -> NumberRows:
        """Return rows as numbers.

        :raises ValueError, OverflowError: if one of them cannot be converted.
        """
        t_ns, values = layout.parse(rows, self.names)
        return NumberRows(np.array([line for line, _ in rows], np.int64), t_ns, values)

    def note(self, layout: TableLayout, line: int, text: bytes) -> None:
        """Note why a row cannot be converted."""
        layout.note(self.bad, line, text, self.names)

    def _pieces(self, layout: TableLayout, rows: list[Row]) -> Iterator[NumberRows]:
        """Yield rows that are numbers; rows that cannot be converted at once are halved."""
        waiting = [rows] if rows else []
        while waiting:
            part = waiting.pop()
            try:
                piece = self.parse(layout, part)
            except (ValueError, OverflowError):
                half = len(part) // 2
                if half:
                    waiting += [part[half:], part[:half]]
                    continue
                self.bad.rows += 1
                count = self.bad.count
                self.note(layout, *part[0])
                if self.bad.count == count:
                    self.bad.note(NUMBERS, part[0][0], "cannot be read as numbers")
                self.bad.give_up()
            else:
                yield piece
