# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Threads whose failure is the node's: any exception is reported and ends the node."""

import threading
from collections.abc import Callable

Fail = Callable[[BaseException], None]
"""Receives a thread's exception, in that thread; the node ends with it."""


class SupervisedThread:
    """A thread that cannot die in silence.

    It is a daemon: a signal may end the program before there is a node to close it.
    """

    def __init__(self, name: str, work: Callable[[], None], fail: Fail) -> None:
        """Set up the thread; :meth:`start` lets it run.

        :param name: task of the thread, in one word.
        :param work: its work; returning from it is the thread's regular end.
        :param fail: receives the exception that ended the work instead.
        """
        self._work, self._fail = work, fail
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def join(self, timeout: float | None = None) -> bool:
        """Wait for the end of the thread, at most ``timeout`` seconds; return whether it has ended.

        A thread that was never started has ended, and a thread does not wait for itself.
        """
        if self._thread.ident is None:
            return True
        if self._thread is not threading.current_thread():
            self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            self._work()
        except BaseException as error:  # nothing may escape: nobody else watches this thread
            self._fail(error)
