# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""End of a node's run: any thread may end it, and none dies in silence.

The first end counts; an error overrides it.
"""

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from imu_sim_ros.core.errors import explain

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.task import Future

_Result = TypeVar("_Result")
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
        """Work, and end the node with any error."""
        try:
            self._work()
        except BaseException as error:  # nothing may escape: nobody else watches this thread
            self._fail(error)


class Lifetime:
    """The end of a node's run, with its exit status and its error."""

    def __init__(self, node: "Node") -> None:
        self.status: int | None = None
        """The exit status; None while the run goes on."""
        self.failure: BaseException | None = None
        """Error that ended the run, or None."""
        self._node = node
        self._lock = threading.Lock()

    @property
    def reached(self) -> bool:
        """True if the run is over."""
        return self.status is not None

    def finish(self, status: int = 0) -> None:
        """End the run."""
        self._end(status, None)

    def fail(self, error: BaseException, status: int | None = None) -> None:
        """End the run with an error.

        :param status: exit status; None: that of the error's kind.
        """
        self._end(explain(error)[1] if status is None else status, error)

    def in_thread(self, name: str, work: Callable[[], _Result]) -> "Future":
        """Run a slow function in a thread of its own; callbacks may ``await`` the result."""
        from rclpy.task import Future

        future: Future = Future()

        def run() -> None:
            future.set_result(work())
            self._wake()

        SupervisedThread(name, run, self.fail).start()
        return future

    def _end(self, status: int, error: BaseException | None) -> None:
        """End the run once; an error counts also after the end."""
        with self._lock:
            # An error while files are being closed is reported although the run was over.
            if self.failure is not None or (self.reached and error is None):
                return
            self.status, self.failure = status, error
        self._wake()

    def _wake(self) -> None:
        """Wake the executor from any wait."""
        executor = self._node.executor
        if executor is not None:
            executor.create_task(_ignore_signal)


def _ignore_signal() -> None:
    """Ignore a signal."""
