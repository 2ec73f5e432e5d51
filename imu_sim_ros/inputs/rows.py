# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files opened for reading, of bounded size, and the problems of their rows."""

from __future__ import annotations

import io
import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final

from imu_sim_ros.core.errors import InputError, system_error
from imu_sim_ros.inputs.sharing import Shareable, shared_files

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

LARGEST_TEXT: Final = 16 << 20
"""Largest file that is read as a whole [bytes]; those of this package have some 10 kB."""


def open_regular(path: str | Path) -> BinaryIO:
    """Open a file; devices, pipes and folders are refused, whose reading may never end.

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


class _OpenFile(Shareable):
    """An open file whose users read at places of their own."""

    def __init__(self, path: Path) -> None:
        self._file = open_regular(path)

    def _close_files(self) -> None:
        """Close the file."""
        self._file.close()

    def read_at(self, offset: int, size: int) -> bytes:
        """Return at most some bytes from an offset on; none at the end of the file."""
        return os.pread(self._file.fileno(), size, offset)

    def fileno(self) -> int:
        """Return the descriptor of the file."""
        return self._file.fileno()


class _View(io.RawIOBase):
    """Binary stream of an open file from its start, with a position of its own."""

    def __init__(self, file: _OpenFile) -> None:
        super().__init__()
        file.hold()
        self._file, self._offset = file, 0

    def readable(self) -> bool:
        """Return True."""
        return True

    def fileno(self) -> int:
        """Return the descriptor of the file, whose own position is not that of the view."""
        return self._file.fileno()

    def seekable(self) -> bool:
        """Return True."""
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to an offset from the start, the position or the end; returns the position.

        :raises OSError: for a position that no file of the system can have.
        """
        if whence == os.SEEK_CUR:
            offset, whence = offset + self._offset, os.SEEK_SET
        # The system checks the position; nobody reads at that of the descriptor.
        self._offset = os.lseek(self.fileno(), offset, whence)
        return self._offset

    def readinto(self, buffer: WriteableBuffer) -> int:
        """Fill a buffer with the bytes that follow; returns their number."""
        view = memoryview(buffer).cast("B")
        content = self._file.read_at(self._offset, len(view))
        view[: len(content)] = content
        self._offset += len(content)
        return len(content)

    def close(self) -> None:
        """Release the file, which is closed after its last user."""
        if not self.closed:
            self._file.release()
        super().close()


def open_shared(path: str | Path) -> BinaryIO:
    """Open a file from its start as :func:`open_regular` does; a program opens it only once."""
    files = shared_files()
    if files is None:
        return open_regular(path)
    return io.BufferedReader(_View(files.get(Path(path), _OpenFile)))


def is_present(path: str | Path) -> bool:
    """Return whether a file exists that another file, or the form of a folder, names.

    Only a missing file is absent. An entry that cannot be that file is an error, so that no part of
    a dataset is ignored silently.

    :raises InputError: for a broken link, a loop of links, a folder, a device or a pipe.
    :raises MachineError: if the system cannot read it.
    """
    return _is_present(Path(path), stat.S_IFREG)


def names_in(folder: str | Path) -> list[str]:
    """Return the sorted names in a folder of a dataset; none if it is absent.

    :raises InputError: as for :func:`is_present`, for an entry that is not a folder.
    """
    if not _is_present(Path(folder), stat.S_IFDIR):
        return []
    try:
        return sorted(os.listdir(folder))
    except OSError as error:
        raise system_error(folder, error) from None


def _is_present(path: Path, kind: int) -> bool:
    """Return whether a path exists; an entry of another kind is refused.

    :param kind: ``S_IFREG`` or ``S_IFDIR``.
    """
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
    """Refuse an entry of another kind.

    :param kind: ``S_IFREG`` or ``S_IFDIR``.
    """
    actual = stat.S_IFMT(mode)
    if actual == kind:
        return
    if kind == stat.S_IFDIR:
        raise InputError(f"{path}: Not a directory")
    if actual == stat.S_IFDIR:
        raise InputError(f"{path}: Is a directory")
    raise InputError(f"{path}: is a device or a pipe, not a file")


def read_text(path: str | Path) -> str:
    """Return a text file as a whole.

    :raises InputError: for a file that is not text in UTF-8, or too large.
    """
    with open_shared(path) as file:
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


_CHUNK_BYTES: Final = 4 << 20
"""Bytes that are read at once."""
_LONGEST_LINE: Final = 1 << 16
"""Longest line [bytes]; a file with longer ones is no text."""
_LONGEST_WORD: Final = 48
"""Longest cell in a message [characters]."""
_BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"
_UTF16: Final = (b"\xff\xfe", b"\xfe\xff")
_COMMENTS: Final = (b"#", b"%", b"//")
_SEPARATOR_LINE: Final = re.compile(rb"(?i)sep=.?\s*")
"""First line with which Excel names the separator."""
_NO_TEXT: Final = re.compile(rb"[\x01-\x08\x0e-\x1f\x7f-\x9f]")
"""Control characters, which text in Latin-1 lacks."""

Row = tuple[int, bytes]
"""Number and text of a line."""


def row_blocks(
    path: Path, expected: str, comments: list[bytes] | None = None
) -> Iterator[list[Row]]:
    """Yield the lines that are neither empty nor a comment (#, %, //), with numbers, in blocks.

    :param expected: expected content of the file, for messages.
    :param comments: receives the comments in front of the first other line.
    :raises InputError: for a file that is not text.
    """
    line, rest, newline = 0, b"", b"\n"
    with open_shared(path) as file:
        while True:
            chunk = file.read(_CHUNK_BYTES)
            if not line and not rest:
                if chunk.startswith(_UTF16):
                    raise InputError(f"{path}: text in UTF-16; save it in UTF-8")
                chunk = chunk.removeprefix(_BYTE_ORDER_MARK)
                newline = b"\n" if b"\n" in chunk or b"\r" not in chunk else b"\r"
            lines = (rest + chunk).split(newline)
            rest = lines.pop() if chunk else b""
            if b"\0" in chunk or len(rest) > _LONGEST_LINE:
                raise InputError(f"{path}: not {expected}")
            if not line:
                _check_text(path, lines or [rest], expected)
            rows = [(line + k, text.strip()) for k, text in enumerate(lines, start=1)]
            if rows and not line and _SEPARATOR_LINE.fullmatch(rows[0][1]):
                rows = rows[1:]
            content = [row for row in rows if row[1] and not row[1].startswith(_COMMENTS)]
            if comments is not None:
                end = content[0][0] if content else line + len(lines) + 1
                comments += [text for number, text in rows if text and number < end]
                comments = None if content else comments
            yield content
            line += len(lines)
            if not chunk:
                return


def _check_text(path: Path, lines: list[bytes], expected: str) -> None:
    """Refuse lines that are not UTF-8."""
    text = b"\n".join(lines)
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        if _NO_TEXT.search(text):
            raise InputError(f"{path}: not {expected}") from None


def number_of(word: str) -> float:
    """Return the number in a cell of a file.

    Underscores and digits of other scripts, which Python accepts, are refused.

    :raises ValueError: for a word that is not a number.
    """
    if "_" in word or not word.isascii():
        raise ValueError(word)
    return float(word)


def shorten_word(word: str) -> str:
    """Return a word of a file, shortened for messages."""
    return repr(word if len(word) <= _LONGEST_WORD else word[: _LONGEST_WORD - 8] + "...")
