# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records of several topics in the order of time, as one run of bytes."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import RowTemplate, side_by_side
from imu_sim_ros.bags.writer import BagTopic, time_order
from imu_sim_ros.types import Bytes, Integers, Times


class Records(NamedTuple):
    """n messages of one topic as records of equal size, in the order of time."""

    topic: BagTopic
    t_ns: Times
    rows: RowTemplate


class Indexed(NamedTuple):
    """The messages of one topic in a chunk."""

    topic: BagTopic
    t_ns: Times
    offsets: Integers
    """Offsets of the records in the chunk."""


def parts(records: Sequence[Records], size: int) -> Iterator[list[Records]]:
    """Yield records in pieces of time of about equal size [bytes]."""
    longest = max((one.t_ns for one in records), key=len)
    count = min(max(1, round(sum(one.rows.size for one in records) / size)), len(longest))
    inner = np.linspace(0, len(longest), count + 1).astype(int)[1:-1]
    edges = [np.searchsorted(one.t_ns, longest[inner]).tolist() for one in records]
    cuts = [pairwise([0, *own, len(one.t_ns)]) for own, one in zip(edges, records, strict=True)]
    for spans in zip(*cuts, strict=True):
        yield [
            Records(topic, t_ns[start:stop], rows[start:stop])
            for (topic, t_ns, rows), (start, stop) in zip(records, spans, strict=True)
            if stop > start
        ]


def merged(records: Sequence[Records]) -> tuple[Bytes, list[Indexed]]:
    """Return records by time, and where they are; of equal times those of the first topic first.

    Topics with the same times, as the readings and the truth of an IMU, are one table with rows
    side by side. Between tables, what follows each other from one of them is copied at once.
    """
    tables = _tables(records)
    rows = [side_by_side([one.rows for one in table]).array() for table in tables]
    counts = [len(one) for one in rows]
    order = time_order([table[0].t_ns for table in tables])
    owner = np.repeat(np.arange(len(tables)), counts)[order]
    row = order - np.cumsum([0, *counts[:-1]])[owner]
    widths = np.array([one.shape[1] for one in rows])
    ends = np.cumsum(widths[owner])
    begins = ends - widths[owner]
    index = []
    for k, table in enumerate(tables):
        offsets = begins[owner == k]
        for topic, t_ns, own in table:
            index.append(Indexed(topic, t_ns, offsets))
            offsets = offsets + own.shape[1]
    if len(tables) == 1:
        return rows[0].reshape(-1), index
    starts = np.flatnonzero(np.concatenate([[True], owner[1:] != owner[:-1]]))
    sources = owner[starts]
    first = (row[starts] * widths[sources]).tolist()
    last = ((row[np.append(starts[1:], len(owner)) - 1] + 1) * widths[sources]).tolist()
    content = [memoryview(one.reshape(-1).data) for one in rows]
    pieces = zip(sources.tolist(), first, last, strict=True)
    joined = b"".join([content[k][begin:end] for k, begin, end in pieces])
    return np.frombuffer(joined, np.uint8), index


def _tables(records: Sequence[Records]) -> list[list[Records]]:
    """Return neighbours with the same times together.

    Not if two times are equal: rows of equal times would mix.
    """
    tables: list[list[Records]] = []
    for one in records:
        increases = bool(np.all(one.t_ns[1:] > one.t_ns[:-1]))
        if tables and increases and np.array_equal(tables[-1][0].t_ns, one.t_ns):
            tables[-1].append(one)
        else:
            tables.append([one])
    return tables
