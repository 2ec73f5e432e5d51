# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C, SIGTERM and SIGHUP end a command with status 130, 143 and 129, whenever they come.

Before a command's work begins there is nothing to clean up: the process ends at once. During the
work a signal raises :class:`Interrupted` wherever the program is, so that ``with`` and ``finally``
do what they are there for; where a step must not be broken off, :func:`collected` keeps the signal
until it is over.
"""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_Handler = Callable[[int, FrameType | None], Any]


_received: list[int] = []


class Interrupted(KeyboardInterrupt):
    """A signal ended the command; the arguments say what became of its outputs, line by line."""


def status() -> int:
    """Return the exit status after an interruption, as a shell counts: 128 and the signal."""
    return 128 + (_received[0] if _received else signal.SIGINT)


def end_at_once(program: str) -> None:
    """Let a signal end the process on the spot: nothing was begun yet."""

    def end(number: int, _: FrameType | None) -> None:
        name = signal.Signals(number).name
        os.write(2, f"{program}: interrupted by {name}; nothing was written\n".encode())
        os._exit(128 + number)

    _handle(end)


def ignore() -> None:
    """Let no signal change the result of a command that is over."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def raised() -> Iterator[None]:
    """Let signals raise :class:`Interrupted` in the main thread."""

    def interrupt(number: int, _: FrameType | None) -> None:
        _received.append(number)
        raise Interrupted

    _received.clear()
    before = _handle(interrupt)
    try:
        yield
    finally:
        _restore(before)


@contextmanager
def collected() -> Iterator[list[int]]:
    """Keep signals: yields the list into which their numbers go.

    The block has to end soon after the first one, and its owner raises :class:`Interrupted` then.
    """
    requests: list[int] = []

    def keep(number: int, _: FrameType | None) -> None:
        _received.append(number)
        requests.append(number)

    before = _handle(keep)
    try:
        yield requests
    finally:
        _restore(before)


def _handle(handler: _Handler) -> dict[int, Any]:
    """Install a handler; returns those before it, none where this is not the main thread."""
    before: dict[int, Any] = {}
    try:
        for number in SIGNALS:
            # What nohup lets be ignored stays ignored.
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handler)
    except ValueError:  # not in the main thread: whoever runs this takes care of signals
        return {}
    return before


def _restore(handlers: dict[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
