# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of text files, in blocks, and what is wrong with them, all of it in one report."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.regular import open_regular

COLUMNS, NUMBERS, VALUES, STAMPS = "columns", "numbers", "values", "stamps"
"""Classes of what can be wrong; of each the first lines are shown."""
_SHOWN_PROBLEMS: Final = 10
_CHUNK_BYTES: Final = 4 << 20
_LONGEST_LINE: Final = 1 << 16
_LONGEST_WORD: Final = 48
_VERY_MANY: Final = 10_000

Row = tuple[int, bytes]
"""Number and text of a line."""


def row_blocks(path: Path, what: str) -> Iterator[list[Row]]:
    """Yield the lines that are neither empty nor a comment (#), with their numbers, in blocks.

    :param what: the file should be, for the message.
    :raises InputError: for a file that is not text.
    """
    line, rest = 0, b""
    with open_regular(path) as file:
        while True:
            chunk = file.read(_CHUNK_BYTES)
            lines = (rest + chunk).split(b"\n")
            rest = lines.pop() if chunk else b""
            if b"\0" in chunk or len(rest) > _LONGEST_LINE:
                raise InputError(f"{path}: not {what}")
            if not line:
                _check_text(path, lines or [rest], what)
            rows = [(line + k, text.strip()) for k, text in enumerate(lines, start=1)]
            yield [row for row in rows if row[1] and not row[1].startswith(b"#")]
            line += len(lines)
            if not chunk:
                return


def _check_text(path: Path, lines: list[bytes], what: str) -> None:
    try:
        b"\n".join(lines).decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not {what}") from None


def number_of(word: str) -> float:
    """Return the number that a word of a file is.

    Python's own 1_000 and digits of other scripts are none.

    :raises ValueError: for a word that is not a number.
    """
    if "_" in word or not word.isascii():
        raise ValueError(word)
    return float(word)


def shortened(word: str) -> str:
    """Return a word of a file as a message shows it."""
    return repr(word if len(word) <= _LONGEST_WORD else word[: _LONGEST_WORD - 8] + "...")


class BadRows:
    """What is wrong with the rows of one source: the first of every class, and the count.

    :param source: what a line of the report begins with: a file, and perhaps a topic of it.
    :param item: what its rows are, in the singular.
    """

    def __init__(self, source: str | Path, item: str = "line") -> None:
        self.source = source
        self._item = item
        self._found: dict[str, list[tuple[int, str]]] = {}
        self.count = 0
        """Problems so far; a row may have several."""
        self.rows = 0
        """Rows that are left out, counted by the reader."""
        self.good = 0
        """Rows that are not, counted by the reader."""

    def note(self, kind: str, number: int, words: str) -> None:
        """Note a problem.

        :param kind: its class.
        :param number: of the row.
        """
        self.count += 1
        shown = self._found.setdefault(kind, [])
        if len(shown) < _SHOWN_PROBLEMS:
            shown.append((number, words))

    def give_up(self) -> None:
        """Raise where very many rows are wrong, and most: the file is something else.

        Looking at each of ten million rows would take minutes.

        :raises InputError: as :meth:`complain` does.
        """
        if self.rows > max(_VERY_MANY, self.good):
            last = f"{self.source}: most of the first {self.rows + self.good} rows are wrong"
            raise InputError([*self.problems, last])

    @property
    def first(self) -> str:
        """The first of what is wrong; there must be one."""
        number, words = min(line for lines in self._found.values() for line in lines)
        return f"{self._item} {number}: {words}"

    def complain(self) -> None:
        """Raise where something is wrong.

        :raises InputError: with the first of every class, in the order of the source.
        """
        if self.count:
            raise InputError(self.problems)

    @property
    def problems(self) -> list[str]:
        """The first of every class, in the order of the source, and the count of the rest."""
        shown = sorted(line for lines in self._found.values() for line in lines)
        problems = [f"{self.source}: {self._item} {number}: {words}" for number, words in shown]
        more = self.count - len(shown)
        if more:
            problems.append(f"{self.source}: and {more} more such {self._item}s")
        return problems


Skipped = Callable[[int], object]
"""Receives the number of bad rows or messages that were left out."""
Warned = Callable[[BadRows], object]
"""Receives what is wrong with those that were not."""
