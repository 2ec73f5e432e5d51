# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The messages of a damaged SQLite file, found page by page without its trees.

Each page that holds rows states itself where they lie, and each row how long it is
(https://www.sqlite.org/fileformat2.html). Pages that the trees no longer lead to are found as well,
and those that lost or inserted bytes have shifted.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

from imu_sim_ros.inputs.rows import open_regular

_LEAF: Final = re.compile(rb"(?=\x0d..[\x00-\x0f])", re.DOTALL)
"""A leaf of a table has the kind 13; the number of its rows follows 2 bytes later."""
_LEAF_HEADER_BYTES: Final = 8
"""Bytes of the header of a leaf page of a table."""
_INTEGER_BYTES: Final = (0, 1, 2, 3, 4, 6, 8)
"""Size of an integer by its serial type; 8 and 9 are the constants 0 and 1."""


class StoredMessage(NamedTuple):
    """A row of the table of messages."""

    id: int
    topic: int
    t_ns: int
    data: bytes


class _Cell(NamedTuple):
    """A row in its page, whose data may go on in other pages."""

    offset: int
    end: int
    row: StoredMessage | None


class MessagePages:
    """The pages with messages of one file."""

    def __init__(self, path: Path, columns: Sequence[str], topics: Collection[int]) -> None:
        """Look for the pages.

        :param columns: names of the columns of the table of messages, in their order.
        :param topics: ids of the topics; a row of another topic is no message.
        """
        self._file = open_regular(path)
        self._size = self._file.seek(0, 2)
        head = self._read(0, 100)
        stated = int.from_bytes(head[16:18], "big")
        self._page_size = 65536 if stated == 1 else stated
        self._usable = self._page_size - head[20]
        self._missing = int.from_bytes(head[28:32], "big") * self._page_size - self._size
        self._columns = list(columns)
        self._topics = topics
        self._broken: set[int] = set()
        """Pages before lost or inserted bytes: their last rows may have lost their ends."""
        self._leaves = self._find()
        """Offsets in the file in the order of the first rows."""

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def rows(self) -> Iterator[list[StoredMessage]]:
        """Yield the messages of each page in the order of their ids."""
        for offset in self._leaves:
            yield self._rows(offset)

    @property
    def is_cut(self) -> bool:
        """True if the file has fewer pages than it states."""
        return self._missing >= self._page_size

    def _read(self, offset: int, size: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(size)

    def _find(self) -> list[int]:
        """Return the offsets of all pages with messages, in the order of their first rows."""
        offsets: dict[int, int] = {}
        offset = self._page_size  # the first page is that of the schema
        while offset + self._page_size <= self._size:
            rows = self._rows(offset)
            if not rows:
                shifted = self._find_page_start(offset)
                if shifted is None:
                    offset += self._page_size
                    continue
                self._broken.add(offset - self._page_size)
                offset = shifted
                rows = self._rows(offset)
            offsets.setdefault(rows[0].id, offset)
            offset += self._page_size
        return [offsets[first_id] for first_id in sorted(offsets)]

    def _find_page_start(self, offset: int) -> int | None:
        """Return where within a page's length from here a page begins, if one does."""
        data = self._read(offset, 2 * self._page_size)
        # The pattern looks 3 bytes ahead: a page may begin at any of the next page_size bytes.
        for match in _LEAF.finditer(data, 1, self._page_size + 3):
            cells = self._cells(data[match.start() : match.start() + self._page_size])
            if cells and all(cell.row for cell in cells):
                return offset + match.start()
        return None

    def _rows(self, offset: int) -> list[StoredMessage]:
        """Return the messages of the page at an offset; none if it has none.

        A row before a damaged one may be damaged at its end, and is left out too.
        """
        cells = self._cells(self._read(offset, self._page_size), offset)
        if offset in self._broken:
            cells = cells[:-1]
        good = [
            cell.row
            for cell, following in pairwise([*cells, None])
            if cell is not None
            and cell.row
            and (following is None or (following.row is not None and cell.end <= following.offset))
        ]
        return sorted(good)

    def _cells(self, page: bytes, offset: int = -1) -> list[_Cell]:
        """Return the rows of a page.

        :param offset: offset of the page in the file; negative: parts in other pages are left out.
        """
        if len(page) < self._page_size or page[0] != 0x0D:
            return []
        count = int.from_bytes(page[3:5], "big")
        array = page[_LEAF_HEADER_BYTES : _LEAF_HEADER_BYTES + 2 * count]
        starts = sorted(int.from_bytes(array[k : k + 2], "big") for k in range(0, len(array), 2))
        if not count or len(array) < 2 * count or starts[0] < _LEAF_HEADER_BYTES + 2 * count:
            return []
        return [self._cell(page, start, offset) for start in starts]

    def _cell(self, page: bytes, start: int, offset: int) -> _Cell:
        """Return the row at a place of a page, with its parts in other pages.

        :param start: place of the row in the page.
        :param offset: offset of the page in the file; negative: parts in other pages are left out.
        """
        try:
            size, position = _varint(page, start)
            id_, position = _varint(page, position)
            local = self._local(size)
            content, end = page[position : position + local], position + local
            if end > self._usable:
                raise ValueError("the row reaches past the end of its page")
            if local < size:
                page_number, end = int.from_bytes(page[end : end + 4], "big"), end + 4
                content += (
                    self._elsewhere(page_number, size - local, offset) if offset >= 0 else b""
                )
            row = self._row(id_, content, size)
        except (ValueError, IndexError):
            return _Cell(start, start, None)
        return _Cell(start, end, row)

    def _local(self, size: int) -> int:
        """Return how many bytes of a row lie in its leaf."""
        smallest = (self._usable - 12) * 32 // 255 - 23
        largest = self._usable - 35
        fitting = smallest + (size - smallest) % (self._usable - 4)
        if size <= largest:
            return size
        return fitting if fitting <= largest else smallest

    def _elsewhere(self, page: int, size: int, offset: int) -> bytes:
        """Return the rest of a row, from a chain of pages, each of which names the next one."""
        shift = offset % self._page_size
        if shift:
            shift = (
                -self._missing
                if (-self._missing - shift) % self._page_size == 0
                else (shift - self._page_size)
            )
        content = b""
        while size > len(content):
            start = (page - 1) * self._page_size + shift
            if page < 2 or start < 0:
                raise ValueError("there is no such page")
            data = self._read(start, self._usable)
            page = int.from_bytes(data[:4], "big")
            content += data[4 : 4 + size - len(content)]
            if len(data) < self._usable or (page == 0) != (len(content) == size):
                raise ValueError("the chain of pages is damaged")
        return content

    def _row(self, id_: int, content: bytes, size: int) -> StoredMessage:
        """Return a row of a table of messages.

        :raises ValueError: if it is none.
        """
        head, position = _varint(content, 0)
        kinds = []
        while position < head:
            kind, position = _varint(content, position)
            kinds.append(kind)
        if position != head or len(kinds) != len(self._columns):
            raise ValueError("it has other columns")
        values: dict[str, bytes] = {}
        stated = head
        for name, kind in zip(self._columns, kinds, strict=True):
            if name == "data":
                width = (kind - 12) // 2 if kind >= 12 and kind % 2 == 0 else -1
            elif name == "id":
                width = 0 if kind == 0 else -1
            else:
                width = _INTEGER_BYTES[kind] if 1 <= kind <= 6 else (0 if kind in (8, 9) else -1)
                values[name] = bytes([kind - 8]) if kind in (8, 9) else b""
            if width < 0:
                raise ValueError(f"{name} has another type")
            values[name] = values.get(name, b"") or content[stated : stated + width]
            stated += width
        topic = int.from_bytes(values["topic_id"], "big", signed=True)
        if stated != size or topic not in self._topics:
            raise ValueError("it is not a message")
        t_ns = int.from_bytes(values["timestamp"], "big", signed=True)
        return StoredMessage(id_, topic, t_ns, values["data"])


def _varint(data: bytes, offset: int) -> tuple[int, int]:
    """Return a number of 1 to 9 bytes, and where it ends."""
    value = 0
    for k in range(8):
        byte = data[offset + k]
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, offset + k + 1
    return value << 8 | data[offset + 8], offset + 9
