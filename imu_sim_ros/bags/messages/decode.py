# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The messages of a topic as arrays, with those that the gate refuses."""

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import MessageBlock, Payloads
from imu_sim_ros.bags.messages.layouts import (
    FIRST,
    TYPES,
    Layout,
    fields,
    layout,
    text_bytes,
    texts_of,
)
from imu_sim_ros.core import gate
from imu_sim_ros.core.bad_rows import BadRows, Skipped, Warned
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.core.types import Array, Bytes, Integers, Mask, Times

_INSIDE_ORDER: Final = [3, 0, 1, 2]
"""Indices of (w, x, y, z) in the message's (x, y, z, w)."""


class Decoded(NamedTuple):
    """The fields of n messages of one type."""

    texts: tuple[str, ...]
    """Texts of the first message."""
    record_t_ns: Times
    """(n,) when they were recorded."""
    t_ns: Times
    """(n,) stamps."""
    nanosecond: Integers
    """(n,) the stamps' nanoseconds as the messages have them."""
    numbers: dict[str, Array]
    """Arrays (n, count) by name of the field, or (n,) for a single number."""
    frames: Integers
    """(n,) indices into ``frame_ids``."""
    frame_ids: tuple[str, ...]
    """First texts of the messages, each once."""

    def at(self, rows: Mask) -> "Decoded":
        """Return some of the messages."""
        numbers = {name: values[rows] for name, values in self.numbers.items()}
        times = self.record_t_ns[rows], self.t_ns[rows], self.nanosecond[rows]
        return Decoded(self.texts, *times, numbers, self.frames[rows], self.frame_ids)


def concatenate_blocks(parts: Sequence[Decoded]) -> Decoded:
    """Return blocks of messages that follow each other as one; there must be one."""
    first_part = parts[0]
    if len(parts) == 1:
        return first_part
    frame_ids = tuple(dict.fromkeys(name for part in parts for name in part.frame_ids))
    return Decoded(
        first_part.texts,
        np.concatenate([part.record_t_ns for part in parts]),
        np.concatenate([part.t_ns for part in parts]),
        np.concatenate([part.nanosecond for part in parts]),
        {
            name: np.concatenate([part.numbers[name] for part in parts])
            for name in first_part.numbers
        },
        np.concatenate([_indices(part, frame_ids) for part in parts]),
        frame_ids,
    )


def _indices(part: Decoded, frame_ids: tuple[str, ...]) -> Integers:
    """Return the indices (n,) of the messages' frames among those of all blocks."""
    lookup: Integers = np.array([frame_ids.index(name) for name in part.frame_ids], np.int64)
    return lookup[part.frames] if len(lookup) else part.frames


def decode_block(block: MessageBlock, encoding: str, names: Sequence[str]) -> Decoded:
    """Return fields of a block's messages.

    :param names: names of :func:`imu_sim_ros.bags.messages.layouts.fields` of this type;
        ``name[0]`` is the first number of a field alone, (n,).
    :raises InputError: for a message that is not one of its type.
    """
    type_name = block.topic.type
    try:
        groups = group_by_texts(type_name, encoding, block.payloads)
    except (ArithmeticError, LookupError, ValueError, struct.error) as error:
        raise InputError(f"{block.topic.name}: not {type_name} messages: {error}") from None
    count = len(block.t_ns)
    t_ns, nanosecond = np.empty((2, count), dtype=np.int64)
    first_form = groups[0].form
    field_names = {name: name.removesuffix(FIRST) for name in names}
    numbers = {
        name: np.empty((count, *first_form.dtype[field].shape)[: 1 if name != field else None])
        for name, field in field_names.items()
    }
    frame_ids = tuple(dict.fromkeys(group.texts[0] for group in groups if group.texts))
    frames = np.zeros(count, dtype=np.int64)
    for form, texts, rows, payloads in groups:
        if len(frame_ids) > 1:
            frames[rows] = frame_ids.index(texts[0])
        values = payloads.view(form.dtype)[:, 0]
        seconds = values["sec"].astype(np.int64) * NANOSECONDS_PER_SECOND
        nanosecond[rows] = values["nanosec"]
        t_ns[rows] = seconds + nanosecond[rows]
        for name, field in field_names.items():
            numbers[name][rows] = values[field] if name == field else values[field][:, 0]
    times = block.t_ns, t_ns, nanosecond
    return Decoded(groups[0].texts, *times, numbers, frames, frame_ids)


class MessageDecoder:
    """The numbers of single CDR messages of one type, without making message objects.

    The numbers are unpacked at known offsets, which depend only on the lengths of the strings and
    are recomputed when a string changes.
    """

    def __init__(self, type_name: str, names: Sequence[str]) -> None:
        """Set up the decoder.

        :param names: names of :func:`imu_sim_ros.bags.messages.layouts.fields`, in that order.
        """
        self._type_name, self._names = type_name, ("sec", "nanosec", *names)
        self._latest: _Form | None = None
        self.texts: tuple[str, ...] = ()
        """The strings of the latest message."""

    def numbers(self, payload: bytes) -> tuple[Any, ...]:
        """Return seconds and nanoseconds of the stamp, then the numbers of the fields.

        :raises InputError: for bytes that are not such a message in little-endian CDR.
        """
        form = self._latest
        if form is not None:
            for start, stop, content in form.fixed:
                if payload[start:stop] != content:
                    form = None
                    break
        try:
            if form is None:
                form = self._latest = self._form(payload)
                self.texts = form.texts
            return form.fields.unpack_from(payload)
        except (ValueError, struct.error) as error:
            raise InputError(f"not a {self._type_name}: {error}") from None

    def _form(self, payload: bytes) -> "_Form":
        """Return the form of messages with the texts of this one."""
        texts = text_bytes(self._type_name, "cdr", payload)
        message_layout = layout(self._type_name, "cdr", texts)
        fixed = [
            (start, stop, message_layout.template[start:stop])
            for start, stop in message_layout.fixed
        ]
        strings = tuple(text.rstrip(b"\0").decode("utf-8", "replace") for text in texts)
        return _Form(fixed, message_layout.unpacker(self._names), strings)


class _Form(NamedTuple):
    """Properties shared by messages with the same strings."""

    fixed: list[tuple[int, int, bytes]]
    """Spans (start, stop) with identical bytes in all of them."""
    fields: struct.Struct
    texts: tuple[str, ...]


def quaternions_wxyz(orientation: Array) -> Array:
    """Return quaternions (n, 4) as (w, x, y, z) of a message's (x, y, z, w)."""
    return orientation[:, _INSIDE_ORDER]


class MessageGroup(NamedTuple):
    """Messages of a block with the same texts."""

    form: Layout
    texts: tuple[str, ...]
    rows: slice | Integers
    """Rows of the block's messages."""
    payloads: Bytes
    """(n, size) bytes of the messages."""


def group_by_texts(type_name: str, encoding: str, payloads: Payloads) -> list[MessageGroup]:
    """Return messages in groups with the same texts; the first message is in the first one."""
    texts = texts_of(type_name, encoding, bytes(payloads[0]))
    form = layout(type_name, encoding, texts)
    if not isinstance(payloads, list) and form.matches(payloads):
        return [MessageGroup(form, texts, slice(None), payloads)]
    members: dict[tuple[int, tuple[str, ...]], list[int]] = {}
    messages = [bytes(payload) for payload in payloads]
    for k, message in enumerate(messages):
        key = (len(message), texts_of(type_name, encoding, message))
        members.setdefault(key, []).append(k)
    groups = []
    for (size, texts), rows in members.items():
        form = layout(type_name, encoding, texts)
        whole = len(form.template)
        table = np.frombuffer(b"".join(messages[k] for k in rows), np.uint8).reshape(-1, size)
        if not whole <= size <= whole + 3:
            raise ValueError(f"{size} bytes instead of {whole}")
        fixed_bytes = np.ascontiguousarray(table[:, :whole])
        groups.append(MessageGroup(form, texts, np.array(rows), fixed_bytes))
    return groups


def transcode(block: MessageBlock, source: str, target: str) -> Payloads | None:
    """Return a block's messages in the other encoding; None for types without a layout here.

    :param source: encoding of the block, cdr or ros1.
    :param target: the other one.
    """
    type_name = block.topic.type
    if type_name not in TYPES:
        return None
    try:
        groups = group_by_texts(type_name, source, block.payloads)
    except (ArithmeticError, LookupError, ValueError, struct.error):
        return None
    if len(groups) > 1:
        return None
    form, texts, _, payloads = groups[0]
    target_layout = layout(type_name, target, texts)
    rows = np.empty((len(payloads), len(target_layout.template)), np.uint8)
    rows[:] = np.frombuffer(target_layout.template, np.uint8)
    target_rows, source_rows = rows.view(target_layout.dtype)[:, 0], payloads.view(form.dtype)[:, 0]
    for name in target_layout.dtype.names or ():
        if name in (form.dtype.names or ()):
            target_rows[name] = source_rows[name]
    return rows


_QUANTITIES: Final = {
    "angular_velocity": gate.RATE,
    "linear_acceleration": gate.FORCE,
    "position": gate.POSITION,
    "orientation": gate.ORIENTATION,
    "translation": gate.POSITION,
    "rotation": gate.ORIENTATION,
    "linear": gate.VELOCITY,
    "angular": gate.RATE,
    "magnetic_field": gate.FIELD,
    "fluid_pressure": gate.PRESSURE,
    "temperature": gate.TEMPERATURE,
    "vector": gate.OTHER,
}
_STATED: Final = "orientation_covariance"
"""Field whose first number is negative in an Imu without orientation (REP-145)."""


def fields_of_gate(type_name: str) -> tuple[str, ...]:
    """Return the fields of a type of message that the gate checks; empty for most types.

    The covariance of an orientation only says whether there is one: alone it is not checked.
    """
    names = [name for name, _, _ in fields(type_name)] if type_name in TYPES else []
    checked = tuple(name for name in names if name in (*_QUANTITIES, _STATED))
    return checked if checked != (_STATED,) else ()


class MessageGate:
    """Looks at the messages of one topic, block by block, and counts those that may not pass.

    :param path: path of the bag.
    :param open_to_all: count them, but let them pass.
    :param observe: receives stamps and record times (n,) of the messages that pass [ns].
    """

    def __init__(
        self,
        path: str | Path,
        topic: str,
        open_to_all: bool = False,
        observe: Callable[[Times, Times], object] | None = None,
    ) -> None:
        self.bad = BadRows(f"{path}: {topic}", "message")
        self._open, self._observe, self._row_count = open_to_all, observe, 0

    def good(self, decoded: Decoded) -> Mask | None:
        """Return which of the next messages (n,) pass; None: all of them."""
        numbers = decoded.numbers
        columns = [(_QUANTITIES[name], numbers[name]) for name in numbers if name in _QUANTITIES]
        if _STATED in numbers and "orientation" in numbers:
            unstated = numbers[_STATED][:, :1] < 0.0
            stated = np.where(unstated, (0.0, 0.0, 0.0, 1.0), numbers["orientation"])
            columns = [
                (quantity, stated if quantity is gate.ORIENTATION else v) for quantity, v in columns
            ]
        verdict = gate.Verdict(decoded.t_ns, columns, decoded.nanosecond)
        start, self._row_count = self._row_count, self._row_count + len(decoded.t_ns)
        self.bad.good += int(np.count_nonzero(verdict.good))
        if verdict.good.all():
            return None
        verdict.note(self.bad, np.arange(start, self._row_count), stamps=True)
        return None if self._open else verdict.good

    def passing_messages(self, block: MessageBlock, encoding: str) -> MessageBlock:
        """Return the messages of the next block that pass, unchanged."""
        names = fields_of_gate(block.topic.type)
        if not names:
            return block
        try:
            decoded = decode_block(block, encoding, names)
            good = self.good(decoded)
        except InputError:  # they are not of their type, which a copy of them does not mind
            return block
        if self._observe is not None:
            rows = slice(None) if good is None else good
            self._observe(decoded.t_ns[rows], block.t_ns[rows])
        if good is None:
            return block
        payloads = block.payloads
        if isinstance(payloads, list):
            payloads = [payloads[k] for k in np.flatnonzero(good)]
        else:
            payloads = payloads[good]
        return MessageBlock(block.topic, block.t_ns[good], payloads)

    def settle(self, skipped: Skipped | None, warned: Warned | None) -> None:
        """Report the refused messages, if there are any.

        :param skipped: receives how many messages were left out; None: they are errors.
        :param warned: receives them if they have passed, because the gate is open to all.
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
