# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that are opened for reading, of a bounded size, and what is wrong with their rows."""

import os
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO, Final

from imu_sim_ros.errors import InputError, Remark, system_error, warn

LARGEST_TEXT: Final = 16 << 20
"""[bytes] of a file that is read as a whole; the largest of this package have some 10 kB."""


def open_regular(path: str | Path) -> BinaryIO:
    """Open a file; devices, pipes and folders, of which one may read for ever, are refused.

    :raises InputError: with the reason.
    :raises MachineError: if the system cannot read it.
    """
    if "\0" in str(path):
        raise InputError(f"{str(path)!r}: is not a file name")
    try:
        # Without O_NONBLOCK, opening a pipe waits for its writer.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise system_error(path, error) from None
    try:
        _check_kind(path, os.fstat(descriptor).st_mode, stat.S_IFREG)
    except InputError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def is_present(path: str | Path) -> bool:
    """Return whether a file exists that another file, or the form of a folder, names.

    Only what does not exist is absent. What is there and cannot be that file is an error, so that
    nothing a dataset has is left out without a word.

    :raises InputError: for a broken link, a loop of links, a folder, a device or a pipe.
    :raises MachineError: if the system cannot read it.
    """
    return _is_present(Path(path), stat.S_IFREG)


def names_in(folder: str | Path) -> list[str]:
    """Return the sorted names in a folder of a dataset; none if it is absent.

    :raises InputError: as for :func:`is_present`, for what is no folder.
    """
    if not _is_present(Path(folder), stat.S_IFDIR):
        return []
    try:
        return sorted(os.listdir(folder))
    except OSError as error:
        raise system_error(folder, error) from None


def _is_present(path: Path, kind: int) -> bool:
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        for part in (path, *path.parents):
            if os.path.lexists(part):
                if not part.exists():
                    raise InputError(f"{part}: a broken link to {os.readlink(part)}") from None
                break
        return False
    except OSError as error:
        raise system_error(path, error) from None
    except ValueError:
        raise InputError(f"{str(path)!r}: is not a file name") from None
    _check_kind(path, mode, kind)
    return True


def _check_kind(path: str | Path, mode: int, kind: int) -> None:
    """Refuse what is not of a kind.

    :param kind: ``S_IFREG`` or ``S_IFDIR``.
    """
    found = stat.S_IFMT(mode)
    if found == kind:
        return
    if kind == stat.S_IFDIR:
        raise InputError(f"{path}: Not a directory")
    if found == stat.S_IFDIR:
        raise InputError(f"{path}: Is a directory")
    raise InputError(f"{path}: is a device or a pipe, not a file")


def read_text(path: str | Path) -> str:
    """Return a text file as a whole.

    :raises InputError: for what is not text in UTF-8, or larger than texts are.
    """
    with open_regular(path) as file:
        try:
            content = file.read(LARGEST_TEXT + 1)
        except OSError as error:
            raise system_error(path, error) from None
    if len(content) > LARGEST_TEXT:
        raise InputError(
            f"{path}: larger than {LARGEST_TEXT >> 20} MiB, too large for a parameter file"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file in UTF-8 (byte {error.start})") from None


COLUMNS, NUMBERS, VALUES, STAMPS = "columns", "numbers", "values", "stamps"
"""Classes of what can be wrong; of each the first lines are shown."""
_SHOWN_PROBLEMS: Final = 10
_CHUNK_BYTES: Final = 4 << 20
_LONGEST_LINE: Final = 1 << 16
_LONGEST_WORD: Final = 48
_BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"
_VERY_MANY: Final = 10_000

Row = tuple[int, bytes]
"""Number and text of a line."""


def row_blocks(path: Path, what: str, comments: list[bytes] | None = None) -> Iterator[list[Row]]:
    """Yield the lines that are neither empty nor a comment (#), with their numbers, in blocks.

    :param what: the file should be, for the message.
    :param comments: receives the comments in front of the first other line.
    :raises InputError: for a file that is not text.
    """
    line, rest = 0, b""
    with open_regular(path) as file:
        while True:
            chunk = file.read(_CHUNK_BYTES)
            if not line and not rest:
                chunk = chunk.removeprefix(_BYTE_ORDER_MARK)
            lines = (rest + chunk).split(b"\n")
            rest = lines.pop() if chunk else b""
            if b"\0" in chunk or len(rest) > _LONGEST_LINE:
                raise InputError(f"{path}: not {what}")
            if not line:
                _check_text(path, lines or [rest], what)
            rows = [(line + k, text.strip()) for k, text in enumerate(lines, start=1)]
            content = [row for row in rows if row[1] and not row[1].startswith(b"#")]
            if comments is not None:
                end = content[0][0] if content else line + len(lines) + 1
                comments += [text for number, text in rows if text and number < end]
                comments = None if content else comments
            yield content
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
        :param number: number of the row.
        """
        self.count += 1
        shown = self._found.setdefault(kind, [])
        if len(shown) < _SHOWN_PROBLEMS:
            shown.append((number, words))

    def give_up(self) -> None:
        """Raise if very many rows are wrong, and most: the file is something else.

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
        """Raise if something is wrong.

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


def tell_skipped(source: object) -> Skipped:
    """Return what tells the user how many rows of a source are left out."""

    def tell(count: int) -> None:
        warn(f"{source}: {count} bad rows skipped", Remark)

    return tell


Warned = Callable[[BadRows], object]
"""Receives what is wrong with those that were not."""
