# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Everything to be published, merged in the order in which it is due."""

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import repeat
from typing import NamedTuple, Protocol

import numpy as np

from imu_sim_ros.bags.messages.blocks import as_list
from imu_sim_ros.core import timebase
from imu_sim_ros.core.types import Times
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.topics import Encode

Send = Callable[[bytes], None]
Group = tuple[int, Sequence[tuple[Send, bytes]]]
"""Functions due at one time [ns], with the messages that they publish."""


class Piece(NamedTuple):
    """Messages of one topic."""

    times: Times
    """(m,) times at which the messages are due [ns], never decreasing."""
    send: Send
    """Function that publishes a message."""
    payloads: Sequence[bytes]
    """The m messages."""


class Stream(Protocol):
    """A source of messages, piece by piece."""

    def restart(self, t0_ns: int) -> None:
        """Go back to the first message, with a new time zero."""

    def advance(self, end: float) -> Iterator[Piece]:
        """Yield the messages that were not yielded yet, up to ``end`` seconds after zero."""


class BodyStream:
    """The topics of the sensors of a body."""

    def __init__(self, body: Body, outputs: Sequence[tuple[str, Encode, Send]]) -> None:
        """Connect sensors, by name, with their topics."""
        self._body, self._outputs = body, outputs

    def restart(self, t0_ns: int) -> None:
        """Return to the first samples: the same follow again."""
        self._body.t0_ns = t0_ns
        self._body.reset()

    def advance(self, end: float) -> Iterator[Piece]:
        """Yield the messages of the samples before ``end``."""
        samples = self._body.until(Fraction(repr(float(end))))
        for sensor, encode, send in self._outputs:
            messages = encode(samples[sensor], self._body.sensors[sensor].valid)
            if len(messages.due_t_ns):
                yield Piece(messages.due_t_ns, send, as_list(messages.made()))


class TickStream:
    """Messages at a rate of their own that depend on the time alone."""

    def __init__(
        self, rate: float, make: Callable[[Times, int], Sequence[bytes]], send: Send
    ) -> None:
        """Set up the stream.

        :param make: returns the messages at times (n,) [ns]; the second argument is time zero.
        """
        self._rate, self._make, self._send = rate, make, send
        self._position = self._t0_ns = 0

    def restart(self, t0_ns: int) -> None:
        """Go back to the first message."""
        self._position, self._t0_ns = 0, t0_ns

    def advance(self, end: float) -> Iterator[Piece]:
        """Yield the messages before ``end``."""
        count = timebase.sample_count(end, self._rate) - self._position
        if count <= 0:
            return
        times = timebase.sample_times_ns(self._position, count, self._rate, self._t0_ns)
        self._position += count
        yield Piece(times, self._send, self._make(times, self._t0_ns))


class PublishQueue:
    """All streams of a node, merged; messages delayed by latency wait here."""

    def __init__(self, streams: Sequence[Stream], duration: float) -> None:
        """Join streams.

        :param duration: length of the run [s]; ``math.inf``: no end.
        """
        self._streams = streams
        self._duration = duration
        self.restart(0)

    @property
    def finished(self) -> bool:
        """True if every message has been yielded."""
        return self._end >= self._duration

    def restart(self, t0_ns: int) -> None:
        """Go back to time zero."""
        self._t0_ns = t0_ns
        self._end = 0.0
        self._held: list[Piece] = []
        for stream in self._streams:
            stream.restart(t0_ns)

    def next_groups(self, length: float) -> list[Group]:
        """Return the entries due in the next ``length`` seconds, in order."""
        self._end = min(self._end + length, self._duration)
        fresh = [piece for stream in self._streams for piece in stream.advance(self._end)]
        pieces = [*_hurry(self._held, fresh), *fresh]
        if self.finished:
            self._held = []
            return _merge(pieces)
        # A message delayed by latency waits for the block in whose time it is due.
        limit = self._t0_ns + timebase.to_nanoseconds(self._end)
        cuts = [int(np.searchsorted(piece.times, limit)) for piece in pieces]
        self._held = [
            Piece(piece.times[cut:], piece.send, piece.payloads[cut:])
            for piece, cut in zip(pieces, cuts, strict=True)
            if cut < len(piece.times)
        ]
        return _merge(
            [
                Piece(piece.times[:cut], piece.send, piece.payloads[:cut])
                for piece, cut in zip(pieces, cuts, strict=True)
            ]
        )


def _hurry(waiting: Sequence[Piece], fresh: Sequence[Piece]) -> list[Piece]:
    """Return waiting messages, due no later than the next message of their topic.

    With an unchanged latency that changes nothing, for no message overtakes another. Where it was
    lowered, messages under way arrive before those that now follow sooner.
    """
    first_times = {piece.send: int(piece.times[0]) for piece in reversed(fresh) if len(piece.times)}
    return [
        piece._replace(times=np.minimum(piece.times, first_times.get(piece.send, piece.times[-1])))
        for piece in waiting
    ]


def _merge(pieces: Sequence[Piece]) -> list[Group]:
    """Return all messages by time; those of equal time are together, in the pieces' order."""
    if not pieces:
        return []
    common = pieces[0].times
    if all(np.array_equal(piece.times, common) for piece in pieces):
        columns = [zip(repeat(piece.send), piece.payloads) for piece in pieces]
        return list(zip(common.tolist(), zip(*columns, strict=True), strict=True))
    times = np.concatenate([piece.times for piece in pieces])
    order = np.argsort(times, kind="stable")
    messages = [(piece.send, payload) for piece in pieces for payload in piece.payloads]
    groups: list[Group] = []
    previous_ns: int | None = None
    for time_ns, k in zip(times[order].tolist(), order.tolist(), strict=True):
        if time_ns != previous_ns:
            together: list[tuple[Send, bytes]] = []
            groups.append((time_ns, together))
            previous_ns = time_ns
        together.append(messages[k])
    return groups
