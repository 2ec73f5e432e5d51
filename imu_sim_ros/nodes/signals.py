# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C, SIGTERM and SIGHUP end a node with status 0, from the first moment of its process.

A thread of its own learns of them through the pipe into which Python writes a signal's number: the
main thread may be waiting in the middleware, and code that is closing a file must not be
interrupted.
"""

import os
import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Final

_LONGEST_START: Final = 0.8
"""Time after which a node that does not exist has nothing to close [s]."""


class EndSignals:
    """Waits for the signals that end the process.

    Before :meth:`begin` there is nothing to close, and the process ends at once. After it a
    signal is kept until :meth:`deliver_to` states what ends the run; later signals change nothing.

    :param is_final: the process ends with this watch, and no signal changes its exit status then.
    """

    def __init__(self, is_final: bool = False) -> None:
        self._last = is_final
        numbers = [signal.SIGINT, signal.SIGTERM]
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # nohup has it ignored
            numbers.append(signal.SIGHUP)
        self.arrived = False
        self._begun = False
        self._end: Callable[[], None] | None = None
        self._known = threading.Event()
        self._lock = threading.Lock()
        self._wake_reader, self._wake_writer = os.pipe()
        os.set_blocking(self._wake_writer, False)
        self._wakeup = signal.set_wakeup_fd(self._wake_writer, warn_on_full_buffer=False)
        self._handlers = {number: signal.signal(number, _ignore_signal) for number in numbers}
        self._thread = threading.Thread(target=self._wait, name="signals", daemon=True)
        self._thread.start()

    def begin(self) -> None:
        """Close files and publishers at the next signal, in place of ending at once."""
        self._begun = True

    def deliver_to(self, end: Callable[[], None]) -> None:
        """Call a function at the first signal, at once if it has arrived already."""
        with self._lock:
            self._end = end
            self._known.set()
            arrived = self.arrived
        if arrived:
            end()

    def close(self) -> None:
        """End the thread and restore the signals' former effect, or none if the process ends."""
        global _signals
        _signals = None
        for number, handler in self._handlers.items():
            signal.signal(number, signal.SIG_IGN if self._last else handler)
        signal.set_wakeup_fd(self._wakeup)
        os.close(self._wake_writer)
        self._known.set()
        self._thread.join()
        os.close(self._wake_reader)

    def _wait(self) -> None:
        """Call the handlers of signals until the pipe is closed; runs in a thread."""
        while number := os.read(self._wake_reader, 1):  # empty: the pipe was closed
            if number[0] not in self._handlers:
                continue
            if not self._begun:
                os._exit(0)
            with self._lock:
                is_first, self.arrived = not self.arrived, True
                end = self._end
            if is_first and end is not None:
                end()
            elif not self._known.wait(_LONGEST_START):
                os._exit(0)


def _ignore_signal(number: int, frame: FrameType | None) -> None:
    """Do nothing: the signal does not end the process, and its number goes into the pipe."""


_signals: EndSignals | None = None


def watch(is_final: bool = False) -> EndSignals:
    """Return the process's watch over its signals; it begins with the first call.

    :param is_final: True if nothing but the process's end comes after; the first call decides.
    """
    global _signals
    if _signals is None:
        _signals = EndSignals(is_final)
    return _signals
