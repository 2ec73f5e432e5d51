# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Problems of the rows of a table, or of the messages of a topic, told together."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from imu_sim_ros.core.errors import InputError, Remark, warn

COLUMNS, NUMBERS, VALUES, STAMPS = "columns", "numbers", "values", "stamps"
"""Classes of problems; the first lines of each are shown."""
_SHOWN_PROBLEMS: Final = 10
"""Largest number of bad rows that a message names."""
_VERY_MANY: Final = 10_000
"""Number of bad rows up to which a file is read, however few of its rows are good."""


class BadRows:
    """Problems of the rows of one source: the first of every class, and the count.

    :param source: beginning of a line of the report: a file, and perhaps its topic.
    :param item: name of a row, in the singular.
    """

    def __init__(self, source: str | Path, item: str = "line") -> None:
        self.source = source
        self._item = item
        self._lines_by_kind: dict[str, list[tuple[int, str]]] = {}
        self.count = 0
        """Number of problems so far; a row may have several."""
        self.rows = 0
        """Number of rows that are left out, counted by the reader."""
        self.good = 0
        """Number of rows that are used, counted by the reader."""

    def note(self, kind: str, number: int, text: str) -> None:
        """Note a problem.

        :param kind: class of the problem.
        :param number: number of the row.
        """
        self.count += 1
        lines = self._lines_by_kind.setdefault(kind, [])
        if len(lines) < _SHOWN_PROBLEMS:
            lines.append((number, text))

    def give_up(self) -> None:
        """Raise if most of very many rows are bad: the file has another content.

        Checking each of ten million rows would take minutes.

        :raises InputError: as :meth:`complain` does.
        """
        if self.rows > max(_VERY_MANY, self.good):
            summary = f"{self.source}: most of the first {self.rows + self.good} rows are wrong"
            raise InputError([*self.problems, summary])

    @property
    def first(self) -> str:
        """The first problem; there must be one."""
        number, text = min(line for lines in self._lines_by_kind.values() for line in lines)
        return f"{self._item} {number}: {text}"

    def complain(self) -> None:
        """Raise if there is a problem.

        :raises InputError: with the first of every class, in the order of the source.
        """
        if self.count:
            raise InputError(self.problems)

    @property
    def problems(self) -> list[str]:
        """The first problems of every class, in the source's order, and the number of others."""
        shown = sorted(line for lines in self._lines_by_kind.values() for line in lines)
        problems = [f"{self.source}: {self._item} {number}: {text}" for number, text in shown]
        hidden = self.count - len(shown)
        if hidden:
            problems.append(f"{self.source}: and {hidden} more such {self._item}s")
        return problems


Skipped = Callable[[int], object]
"""Receiver of the number of bad rows or messages that were left out."""


def tell_skipped(source: object) -> Skipped:
    """Return a receiver that reports how many rows of a source are left out."""

    def tell(count: int) -> None:
        warn(f"{source}: {count} bad rows skipped", Remark)

    return tell


Warned = Callable[[BadRows], object]
"""Receiver of the problems of rows that were used."""
