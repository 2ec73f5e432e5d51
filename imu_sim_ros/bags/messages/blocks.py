# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blocks of encoded messages, and the topics that they belong to."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages.schemas import Qos, Schema, parse_qos
from imu_sim_ros.core.types import AnyArray, Bytes, Times


class Column(NamedTuple):
    """Numbers that differ from row to row."""

    offset: int
    """Offsets at which they begin in a row [bytes]."""
    values: NDArray[np.generic]
    """(n,) or (n, m), little-endian; (n,) whole rows as bytes."""


@dataclass(frozen=True)
class RowTemplate:
    """n rows of equal size: the bytes that all have, and the columns in which they differ.

    Most bytes of a message are the same in all messages of a topic.
    """

    template: bytes
    """A row; what the columns cover in it does not matter."""
    columns: Sequence[Column]
    count: int
    """Number of rows."""

    @property
    def are_whole(self) -> bool:
        """True if each column has all of the rows."""
        return len(self.columns) == 1 and self.columns[0].values.dtype.kind == "V"

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, rows: slice) -> "RowTemplate":
        """Return some consecutive rows."""
        start, stop, _ = rows.indices(self.count)
        columns = [Column(offset, values[start:stop]) for offset, values in self.columns]
        return RowTemplate(self.template, columns, max(stop - start, 0))


def interleave(patterns: Sequence[RowTemplate], rows: slice = slice(None)) -> Bytes:
    """Return consecutive rows of patterns as an array (n, size): row k is that of each in turn."""
    template = b"".join(pattern.template for pattern in patterns)
    count, size = len(range(*rows.indices(patterns[0].count))), len(template)
    table: Bytes = np.frombuffer(bytearray(template) * count, np.uint8).reshape(count, size)
    row_start = 0
    for pattern in patterns if table.size else ():
        for offset, values in pattern.columns:
            values_of_rows = values[rows]
            strides = (size, values_of_rows.itemsize)[: values_of_rows.ndim]
            cells: AnyArray = np.ndarray(
                values_of_rows.shape, values_of_rows.dtype, table, row_start + offset, strides
            )
            cells[...] = values_of_rows
        row_start += len(pattern.template)
    return table


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
    """Type in the form of ROS 2, for instance sensor_msgs/msg/Imu."""
    count: int
    schema: Schema
    offered: object
    """Quality of service: profiles, or the text that a bag has of them."""

    @property
    def qos(self) -> tuple[Qos, ...]:
        """The quality-of-service profiles, which a copy of the topic takes over."""
        return self.offered if isinstance(self.offered, tuple) else parse_qos(self.offered)


class MessageBlock(NamedTuple):
    """n messages of one topic, in the order of their record times."""

    topic: TopicInfo
    t_ns: Times
    """(n,) record times."""
    payloads: Payloads
    """(n, size) bytes of messages of equal size, or a list of n messages."""


def as_list(payloads: Payloads | RowTemplate) -> list[bytes]:
    """Return messages as a list of bytes."""
    if isinstance(payloads, list):
        return payloads
    if isinstance(payloads, RowTemplate):
        if payloads.are_whole:
            return payloads.columns[0].values.tolist()
        payloads = interleave([payloads])
    if payloads.shape[1] == 0:
        return [b""] * len(payloads)
    rows = np.ascontiguousarray(payloads)
    return rows.view(f"V{rows.shape[1]}")[:, 0].tolist()
