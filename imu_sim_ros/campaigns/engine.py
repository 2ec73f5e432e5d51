# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The engine of a campaign: its tasks over an executor of ``concurrent.futures``.

A task is some seeds of one cell with all their estimators. The executor is this process itself
(:class:`Inline`), processes of this machine (:class:`Processes`) or a Dask cluster's
(``dask.distributed``, an extra). Runs whose worker died run again, each in a task of its own, so
that only the one that kills its worker is blamed.
"""

import contextlib
import functools
import gc
import logging
import multiprocessing
import os
import signal
import socket
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Final

import imu_sim_ros
from imu_sim_ros.campaigns.cells import Cell
from imu_sim_ros.campaigns.parameters import CommandEstimator
from imu_sim_ros.campaigns.plan import Plan, list_missing_files
from imu_sim_ros.campaigns.results import SCENARIO, Row
from imu_sim_ros.core.errors import ImuSimError, InputError, MachineError, MissingDependencyError
from imu_sim_ros.core.spelling import argument, argument_prefix
from imu_sim_ros.terminal.signals import SIGNALS, block_signals

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

    from imu_sim_ros.campaigns.runs import CellRuns

_THREADS: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_ENVIRONMENT: Final = {
    **dict.fromkeys(_THREADS, "1"),
    # The next run needs the arrays that a run frees: without 64 MB kept by glibc, a good part of
    # its time would be page faults.
    "MALLOC_TRIM_THRESHOLD_": str(1 << 26),
}
"""Variables of the worker processes."""
_TASKS_PER_THREAD: Final = 4
"""Tasks that a cluster's scheduler holds for each thread: enough that none waits, and few enough
that its memory does not grow with the campaign."""
_CONNECT_S: Final = 10.0
"""Longest time to connect to a scheduler [s]."""
_DASHBOARD_PORT: Final = 8787
"""Port of Dask's page, if it is free."""


@dataclass(frozen=True)
class Task:
    """Some seeds of one cell."""

    cell: Cell
    seeds: tuple[int, ...]
    estimators: tuple[str, ...]
    deaths: int = 0
    """Number of workers that died during this task."""

    @property
    def is_single_run(self) -> bool:
        """True for a single run."""
        return len(self.seeds) == len(self.estimators) == 1

    def split(self) -> "Iterator[Task]":
        """Yield a task for each run, after the worker that had them all has died."""
        return (
            replace(self, seeds=(seed,), estimators=(name,), deaths=self.deaths + 1)
            for seed in self.seeds
            for name in self.estimators
        )


Engine = Callable[[Plan, Iterable[Task], Path], Generator[list[Row], None, None]]
"""Generator function of the rows of each task, as they arrive."""


_cell_cache: "list[CellRuns]" = []


def work(plan: Plan, task: Task, folder: Path) -> list[Row]:
    """Make the runs of a task; data shared by the seeds of a cell are kept for the next task."""
    from imu_sim_ros.campaigns.runs import CellRuns

    runs = _cell_cache[0] if _cell_cache else None
    if runs is None or runs.cell.name != task.cell.name or runs.plan != plan:
        try:
            runs = CellRuns(plan, task.cell)
        except ImuSimError as error:
            return failure_rows(plan, task, f"failed: {error.problems[0]}")
        _cell_cache[:] = [runs]
    return list(runs.rows(task.seeds, task.estimators, folder))


def failure_rows(plan: Plan, task: Task, status: str) -> list[Row]:
    """Return the rows of a task that failed as a whole."""
    try:
        parameters = plan.simulation(task.cell)
        digests = {name: plan.digest(parameters, name) for name in task.estimators}
        scenarios = {name: plan.scenario(parameters, name) for name in task.estimators}
    except ImuSimError:
        digests, scenarios = {}, {}
    return [
        {
            "cell": task.cell.name,
            "seed": seed,
            "estimator": name,
            "status": status,
            **task.cell.values,
            "align": plan.alignment(name),
            SCENARIO: scenarios.get(name, ""),
            "digest": digests.get(name, ""),
            "version": imu_sim_ros.__version__,
        }
        for seed in task.seeds
        for name in task.estimators
    ]


def local(workers: int) -> Engine:
    """Return the engine of this machine.

    One worker with built-in estimators is this process: no other is started. Programs always run
    under a worker of their own, which inherits all processes that they leave behind.
    """

    def start(plan: Plan, todo: Iterable[Task], folder: Path) -> Generator[list[Row], None, None]:
        programs = any(
            isinstance(estimator, CommandEstimator) for estimator in plan.estimators.values()
        )
        executor = Processes() if programs or workers > 1 else Inline()
        with contextlib.closing(executor):
            pool = _Workers(executor, lambda: workers, BrokenProcessPool, plan.options.retries)
            yield from _run(plan, todo, folder, pool)

    return start


def dask(client: "Client", worker_timeout: float = 60.0) -> Engine:
    """Return the engine of a cluster.

    :param worker_timeout: longest wait for a cluster that has lost all its workers [s].
    """

    def start(plan: Plan, todo: Iterable[Task], folder: Path) -> Generator[list[Row], None, None]:
        from distributed.scheduler import KilledWorker

        last_worker_s = time.monotonic()

        def width() -> int:
            nonlocal last_worker_s
            last_worker_s = time.monotonic()  # a result has come
            return _TASKS_PER_THREAD * (sum(client.nthreads().values()) or 1)

        def check() -> None:
            """Notice that no worker is left: the scheduler would keep the tasks for ever."""
            nonlocal last_worker_s
            if client.nthreads():
                last_worker_s = time.monotonic()
            elif time.monotonic() - last_worker_s > worker_timeout:
                since = f"the cluster has had no worker for {worker_timeout:g} s"
                raise MachineError(f"{since}; continue with {argument('resume', True)}")

        executor = client.get_executor(pure=False, retries=plan.options.retries)
        try:
            # The scheduler blames all tasks that the worker had; alone, one has its attempts.
            restarts = max(plan.options.retries, 1)
            pool = _Workers(
                executor=executor,
                width=width,
                death=KilledWorker,
                restarts=restarts,
                isolate_suspects=True,
                check=check,
            )
            yield from _run(plan, todo, folder, pool)
        except (OSError, CancelledError):  # of the connection: a worker's errors are in its rows
            raise MachineError(
                "the connection to the scheduler was lost; continue with "
                f"{argument('resume', True)}"
            ) from None

    return start


@dataclass(frozen=True)
class _Workers:
    """Workers of a campaign; tasks of a worker that died are repeated."""

    executor: Executor
    width: Callable[[], int]
    """Return the number of tasks that the executor shall hold."""
    death: type[Exception]
    """Raised by the result of a task whose worker died."""
    restarts: int
    """Number of restarts of a run after its worker died."""
    isolate_suspects: bool = False
    """The tasks of a worker that died run again while no other does: the executor does not tell
    which of several killed it."""
    check: Callable[[], None] = lambda: None
    """Called every second without a result; raises if none can come any more."""


def _run(
    plan: Plan, todo: Iterable[Task], folder: Path, workers: _Workers
) -> Generator[list[Row], None, None]:
    """Yield the rows of each task as they come.

    Tasks whose worker process died are suspects: they are split and tried again, one at a time if
    the executor does not tell which of several killed it, so that the run that kills is found.

    :param todo: tasks in the order in which they begin.
    :param folder: folder of the campaign.
    :param workers: executor of the tasks, and how it deals with deaths.
    """
    # The plan is sent with each task: a copy kept by a worker would be lost with it.
    task_plan = replace(plan, seeds=plan.seeds[:1])
    remaining, suspects = iter(todo), deque[Task]()
    upcoming = next(remaining, None)
    running: dict[Future[list[Row]], Task] = {}
    done: SimpleQueue[Future[list[Row]]] = SimpleQueue()

    def submit(task: Task) -> None:
        future = workers.executor.submit(work, task_plan, task, folder)
        running[future] = task
        future.add_done_callback(done.put)

    isolated = workers.isolate_suspects
    while True:
        width = workers.width()
        while suspects and (not running if isolated else len(running) < width):
            submit(suspects.popleft())
        while upcoming is not None and len(running) < width and not (isolated and suspects):
            submit(upcoming)
            upcoming = next(remaining, None)
        if not running:
            return
        future = None
        while future is None:
            try:
                future = done.get(timeout=1.0)
            except Empty:
                workers.check()
        task = running.pop(future)
        try:
            rows = future.result()
        except workers.death:
            if task.is_single_run and task.deaths >= workers.restarts:
                yield failure_rows(plan, task, "failed: the worker process died")
            else:
                suspects.extend(task.split())
        else:
            yield rows


class Inline(Executor):
    """This process: a task is executed when it is submitted."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **names: Any) -> Future[Any]:
        """Return the result; errors are raised at once."""
        future: Future[Any] = Future()
        future.set_result(function(*args, **names))
        return future

    def close(self) -> None:
        """Do nothing: nothing runs."""


class Processes(Executor):
    """Worker processes of this machine, each a pool of its own, as many as tasks at a time.

    A worker that dies breaks its pool, and with it the one task that it executed.
    """

    def __init__(self) -> None:
        """Initialise without processes."""
        self._idle: deque[ProcessPoolExecutor] = deque()
        self._pools: set[ProcessPoolExecutor] = set()

    def submit(self, function: Callable[..., Any], /, *args: Any, **names: Any) -> Future[Any]:
        """Call a function in an idle worker, or in a new one."""
        while True:
            pool = self._idle.popleft() if self._idle else self._new()
            try:
                with _environment():
                    future = pool.submit(function, *args, **names)
            except BrokenProcessPool:  # it died while it was idle
                self._pools.discard(pool)
                continue
            future.add_done_callback(functools.partial(self._release, pool))
            return future

    def _new(self) -> ProcessPoolExecutor:
        """Start a process for one run at a time."""
        with _environment():  # the first one starts the tracker of semaphores
            pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _begin)
        self._pools.add(pool)
        return pool

    def _release(self, pool: ProcessPoolExecutor, future: Future[Any]) -> None:
        """Keep a process for the next run, unless it is broken."""
        if future.cancelled() or isinstance(future.exception(), BrokenProcessPool):
            self._pools.discard(pool)
        else:
            self._idle.append(pool)

    def close(self) -> None:
        """End the workers at once, with the programs that they run.

        The threads that wait for them end too. One that is left to the interpreter's end may close
        its pipe while ``concurrent.futures`` writes into it there (Python 3.11: OSError).
        """
        pools = list(self._pools)
        processes = [process for pool in pools for process in (pool._processes or {}).values()]
        for process in processes:
            with contextlib.suppress(OSError, ValueError):
                process.terminate()
        for process in processes:
            with contextlib.suppress(OSError, ValueError):
                process.join(2.0)
                process.kill()
        for pool in pools:
            pool.shutdown(wait=True, cancel_futures=True)


def _begin() -> None:
    """Prepare a worker: Ctrl-C is handled by the main process, whose end is that of the worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # nohup has it ignored
        signal.signal(signal.SIGHUP, _end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End a worker when the main process has ended, also by ``kill -9``.

    The queue of tasks does not end then, since each worker holds both ends of its pipe.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    _end(signal.SIGKILL)


def _end(number: int, frame: object = None) -> None:
    """End a worker at once, with the program that it runs."""
    command = sys.modules.get("imu_sim_ros.campaigns.command_estimator")
    if command is not None:
        command.end_programs()
    os._exit(128 + number)


@contextmanager
def _environment() -> Iterator[None]:
    """Set the environment of the processes that are started here, with signals blocked.

    A signal that arrives meanwhile is delivered afterwards: between the start of a process and its
    registration it would leave a process that nobody ends.
    """
    previous = {name: os.environ.get(name) for name in _ENVIRONMENT}
    with block_signals():
        os.environ.update(_ENVIRONMENT)
        try:
            yield
        finally:
            for name, value in previous.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value


@contextmanager
def client(scheduler: str | None, workers: int, worker_timeout: float = 60.0) -> Iterator["Client"]:
    """Connect to a scheduler, or start a cluster of processes on this machine.

    :param scheduler: ``tcp://host:port``; None: a local cluster with its dashboard.
    :param worker_timeout: longest wait for a worker of the scheduler [s].
    :raises MissingDependencyError: if dask.distributed is not installed.
    :raises InputError: if no scheduler answers, or no worker joins it.
    """
    try:
        from dask import config as dask_settings
        from distributed import Client, LocalCluster, TimeoutError
    except ImportError:
        raise MissingDependencyError(
            "Dask is not installed: pip install 'distributed', or apt install python3-distributed"
        ) from None
    prefixes = ("distributed", "tornado")
    for name in [name for name in logging.root.manager.loggerDict if name.startswith(prefixes)]:
        # Its tracebacks of lost connections; what they cost is in the results.
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if scheduler is None:
        os.environ.update(_ENVIRONMENT)
        with (
            # A busy machine takes its time to start a worker; one that is late is given up.
            dask_settings.set({"distributed.comm.timeouts.connect": f"{worker_timeout}s"}),
            LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=_dashboard()
            ) as cluster,
            Client(cluster) as dask_client,
        ):
            try:
                yield dask_client
            except KeyboardInterrupt:
                _kill(cluster)
                raise
        return
    problem = None
    try:
        dask_client = Client(scheduler, timeout=_CONNECT_S)
    except (OSError, ValueError) as error:
        problem = f"{argument_prefix('scheduler', scheduler)}: {error}"
    if problem is not None:
        # A client that has failed ends when it is collected; if another one is beginning, it waits
        # for a lock that its own thread holds.
        gc.collect()
        raise InputError(problem)
    with dask_client:
        try:
            dask_client.wait_for_workers(1, timeout=worker_timeout)
        except TimeoutError:
            raise InputError(
                f"{argument_prefix('scheduler', scheduler)}: no worker has joined within "
                f"{worker_timeout:g} s"
            ) from None
        yield dask_client


def check_workers(client: "Client", plan: Plan) -> None:
    """Refuse workers that would fail every run: each has to have this package and the programs.

    :raises InputError: with a line for each worker and what is missing there.
    """
    # By name: what a worker without the package is sent must not be of the package.
    versions = client.run(eval, "__import__('imu_sim_ros').__version__", on_error="return")
    problems = []
    for worker, version in versions.items():
        if isinstance(version, ImportError):
            problems.append(f"worker {worker}: imu_sim_ros is not installed there ({version})")
        elif isinstance(version, BaseException):
            problems.append(f"worker {worker}: imu_sim_ros cannot be loaded there: {version}")
        elif version != imu_sim_ros.__version__:
            problems.append(
                f"worker {worker}: has imu_sim_ros {version}; this is {imu_sim_ros.__version__}"
            )
    if not problems:
        for worker, lines in client.run(list_missing_files, plan, on_error="return").items():
            lines = [str(lines)] if isinstance(lines, BaseException) else lines
            problems += [f"worker {worker}: {line}" for line in lines]
    if problems:
        raise InputError(problems)


def dashboard(client: "Client") -> str | None:
    """Return the address of the scheduler's dashboard; None: it has none."""
    has_dashboard = "dashboard" in client.scheduler_info().get("services", {})
    return str(client.dashboard_link) if has_dashboard else None


def _dashboard() -> str:
    """Return the usual address of Dask's dashboard, or a free port if another cluster uses it."""
    with socket.socket() as probe:
        try:
            probe.bind(("127.0.0.1", _DASHBOARD_PORT))
        except OSError:
            return "127.0.0.1:0"
    return f"127.0.0.1:{_DASHBOARD_PORT}"


def _kill(cluster: "LocalCluster") -> None:
    """Kill the worker processes: a regular end takes seconds, and nothing of theirs is kept."""
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid:
            with contextlib.suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)
