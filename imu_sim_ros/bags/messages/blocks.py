# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blocks of encoded messages, and the topics that they belong to."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages.schemas import Qos, Schema
from imu_sim_ros.types import Bytes, Times

_FEW: Final = 4
"""Messages of which each is put together alone in less time than an array of all."""


class Column(NamedTuple):
    """Numbers that differ from row to row."""

    offset: int
    """Offsets at which they begin in a row [bytes]."""
    values: NDArray[Any]
    """(n,) or (n, m), little-endian."""


class RowTemplate:
    """n rows of equal size: the bytes that all have, and the columns in which they differ.

    Most bytes of a message are the same in all messages of a topic.
    """

    __slots__ = ("columns", "count", "shape", "size", "template")

    def __init__(self, template: bytes, columns: Sequence[Column], count: int) -> None:
        """Keep the parts; nothing is copied.

        :param template: a row; what the columns cover in it does not matter.
        :param count: number of rows.
        """
        self.template, self.columns, self.count = template, columns, count
        self.shape = (count, len(template))
        """Number of rows, and bytes of each."""
        self.size = count * len(template)
        """Bytes of all rows."""

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, rows: slice) -> "RowTemplate":
        """Return some consecutive rows."""
        start, stop, _ = rows.indices(self.count)
        columns = [Column(at, values[start:stop]) for at, values in self.columns]
        return RowTemplate(self.template, columns, max(stop - start, 0))

    def array(self) -> Bytes:
        """Return the rows (n, size)."""
        rows = np.empty(self.shape, np.uint8)
        rows[:] = np.frombuffer(self.template, np.uint8)
        for offset, values in self.columns if self.size else ():
            strides = (rows.shape[1], values.itemsize)[: values.ndim]
            place: NDArray[Any] = np.ndarray(values.shape, values.dtype, rows, offset, strides)
            place[...] = values
        return rows


def side_by_side(patterns: Sequence[RowTemplate]) -> RowTemplate:
    """Return patterns of equally many rows as one: row k is that of each in turn."""
    if len(patterns) == 1:
        return patterns[0]
    template, columns = b"", []
    for pattern in patterns:
        columns += [Column(len(template) + at, values) for at, values in pattern.columns]
        template += pattern.template
    return RowTemplate(template, columns, len(patterns[0]))


def as_row_template(payloads: "Bytes | RowTemplate") -> RowTemplate:
    """Return messages of equal size as a pattern."""
    if isinstance(payloads, RowTemplate):
        return payloads
    count, size = payloads.shape
    return RowTemplate(bytes(size), [Column(0, payloads)] if size else [], count)


Payloads: TypeAlias = Bytes | list[bytes]
"""n messages: of equal size as an array (n, size), or a list."""


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a bag."""

    name: str
    type: str
    """In the form of ROS 2, for instance sensor_msgs/msg/Imu."""
    count: int
    schema: Schema
    qos: tuple[Qos, ...] = (Qos(),)


class MessageBlock(NamedTuple):
    """n messages of one topic, in the order of their record times."""

    topic: TopicInfo
    t_ns: Times
    """(n,) record times."""
    payloads: Payloads
    """(n, size) bytes of messages of equal size, or a list of n messages."""


def _row(rows: RowTemplate, k: int) -> bytes:
    """Return one row."""
    found = bytearray(rows.template)
    for offset, values in rows.columns:
        own = values[k].tobytes()
        found[offset : offset + len(own)] = own
    return bytes(found)


def as_list(payloads: Payloads | RowTemplate) -> list[bytes]:
    """Return messages as a list of bytes."""
    if isinstance(payloads, list):
        return payloads
    if payloads.shape[1] == 0:
        return [b""] * len(payloads)
    if isinstance(payloads, RowTemplate) and not payloads.columns:
        return [payloads.template] * payloads.count
    if isinstance(payloads, RowTemplate) and payloads.count <= _FEW:
        return [_row(payloads, k) for k in range(payloads.count)]
    table = payloads.array() if isinstance(payloads, RowTemplate) else payloads
    rows = np.ascontiguousarray(table)
    return rows.view(f"V{rows.shape[1]}")[:, 0].tolist()
