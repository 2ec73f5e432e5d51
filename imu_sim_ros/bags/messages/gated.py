# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The messages of a topic at the gate: which may pass, and what is wrong with the others."""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages.blocks import MessageBlock
from imu_sim_ros.bags.messages.decode import Decoded, decode_block
from imu_sim_ros.bags.messages.layouts import FIELDS
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs import BadRows, Skipped, Warned, gate

_QUANTITIES: Final = {
    "angular_velocity": gate.RATE,
    "linear_acceleration": gate.FORCE,
    "position": gate.POSITION,
    "orientation": gate.ORIENTATION,
    "linear": gate.VELOCITY,
    "angular": gate.RATE,
    "magnetic_field": gate.FIELD,
    "fluid_pressure": gate.PRESSURE,
    "temperature": gate.TEMPERATURE,
    "vector": gate.OTHER,
}
_STATED: Final = "orientation_covariance"
"""Negative in an Imu that has no orientation (REP-145)."""


def gated_fields(type_name: str) -> tuple[str, ...]:
    """Return the fields of a type of message that the gate looks at; none of most types."""
    names = [name for name, _, _ in FIELDS.get(type_name, ())]
    looked_at = tuple(name for name in names if name in (*_QUANTITIES, _STATED))
    return looked_at if looked_at != (_STATED,) else ()


class MessageGate:
    """Looks at the messages of one topic, block by block, and counts those that may not pass.

    :param path: of the bag.
    :param open_to_all: count them, but let them pass.
    """

    def __init__(self, path: str | Path, topic: str, open_to_all: bool = False) -> None:
        self.bad = BadRows(f"{path}: {topic}", "message")
        self._open, self._seen = open_to_all, 0

    def good(self, decoded: Decoded) -> NDArray[np.bool_] | None:
        """Return which of the next messages (n,) pass; None: all of them."""
        numbers = decoded.numbers
        columns = [(_QUANTITIES[name], numbers[name]) for name in numbers if name in _QUANTITIES]
        if _STATED in numbers and "orientation" in numbers:
            unstated = numbers[_STATED][:, :1] < 0.0
            stated = np.where(unstated, (0.0, 0.0, 0.0, 1.0), numbers["orientation"])
            columns = [(of, stated if of is gate.ORIENTATION else v) for of, v in columns]
        verdict = gate.Verdict(decoded.t_ns, columns)
        first, self._seen = self._seen, self._seen + len(decoded.t_ns)
        self.bad.good += int(np.count_nonzero(verdict.good))
        if verdict.good.all():
            return None
        verdict.note(self.bad, np.arange(first, self._seen), stamps=True)
        return None if self._open else verdict.good

    def passed(self, block: MessageBlock, encoding: str) -> MessageBlock:
        """Return the messages of the next block that pass, as they are."""
        fields = gated_fields(block.topic.type)
        try:
            good = self.good(decode_block(block, encoding, fields)) if fields else None
        except InputError:  # they are not of their type, which a copy of them does not mind
            good = None
        if good is None:
            return block
        payloads = block.payloads
        if isinstance(payloads, list):
            payloads = [payloads[k] for k in np.flatnonzero(good)]
        else:
            payloads = payloads[good]
        return MessageBlock(block.topic, block.t_ns[good], payloads)

    def settle(self, skipped: Skipped | None, warned: Warned | None) -> None:
        """Say what was refused, if anything was.

        :param skipped: receives how many messages were left out; None: they are errors.
        :param warned: receives what would have been; it has passed.
        :raises InputError: with the first messages.
        """
        if not self.bad.rows:
            return
        if warned is not None:
            warned(self.bad)
        elif skipped is not None:
            skipped(self.bad.rows)
        else:
            self.bad.complain()
