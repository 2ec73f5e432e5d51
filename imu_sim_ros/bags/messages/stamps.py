# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of messages with any number of parts, transforms and paths, without their numbers."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import Payloads, as_list
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.core.types import Bytes, Integers, Times

_ENCAPSULATION: Final = 4
"""Size of what precedes a message in CDR [bytes]."""
_CDR_KIND: Final = b"\0\1"
"""First bytes of little-endian CDR."""
_STAMP_SIZE: Final = 8
_POSE_SIZE: Final = 7 * 8
"""Size of the numbers of a pose or a transform [bytes]."""


class TransformStamps(NamedTuple):
    """Stamps of the transforms between two frames in n messages."""

    parent: str
    child: str
    rows: Integers
    """(n,) rows of the messages."""
    t_ns: Times
    """(n,) stamps [ns]."""


class _Parts:
    """A message whose parts are read one after the other."""

    def __init__(self, payload: bytes, encoding: str) -> None:
        """Begin with the first part."""
        self._is_cdr = encoding == "cdr"
        self._start = _ENCAPSULATION if self._is_cdr else 0
        self._payload, self._offset = payload, 0
        self.structure = np.zeros(len(payload), np.bool_)
        """True for the bytes of the encoding, lengths and texts so far.

        The places of all others depend on them, and whether the message can be read.
        """
        self.structure[: self._start] = True
        self.stamp_kind = np.dtype([("second", "<i4" if self._is_cdr else "<u4"), ("rest", "<u4")])

    def check_encoding(self) -> None:
        """Check the first bytes of a message in CDR.

        :raises ValueError: for big-endian numbers, and other encodings than plain CDR.
        """
        if self._is_cdr and self._payload[:2] != _CDR_KIND:
            raise ValueError("not little-endian CDR")

    def _align(self, size: int) -> None:
        if self._is_cdr:
            self._offset += -self._offset % size

    def _pass(self, size: int) -> slice:
        """Pass over bytes; return where they are in the message.

        :raises ValueError: if the message ends before.
        """
        begin = self._start + self._offset
        if begin + size > len(self.structure):
            raise ValueError("the message ends too early")
        self._offset += size
        return slice(begin, begin + size)

    def length(self) -> int:
        """Return the length of an array."""
        self._align(4)
        place = self._pass(4)
        self.structure[place] = True
        return int.from_bytes(self._payload[place], "little")

    def text(self) -> str:
        """Return a string."""
        place = self._pass(self.length())
        self.structure[place] = True
        return self._payload[place].rstrip(b"\0").decode(errors="replace")

    def header(self) -> tuple[slice, str]:
        """Return where the stamp of a header is in the message, and the header's frame."""
        if not self._is_cdr:
            self._pass(4)  # the sequence number
        self._align(4)
        return self._pass(_STAMP_SIZE), self.text()

    def pass_pose(self) -> None:
        """Pass over the numbers of a pose or a transform."""
        self._align(8)
        self._pass(_POSE_SIZE)

    def stamps(self, table: Bytes, place: slice) -> Times:
        """Return the stamps (n,) at a place of messages (n, size) [ns]."""
        fields = np.ascontiguousarray(table[:, place]).view(self.stamp_kind)[:, 0]
        return fields["second"].astype(np.int64) * NANOSECONDS_PER_SECOND + fields["rest"]


def transform_stamps(payloads: Payloads, encoding: str) -> Iterator[TransformStamps]:
    """Yield the stamps between each two frames in n tf2_msgs/TFMessage; other bytes are left out.

    Messages that differ in stamps and numbers alone are read, or left out, together.
    """
    stamps_by_frames = dict[tuple[str, str], list[tuple[Integers, Times]]]()
    messages = [bytes(payload) for payload in as_list(payloads)]
    sizes = np.array([len(message) for message in messages])
    for size in np.unique(sizes[sizes > 0]).tolist():
        rows = np.flatnonzero(sizes == size)
        table = np.frombuffer(b"".join(messages[row] for row in rows), np.uint8)
        table = table.reshape(len(rows), size)
        while len(rows):
            parts = _Parts(table[0].tobytes(), encoding)
            try:
                parts.check_encoding()
                transforms = [_transform(parts) for _ in range(parts.length())]
            except ValueError:  # no such message
                transforms = []
            structure = np.flatnonzero(parts.structure)
            alike = np.all(table[:, structure] == table[0, structure], axis=1)
            for parent, child, place in transforms:
                stamps = parts.stamps(table[alike], place)
                stamps_by_frames.setdefault((parent, child), []).append((rows[alike], stamps))
            rows, table = rows[~alike], table[~alike]
    for (parent, child), groups in stamps_by_frames.items():
        message_rows, t_ns = (np.concatenate(columns) for columns in zip(*groups, strict=True))
        order = np.argsort(message_rows, kind="stable")
        yield TransformStamps(parent, child, message_rows[order], t_ns[order])


def _transform(parts: _Parts) -> tuple[str, str, slice]:
    """Return parent and child of the next transform, and where its stamp is."""
    place, parent = parts.header()
    child = parts.text()
    parts.pass_pose()
    return parent.lstrip("/"), child.lstrip("/"), place


def path_stamps(payload: bytes, encoding: str) -> Times:
    """Return the stamps (n,) of the poses of a nav_msgs/Path [ns].

    :raises ValueError: for bytes that are no such message.
    """
    parts = _Parts(payload, encoding)
    parts.check_encoding()
    parts.header()
    places = []
    for _ in range(parts.length()):
        places.append(parts.header()[0])
        parts.pass_pose()
    table = np.frombuffer(payload, np.uint8)[None]
    return np.concatenate([np.empty(0, np.int64), *(parts.stamps(table, p) for p in places)])
