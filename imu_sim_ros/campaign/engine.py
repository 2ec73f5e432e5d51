# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The embedded engine: the runs of a campaign over the processes of one machine.

A task is some seeds of one cell with all their estimators. A worker that dies breaks the pool; the
tasks that were under way then run one at a time, so that only the one that kills its worker is
blamed.
"""

import contextlib
import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Final

import imu_sim_ros
from imu_sim_ros.campaign.cells import Cell
from imu_sim_ros.campaign.plan import Plan
from imu_sim_ros.config import CommandEstimator
from imu_sim_ros.errors import ImuSimError

if TYPE_CHECKING:
    from imu_sim_ros.campaign.runs import CellRuns

Row = dict[str, Any]

_THREADS: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_WAITING: Final = 2
"""Tasks queued for each process."""


@dataclass(frozen=True)
class Task:
    """Some seeds of one cell."""

    cell: Cell
    seeds: tuple[int, ...]
    estimators: tuple[str, ...]
    deaths: int = 0
    """Number of workers that died while executing it."""


_last: "list[CellRuns]" = []


def work(plan: Plan, task: Task, folder: Path) -> list[Row]:
    """Make the runs of a task; data shared by the seeds of a cell are kept for the next task."""
    from imu_sim_ros.campaign.runs import CellRuns

    runs = _last[0] if _last else None
    if runs is None or runs.cell.name != task.cell.name or runs.plan != plan:
        try:
            runs = CellRuns(plan, task.cell)
        except ImuSimError as error:
            return failed(plan, task, f"failed: {error.problems[0]}")
        _last[:] = [runs]
    return list(runs.rows(task.seeds, task.estimators, folder))


def failed(plan: Plan, task: Task, status: str) -> list[Row]:
    """Return the rows of a task that failed as a whole."""
    try:
        parameters, rig = plan.simulation(task.cell), plan.rig(task.cell)
        digests = {name: plan.digest(parameters, rig, name) for name in task.estimators}
    except ImuSimError:
        digests = {}
    return [
        {
            "cell": task.cell.name,
            "seed": seed,
            "estimator": name,
            "status": status,
            **task.cell.values,
            "digest": digests.get(name, ""),
            "version": imu_sim_ros.__version__,
        }
        for seed in task.seeds
        for name in task.estimators
    ]


_plan: Plan
_folder: Path


def _begin(plan: Plan, folder: Path) -> None:
    """Prepare a worker: Ctrl-C is handled by the main process."""
    global _plan, _folder
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)
    _plan, _folder = plan, folder


def _end(number: int, frame: object) -> None:
    """End a worker at once, with the program that it runs."""
    command = sys.modules.get("imu_sim_ros.campaign.estimators.command")
    if command is not None:
        command.end_programs()
    os._exit(128 + number)


def _work(task: Task) -> list[Row]:
    """Make the runs of a task in a worker of the pool."""
    return work(_plan, task, _folder)


def run(
    plan: Plan,
    tasks: Iterable[Task],
    folder: Path,
    workers: int,
) -> Generator[list[Row], None, None]:
    """Yield the rows of each task as they come.

    One worker with built-in estimators is this process: no other is started. Programs always run
    under a worker of their own, which inherits all processes that they leave behind.
    """
    built_in = not any(isinstance(one, CommandEstimator) for one in plan.estimators.values())
    if workers == 1 and built_in:
        for task in tasks:
            yield work(plan, task, folder)
        return
    yield from _Pool(plan, folder, workers).run(iter(tasks))


class _Pool:
    """A process pool that is recreated when one of its processes dies."""

    def __init__(self, plan: Plan, folder: Path, workers: int) -> None:
        self._plan, self._folder, self._workers = plan, folder, workers
        self._suspects: deque[Task] = deque()
        self._running: dict[Future[list[Row]], Task] = {}
        # Waiting for it is interrupted at once by a signal; a lock of Python's would be held on to.
        self._done: SimpleQueue[Future[list[Row]]] = SimpleQueue()
        self._pool: ProcessPoolExecutor | None = None

    def run(self, tasks: Iterator[Task]) -> Generator[list[Row], None, None]:
        try:
            while self._fill(tasks):
                done = self._done.get()
                if done in self._running:  # else it belongs to a pool that has broken
                    yield from self._collect(done)
        finally:
            self._end()

    def _fill(self, tasks: Iterator[Task]) -> bool:
        """Keep the processes busy; one task at a time while suspects wait."""
        if self._suspects:
            if not self._running:
                self._submit(self._suspects.popleft())
            return True
        while len(self._running) < self._workers * _WAITING:
            task = next(tasks, None)
            if task is None:
                break
            self._submit(task)
        return bool(self._running)

    def _submit(self, task: Task) -> None:
        if self._pool is None:
            with _environment():
                self._pool = ProcessPoolExecutor(
                    self._workers,
                    multiprocessing.get_context("spawn"),
                    _begin,
                    (self._plan, self._folder),
                )
                future = self._pool.submit(_work, task)
        else:
            with _environment():
                future = self._pool.submit(_work, task)
        self._running[future] = task
        future.add_done_callback(self._done.put)

    def _collect(self, done: Future[list[Row]]) -> Generator[list[Row], None, None]:
        task = self._running.pop(done)
        try:
            rows = done.result()
        except BrokenProcessPool:
            yield from self._died([task, *self._running.values()])
        else:
            yield rows

    def _died(self, tasks: list[Task]) -> Generator[list[Row], None, None]:
        alone = len(tasks) == 1
        self._running.clear()
        self._end()
        for task in tasks:
            # Only a task that was alone is known to have killed its worker.
            task = replace(task, deaths=task.deaths + alone)
            if task.deaths > self._plan.options.retries:
                yield failed(self._plan, task, "failed: the worker process died")
            elif alone and len(task.seeds) > 1:
                self._suspects.extend(replace(task, seeds=(seed,), deaths=0) for seed in task.seeds)
            else:
                self._suspects.append(task)

    def _end(self) -> None:
        if self._pool is None:
            return
        processes = list((getattr(self._pool, "_processes", None) or {}).values())
        self._pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            with contextlib.suppress(OSError, ValueError):
                process.terminate()
        for process in processes:
            process.join(2.0)
        self._pool = None


@contextlib.contextmanager
def _environment() -> Iterator[None]:
    """Have the processes that are started here use one thread each."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
