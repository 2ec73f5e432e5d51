# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of messages with any number of parts, transforms and paths, without their numbers."""

import struct
from collections.abc import Iterator
from typing import Final

from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND

_ENCAPSULATION: Final = 4
"""Size of what precedes a message in CDR [bytes]."""
_CDR_KIND: Final = b"\0\1"
"""First bytes of little-endian CDR."""
_POSE_SIZE: Final = 7 * 8
"""Size of the numbers of a pose or a transform [bytes]."""


class _Parts:
    """A message whose parts are read one after the other."""

    def __init__(self, payload: bytes, encoding: str) -> None:
        """Begin with the first part.

        :raises ValueError: for other encodings.
        """
        self._is_cdr = encoding == "cdr"
        if self._is_cdr and payload[:2] != _CDR_KIND:
            raise ValueError("not little-endian CDR")
        self._payload = payload[_ENCAPSULATION:] if self._is_cdr else payload
        self._offset = 0

    def _align(self, size: int) -> None:
        if self._is_cdr:
            self._offset += -self._offset % size

    def length(self) -> int:
        """Return the length of an array."""
        self._align(4)
        (count,) = struct.unpack_from("<I", self._payload, self._offset)
        self._offset += 4
        return int(count)

    def text(self) -> str:
        """Return a string."""
        size = self.length()
        text = self._payload[self._offset : self._offset + size]
        self._offset += size
        return text.rstrip(b"\0").decode(errors="replace")

    def header(self) -> tuple[int, str]:
        """Return stamp [ns] and frame of a header."""
        if not self._is_cdr:
            self.length()  # the sequence number
        self._align(4)
        second, nanosecond = struct.unpack_from(
            "<iI" if self._is_cdr else "<II", self._payload, self._offset
        )
        self._offset += 8
        return second * NANOSECONDS_PER_SECOND + nanosecond, self.text()

    def skip_pose(self) -> None:
        """Pass over the numbers of a pose or a transform.

        :raises ValueError: if the message ends before.
        """
        self._align(8)
        self._offset += _POSE_SIZE
        if self._offset > len(self._payload):
            raise ValueError("the message ends too early")


def transform_stamps(payload: bytes, encoding: str) -> Iterator[tuple[str, str, int]]:
    """Yield parent, child and stamp [ns] of each transform of a tf2_msgs/TFMessage.

    :raises ValueError, struct.error: for bytes that are no such message.
    """
    parts = _Parts(payload, encoding)
    for _ in range(parts.length()):
        t_ns, parent = parts.header()
        child = parts.text()
        parts.skip_pose()
        yield parent.lstrip("/"), child.lstrip("/"), t_ns


def path_stamps(payload: bytes, encoding: str) -> Iterator[int]:
    """Yield the stamp [ns] of each pose of a nav_msgs/Path.

    :raises ValueError, struct.error: for bytes that are no such message.
    """
    parts = _Parts(payload, encoding)
    parts.header()
    for _ in range(parts.length()):
        t_ns, _ = parts.header()
        parts.skip_pose()
        yield t_ns
