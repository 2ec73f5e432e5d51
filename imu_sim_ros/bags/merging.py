# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records of several topics in the order of time, as one run of bytes.

Sensors with fixed rates send in a pattern that repeats: four readings of the IMU, one of the
wheels. Of such a stretch a whole period becomes one row, and NumPy writes all of them at once.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import Column, RowTemplate, side_by_side
from imu_sim_ros.bags.writer import BagTopic, time_order
from imu_sim_ros.types import Bytes, Integers, Times

_MOST_INTERVALS: Final = 5
"""Intervals of the slowest topic that a period may have: three for 15 Hz next to 200 Hz."""
_FEWEST_PERIODS: Final = 4


class Indexed(NamedTuple):
    """The messages of one topic in a chunk."""

    topic: BagTopic
    t_ns: Times
    offsets: Times
    """Offsets of the records in the chunk."""


class Records(NamedTuple):
    """n messages of one topic as records of equal size, in the order of time."""

    topic: BagTopic
    t_ns: Times
    rows: RowTemplate

    def part(self, start: int, stop: int) -> "Records":
        """Return some consecutive records."""
        return Records(self.topic, self.t_ns[start:stop], self.rows[start:stop])


class _Member(NamedTuple):
    """The k records of one topic in each row."""

    topic: BagTopic
    t_ns: Times
    """(n k,)"""
    offsets: Times
    """(k,) of the records in a row."""


class Rows(NamedTuple):
    """n rows, each with the same numbers of records of the same topics."""

    rows: RowTemplate
    members: list[_Member]

    def indexed(self, start: int, stop: int) -> list[Indexed]:
        """Return what is in some consecutive rows; the offsets count from the first of them."""
        begins = np.arange(stop - start, dtype=np.int64)[:, None] * self.rows.shape[1]
        return [
            Indexed(
                topic,
                t_ns[start * len(offsets) : stop * len(offsets)],
                (begins + offsets).reshape(-1),
            )
            for topic, t_ns, offsets in self.members
        ]


class Repeated(NamedTuple):
    """Records of which most follow each other in a pattern that repeats."""

    before: list[Records]
    periods: Rows
    after: list[Records]


class _Table(NamedTuple):
    """Records of topics with the same times."""

    t_ns: Times
    records: list[Records]

    @property
    def shifts(self) -> Times:
        """Where the record of each topic begins in a row."""
        return np.cumsum([0, *(one.rows.shape[1] for one in self.records[:-1])], dtype=np.int64)

    def rows(self) -> RowTemplate:
        return side_by_side([one.rows for one in self.records])


class _Sequence(NamedTuple):
    """The rows of tables in the order of time."""

    owner: Times
    """Number of the table."""
    row: Times
    """Its row."""


def row_by_row(records: Sequence[Records]) -> Rows:
    """Return records of topics with the same times: one of each in turn."""
    table = _Table(records[0].t_ns, list(records))
    members = [
        _Member(one.topic, one.t_ns, shift[None])
        for one, shift in zip(records, table.shifts, strict=True)
    ]
    return Rows(table.rows(), members)


def repeated(records: Sequence[Records], largest: int) -> Repeated | None:
    """Return records in the order of time as a pattern that repeats; None if there is none.

    :param largest: bytes that a period may have.
    """
    tables = _tables(records)
    if len(tables) == 1:
        return None
    sequence = _sequence(tables)
    found = _period(sequence.owner, [len(table.t_ns) for table in tables])
    if found is None:
        return None
    start, length, count = found
    pattern = sequence.owner[start : start + length]
    counts = np.bincount(pattern, minlength=len(tables))
    widths = np.array([sum(one.rows.shape[1] for one in table.records) for table in tables])
    if widths @ counts > largest:
        return None
    firsts = [int(np.count_nonzero(sequence.owner[:start] == k)) for k in range(len(tables))]
    lasts = [first + count * int(each) for first, each in zip(firsts, counts, strict=True)]
    ends = np.cumsum(widths[pattern])
    template, columns, members = bytearray(int(ends[-1])), list[Column](), list[_Member]()
    for k, table in enumerate(tables):
        places = (ends - widths[pattern])[pattern == k]
        if not len(places):
            continue
        part = _Table(table.t_ns, [one.part(firsts[k], lasts[k]) for one in table.records])
        rows = part.rows()
        for place in places.tolist():
            template[place : place + widths[k]] = rows.template
        columns += _spread(rows.columns, places, count)
        members += [
            _Member(one.topic, one.t_ns, places + shift)
            for one, shift in zip(part.records, part.shifts, strict=True)
        ]
    owners = [k for k, table in enumerate(tables) for _ in table.records]
    return Repeated(
        [one.part(0, firsts[k]) for one, k in zip(records, owners, strict=True) if firsts[k]],
        Rows(RowTemplate(bytes(template), columns, count), members),
        [
            one.part(lasts[k], len(one.t_ns))
            for one, k in zip(records, owners, strict=True)
            if lasts[k] < len(one.t_ns)
        ],
    )


def parts(records: Sequence[Records], size: int) -> Iterator[list[Records]]:
    """Yield records in pieces of time of about equal size [bytes]."""
    longest = max((one.t_ns for one in records), key=len)
    count = -(-sum(one.rows.size for one in records) // size)
    inner = np.linspace(0, len(longest), count + 1).astype(int)[1:-1]
    edges = [np.searchsorted(one.t_ns, longest[inner]).tolist() for one in records]
    cuts = [pairwise([0, *own, len(one.t_ns)]) for own, one in zip(edges, records, strict=True)]
    for spans in zip(*cuts, strict=True):
        cut = [one.part(*span) for one, span in zip(records, spans, strict=True)]
        if kept := [one for one in cut if len(one.t_ns)]:
            yield kept


def merged(
    records: Sequence[Records], filled: Callable[[RowTemplate], Bytes]
) -> tuple[Bytes, list[Indexed]]:
    """Return records by time, and where they are; of equal times those of the first topic first.

    What follows each other from the same table is copied at once: an IMU's rows between two fixes.

    :param filled: returns the rows of a table.
    """
    if not records:
        return np.empty(0, np.uint8), []
    tables = _tables(records)
    rows = [filled(table.rows()) for table in tables]
    owner, row = _sequence(tables)
    widths = np.array([one.shape[1] for one in rows])
    ends = np.cumsum(widths[owner])
    begins = ends - widths[owner]
    index = [
        Indexed(one.topic, one.t_ns, offsets + shift)
        for k, table in enumerate(tables)
        for offsets in [begins[owner == k]]
        for one, shift in zip(table.records, table.shifts, strict=True)
    ]
    starts = np.flatnonzero(np.concatenate([[True], owner[1:] != owner[:-1]]))
    sources = owner[starts]
    first = (row[starts] * widths[sources]).tolist()
    last = ((row[np.append(starts[1:], len(owner)) - 1] + 1) * widths[sources]).tolist()
    content = [memoryview(one.reshape(-1).data) for one in rows]
    pieces = zip(sources.tolist(), first, last, strict=True)
    joined = b"".join([content[k][begin:end] for k, begin, end in pieces])
    return np.frombuffer(joined, np.uint8), index


def _tables(records: Sequence[Records]) -> list[_Table]:
    """Return neighbours with the same times together.

    Not if two times are equal: rows of equal times would mix.
    """
    tables: list[_Table] = []
    for one in records:
        if tables and np.array_equal(tables[-1].t_ns, one.t_ns) and _increases(one.t_ns):
            tables[-1].records.append(one)
        else:
            tables.append(_Table(one.t_ns, [one]))
    return tables


def _increases(t_ns: Times) -> bool:
    return bool(np.all(t_ns[1:] > t_ns[:-1]))


def _sequence(tables: Sequence[_Table]) -> _Sequence:
    """Return the order of all rows; of equal times, that of the first table is first."""
    counts = [len(table.t_ns) for table in tables]
    order = time_order([table.t_ns for table in tables])
    owner = np.repeat(np.arange(len(tables)), counts)[order]
    return _Sequence(owner, order - np.cumsum([0, *counts[:-1]])[owner])


def _period(owner: Times, counts: Sequence[int]) -> tuple[int, int, int] | None:
    """Return first row, length and number of the periods of the longest stretch that repeats.

    Each begins with a row of the rarest table, so that periods of all blocks are alike.

    :param owner: number of the table of each row.
    :param counts: rows of each table, at least one.
    :returns: None for less than half of all rows.
    """
    rarest = np.flatnonzero(owner == int(np.argmin(counts)))
    middle = len(rarest) // 2
    for intervals in range(1, min(_MOST_INTERVALS, len(rarest) - 1 - middle) + 1):
        length = int(rarest[middle + intervals] - rarest[middle])
        differ = np.flatnonzero(owner[length:] != owner[:-length])
        edges = np.concatenate([[-1], differ, [len(owner) - length]])
        longest = int(np.argmax(np.diff(edges)))
        stop = int(edges[longest + 1]) + length
        first = int(np.searchsorted(rarest, edges[longest] + 1))
        if first == len(rarest):
            continue
        start = int(rarest[first])
        count = (stop - start) // length
        if count >= _FEWEST_PERIODS and 2 * count * length >= len(owner):
            return start, length, count
    return None


def _spread(columns: Sequence[Column], places: Times, count: int) -> list[Column]:
    """Return the columns of a table's rows as columns of periods.

    Runs of rows at equal distances, as most are, become columns together.

    :param places: (k,) where the table's rows begin in a period.
    :param count: number of periods n; the columns have n k rows.
    """
    distances = np.diff(places)
    width = int(distances.min()) if len(distances) else 0
    runs = np.split(np.arange(len(places)), np.flatnonzero(distances != width) + 1)
    begins = places[[run[0] for run in runs]]
    regular = len({len(run) for run in runs}) == 1 and len(set(np.diff(begins).tolist())) <= 1
    spread = []
    for offset, values, _ in columns:
        by_period = values.reshape(count, len(places), *values.shape[1:])
        if regular:
            apart = int(begins[1] - begins[0]) if len(runs) > 1 else 0
            grid = by_period.reshape(count, len(runs), len(runs[0]), *values.shape[1:])
            spread.append(Column(offset + int(begins[0]), grid, (apart, width)))
            continue
        for run, begin in zip(runs, begins.tolist(), strict=True):
            own = by_period[:, run[0] : run[-1] + 1]
            spread.append(Column(offset + begin, own, (width,)))
    return spread


def joined_index(parts_of_chunk: Sequence[tuple[int, Sequence[Indexed]]]) -> list[Indexed]:
    """Return the messages of a chunk that consists of parts, topic by topic.

    :param parts_of_chunk: where each part begins, and the messages in it.
    """
    by_topic: dict[BagTopic, list[tuple[Times, Integers]]] = {}
    for begin, index in parts_of_chunk:
        for topic, t_ns, offsets in index:
            by_topic.setdefault(topic, []).append((t_ns, offsets + begin))
    return [
        Indexed(topic, *(np.concatenate(values) for values in zip(*found, strict=True)))
        for topic, found in by_topic.items()
    ]
