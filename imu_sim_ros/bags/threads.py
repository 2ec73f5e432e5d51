# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Work in threads, in order. Code that releases the interpreter uses the other cores.

That is so for checksums, compression, writing, random numbers and most of NumPy's loops. All
queues are without locks in Python: an exception of a signal's handler, which runs in the main
thread, must not leave one taken.
"""

import os
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from typing import TYPE_CHECKING, Final, Generic, TypeAlias, TypeVar

from imu_sim_ros.terminal.progress import current_watcher, watch_thread

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

_T = TypeVar("_T")
_Made = TypeVar("_Made")

_Result: TypeAlias = tuple[_Made] | BaseException
"""Result of the work, or the exception that ended it."""

_PREFETCHED: Final = 2
"""Number of elements that a thread computes ahead."""


def core_count() -> int:
    """Return how many processor cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def prefetch(items: Iterable[_T]) -> Generator[_T, None, None]:
    """Yield items that are made in a thread of their own, a few ahead of the one that is used."""
    results: SimpleQueue[_Result[_T] | None] = SimpleQueue()  # None: there are no more
    room: SimpleQueue[bool] = SimpleQueue()
    for _ in range(_PREFETCHED):
        room.put(True)
    stopped = False

    def work() -> None:
        """Compute the items until they or the reader end; wait while enough are ahead."""
        try:
            for item in items:
                if not room.get() or stopped:  # False: the reader has ended
                    return
                results.put((item,))
            results.put(None)
        except BaseException as error:
            results.put(error)

    worker = threading.Thread(target=work, daemon=True)
    worker.start()
    try:
        while (outcome := results.get()) is not None:
            if isinstance(outcome, BaseException):
                raise outcome
            room.put(True)
            yield outcome[0]
    finally:
        stopped = True
        room.put(False)
        worker.join()


@contextmanager
def thread_pool(count: int) -> "Iterator[ThreadPoolExecutor]":
    """Yield a pool of threads; tasks that have not begun at the end are cancelled.

    After an interruption nothing is waited for: what is under way ends itself
    (:func:`~imu_sim_ros.terminal.progress.check_interrupted`).
    """
    from concurrent.futures import ThreadPoolExecutor  # most runs have no work for them

    pool = ThreadPoolExecutor(count, "jobs", watch_thread, (current_watcher(),))
    try:
        yield pool
    finally:
        pool.shutdown(wait=not current_watcher().interrupted(), cancel_futures=True)


class Pipeline(Generic[_T, _Made]):
    """Items are worked on in several threads, and the results used in one, in the items' order.

    After an error nothing more is used, and the error is raised where the next item is given.
    """

    def __init__(
        self, make: Callable[[_T], _Made], use: Callable[[_T, _Made], None], workers: int
    ) -> None:
        """Start the threads.

        :param make: may run for several items at a time.
        :param use: is called with each item and what was made of it, one after the other.
        :param workers: number of threads, at least one.
        """
        self._make, self._use = make, use
        self._items: SimpleQueue[tuple[_T, SimpleQueue[_Result[_Made]]] | None] = SimpleQueue()
        """Items to work on, each with a queue for the result; None ends a thread."""
        self._order: SimpleQueue[
            tuple[_T, SimpleQueue[_Result[_Made]]] | SimpleQueue[None] | None
        ] = SimpleQueue()
        """Items with their queues in order; a lone queue receives None when all before it are
        used."""
        self._places: SimpleQueue[None] = SimpleQueue()
        for _ in range(2 * workers + 2):
            self._places.put(None)
        self.error: BaseException | None = None
        targets = [self._make_all] * workers + [self._use_all]
        self._threads = [threading.Thread(target=target, daemon=True) for target in targets]
        for thread in self._threads:
            thread.start()

    def give(self, item: _T) -> None:
        """Hand over the next item; waits while too many are under way.

        :raises BaseException: what ended the work on an item before.
        """
        self._places.get()
        if self.error is not None:
            raise self.error
        outcome: SimpleQueue[_Result[_Made]] = SimpleQueue()
        # In this order: what is interrupted in between is lost, and nobody waits for it.
        self._items.put((item, outcome))
        self._order.put((item, outcome))

    def wait(self) -> None:
        """Wait until all items are used.

        :raises BaseException: what ended the work on an item.
        """
        used: SimpleQueue[None] = SimpleQueue()
        self._order.put(used)
        used.get()
        if self.error is not None:
            raise self.error

    def close(self) -> None:
        """Wait until all items are used, and end the threads; an error stays in ``error``."""
        self._order.put(None)
        for _ in self._threads:
            self._items.put(None)
        for thread in self._threads:
            thread.join()

    def _make_all(self) -> None:
        """Work on items until the end; runs in each of the threads."""
        while (job := self._items.get()) is not None:
            item, outcome = job
            try:
                outcome.put((self._make(item),))
            except BaseException as error:
                outcome.put(error)

    def _use_all(self) -> None:
        """Use the results in the items' order; runs in one thread."""
        while (job := self._order.get()) is not None:
            if isinstance(job, SimpleQueue):
                job.put(None)
                continue
            item, outcome = job
            work_result = outcome.get()
            try:
                if isinstance(work_result, BaseException):
                    raise work_result
                if self.error is None:
                    self._use(item, work_result[0])
            except BaseException as failure:
                self.error = self.error or failure
            self._places.put(None)
