# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C, SIGTERM and SIGHUP end a command with status 130, 143 and 129, whenever they come.

Before a command's work begins there is nothing to clean up: the process ends at once. During the
work a signal raises :class:`Interrupted` wherever the program is, so that ``with`` and ``finally``
do what they are there for, and further ones wait a few seconds for them; if a step must not be
broken off, :func:`collected` keeps the signal until it is over.

Python runs a handler between any two instructions, and at some an exception does harm: the first
one of ``__exit__``, which would leave a lock of :mod:`threading` taken for ever, or in a
finaliser, which would swallow it. There the signal comes again a few milliseconds later.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Final, TypeAlias

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_Handler: TypeAlias = Callable[[int, FrameType | None], object]
_Disposition: TypeAlias = _Handler | int | signal.Handlers | None
"""A handler, or what the system does with a signal."""


_received: list[int] = []
_is_raised = False
"""True after :class:`Interrupted` was raised in the main thread."""
_begun = False
"""True if a command's work has begun; it may have ended."""
_AGAIN: Final = 0.005
"""After this time a signal that came at a bad moment comes again [s]."""
_LONGEST_DELAY: Final = 0.5
"""A thread that waits for a lock this long is interrupted all the same [s]."""
_LONGEST_END: Final = 5.0
"""A further signal waits this long for what the first one has begun to clean up [s]."""
_FRAGILE: Final = ("__enter__", "__exit__", "__del__")


class Interrupted(KeyboardInterrupt):
    """A signal ended the command; the arguments say what became of its outputs, line by line."""


def status() -> int:
    """Return the exit status after an interruption, as a shell counts: 128 and the signal."""
    return 128 + (_received[0] if _received else signal.SIGINT)


def interrupted() -> bool:
    """Return whether a signal has ended the work of the command, in the main thread first."""
    return _is_raised


def end_process() -> None:
    """End the process if a signal ended its command, without waiting for threads.

    Nobody uses their results, and compiling cannot be interrupted. A pool of processes has to
    release its semaphores first: such a command ends as usual.
    """
    if _received and "concurrent.futures.process" not in sys.modules:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        os._exit(status())


def end_at_once(program: str) -> None:
    """Let a signal end the process immediately: no work has begun."""

    def end(number: int, _: FrameType | None) -> None:
        if _begun:  # all that is left is to say what came of it
            return
        name = signal.Signals(number).name
        os.write(2, f"{program}: interrupted by {name}; nothing was written\n".encode())
        os._exit(128 + number)

    _handle(end)


def ignore() -> None:
    """Ignore signals after the end of a command: its result stands."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def raised() -> Iterator[None]:
    """Let signals raise :class:`Interrupted` in the main thread."""
    global _begun, _is_raised
    first_time = end = 0.0

    def interrupt(number: int, frame: FrameType | None) -> None:
        global _is_raised
        nonlocal first_time, end
        now = time.monotonic()
        first_time = first_time or now
        if number != signal.SIGALRM:
            _received.append(number)
        if now < end:
            signal.setitimer(signal.ITIMER_REAL, end - now)
        elif _fragile(frame) and now - first_time < _LONGEST_DELAY:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        else:
            end = now + _LONGEST_END
            _is_raised = True
            raise Interrupted

    def swallowed(event: "sys.UnraisableHookArgs") -> None:
        nonlocal end
        if issubclass(event.exc_type, Interrupted):
            end = 0.0
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        else:
            hook(event)

    _begun, _is_raised = True, False
    _received.clear()
    hook = sys.unraisablehook
    previous = _handle(interrupt, (*SIGNALS, signal.SIGALRM))
    if previous:
        sys.unraisablehook = swallowed
    try:
        yield
    except Exception:
        if (
            first_time and not end
        ):  # the signal, on its way to us, has reached other processes already
            raise Interrupted from None
        raise
    finally:
        if previous:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            sys.unraisablehook = hook
        _restore(previous)


def _fragile(frame: FrameType | None) -> bool:
    """Return whether an exception in this frame could leave a lock taken, or be swallowed."""
    return frame is not None and (
        frame.f_code.co_name in _FRAGILE or frame.f_globals.get("__name__") == "threading"
    )


@contextmanager
def blocked() -> Iterator[None]:
    """Keep signals from the processes that begin in a block; one that comes meanwhile waits."""
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def collected() -> Iterator[None]:
    """Keep signals until the block is over, which has to be soon.

    :raises Interrupted: after the block, if one has come and nothing else ended it.
    """
    global _is_raised
    requests: list[int] = []

    def keep(number: int, _: FrameType | None) -> None:
        if number != signal.SIGALRM:  # the repetition of one that came just before
            _received.append(number)
        requests.append(number)

    previous = _handle(keep, (*SIGNALS, signal.SIGALRM))
    try:
        yield
    finally:
        _restore(previous)
    if requests:
        _is_raised = True
        raise Interrupted


def _handle(handler: _Handler, numbers: Iterable[int] = SIGNALS) -> dict[int, _Disposition]:
    """Install a handler; returns those before it, none if this is not the main thread."""
    previous: dict[int, _Disposition] = {}
    try:
        for number in numbers:
            # What nohup lets be ignored stays ignored.
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                previous[number] = signal.signal(number, handler)
    except ValueError:  # not in the main thread: whoever runs this takes care of signals
        return {}
    return previous


def _restore(handlers: dict[int, _Disposition]) -> None:
    """Restore handlers of signals."""
    for number, handler in handlers.items():
        signal.signal(number, handler)
