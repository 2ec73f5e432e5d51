# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C, SIGTERM and SIGHUP end a command with status 130, 143 and 129, whenever they come.

Before a command's work begins there is nothing to clean up: the process ends at once. During the
work a signal raises :class:`Interrupted` wherever the program is, so that ``with`` and ``finally``
clean up; further signals wait a few seconds for that. :func:`delay_signals` keeps signals until a
step that must not be broken off is over.

Python runs a handler between any two instructions, and at some an exception does harm: at the first
one of ``__exit__`` it would leave a lock of :mod:`threading` taken for ever, and a finaliser would
swallow it. There the handler sends itself the signal again a few milliseconds later.
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
"""Numbers of the signals since the command's work began."""
_is_raised = False
"""True after :class:`Interrupted` was raised in the main thread."""
_begun = False
"""True if a command's work has begun; it may have ended."""
_AGAIN: Final = 0.005
"""Time after which a signal at a fragile instruction is repeated [s]."""
_LONGEST_DELAY: Final = 0.5
"""Time after which a signal is no longer delayed, even if a thread waits for a lock [s]."""
_LONGEST_END: Final = 5.0
"""Longest time that further signals wait for the clean-up after the first one [s]."""
_FRAGILE: Final = ("__enter__", "__exit__", "__del__")
"""Names of functions in which an exception does harm."""


class Interrupted(KeyboardInterrupt):
    """A signal ended the command; the arguments say what became of its outputs, line by line."""


def status() -> int:
    """Return the exit status after an interruption, as a shell counts: 128 and the signal."""
    return 128 + (_received[0] if _received else signal.SIGINT)


def is_interrupted() -> bool:
    """Return whether a signal has ended the work of the command."""
    return _is_raised


def end_process() -> None:
    """End the process if a signal ended its command, without waiting for its threads.

    Their results are not needed, and compilation cannot be interrupted. A pool of processes has to
    release its semaphores first: a command with one ends as usual.
    """
    if _received and "concurrent.futures.process" not in sys.modules:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        os._exit(status())


def end_at_once(program: str) -> None:
    """Let signals end the process immediately until the work begins."""

    def end(number: int, _: FrameType | None) -> None:
        if _begun:  # the work is over, and its result is being printed
            return
        name = signal.Signals(number).name
        os.write(2, f"{program}: interrupted by {name}; nothing was written\n".encode())
        os._exit(128 + number)

    _handle(end)


def ignore_signals() -> None:
    """Ignore signals from now on: the command has ended, and its outputs are complete."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def raise_signals() -> Iterator[None]:
    """Let signals raise :class:`Interrupted` in the main thread during a block.

    A signal within code that must not be broken off is tried again by a timer. While an exception
    cleans up, further signals wait. An exception that a destructor swallowed is raised again.
    """
    global _begun, _is_raised
    # Time of the first signal, and that until which the clean-up may last [s]; 0: there is none.
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
        # A signal that is still delayed here may already have ended other processes of the job.
        if first_time and not end:
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
def block_signals() -> Iterator[None]:
    """Keep signals from the processes that begin in a block; one that comes meanwhile waits."""
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def delay_signals() -> Iterator[None]:
    """Delay signals until the block is over, which must be short.

    :raises Interrupted: after the block, if a signal came and no other exception ended it.
    """
    global _is_raised
    requests: list[int] = []

    def keep(number: int, _: FrameType | None) -> None:
        if number != signal.SIGALRM:  # which repeats a signal that is counted already
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
    """Install a handler; return the previous ones by signal, none outside the main thread."""
    previous: dict[int, _Disposition] = {}
    try:
        for number in numbers:
            # A hang-up that nohup ignores stays ignored.
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                previous[number] = signal.signal(number, handler)
    except ValueError:  # not in the main thread, which handles signals itself
        return {}
    return previous


def _restore(handlers: dict[int, _Disposition]) -> None:
    """Restore handlers of signals."""
    for number, handler in handlers.items():
        signal.signal(number, handler)
