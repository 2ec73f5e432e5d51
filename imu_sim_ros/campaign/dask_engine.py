# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The runs of a campaign on a Dask cluster (``dask.distributed``, an extra)."""

import itertools
import logging
import os
import signal
import socket
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from imu_sim_ros.campaign.engine import Task, failed, work
from imu_sim_ros.campaign.plan import Plan
from imu_sim_ros.errors import InputError, MachineError, MissingDependencyError

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

Row = dict[str, Any]

_AT_HAND: Final = 4
"""Tasks that the scheduler holds for each thread of the cluster: enough that none waits, and few
enough that its memory does not grow with the campaign."""
_CONNECT_S: Final = 5.0
_DASHBOARD_PORT: Final = 8787


@contextmanager
def client(scheduler: str | None, workers: int) -> Iterator["Client"]:
    """Connect to a scheduler, or start a cluster of processes on this machine.

    :param scheduler: ``tcp://host:port``; None: a local cluster with its dashboard.
    :raises MissingDependencyError: where dask.distributed is not installed.
    :raises InputError: where no scheduler answers.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise MissingDependencyError(
            "Dask is not installed: pip install 'distributed', or apt install python3-distributed"
        ) from None
    for name in [
        name for name in logging.root.manager.loggerDict if name.startswith("distributed")
    ]:
        # Its tracebacks of lost connections; what they cost is in the results.
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if scheduler is None:
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
        os.environ.update(threads)
        with (
            LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=_dashboard()
            ) as cluster,
            Client(cluster) as found,
        ):
            try:
                yield found
            except KeyboardInterrupt:
                _kill(cluster)
                raise
        return
    try:
        found = Client(scheduler, timeout=_CONNECT_S)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {scheduler}: {error}") from None
    with found:
        yield found


def _dashboard() -> str:
    """Return where Dask's dashboard is known to be, or a free port beside another cluster's."""
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
            with suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)


def engine(
    connected: "Client",
) -> Callable[[Plan, Iterable[Task], Path], Generator[list[Row], None, None]]:
    """Return the engine of a cluster."""

    def start(plan: Plan, todo: Iterable[Task], folder: Path) -> Generator[list[Row], None, None]:
        from distributed.comm.core import CommClosedError

        try:
            yield from _run(connected, plan, iter(todo), folder)
        except (CommClosedError, CancelledError):
            raise MachineError(
                "the connection to the scheduler was lost; continue with --resume"
            ) from None

    return start


def _run(
    connected: "Client", plan: Plan, todo: Iterator[Task], folder: Path
) -> Generator[list[Row], None, None]:
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    # A plan goes with each task: one that lies on the workers is lost with them.
    small = replace(plan, seeds=plan.seeds[:1])
    under_way: dict[Any, Task] = {}
    suspects: deque[Task] = deque()
    completed = as_completed()

    def submit(task: Task) -> None:
        future = connected.submit(
            work, small, task, folder, pure=False, retries=plan.options.retries
        )
        under_way[future] = task
        completed.add(future)

    def fill() -> None:
        if suspects:
            if not under_way:
                submit(suspects.popleft())
            return
        threads = sum(connected.nthreads().values()) or 1
        for task in itertools.islice(todo, max(threads * _AT_HAND - len(under_way), 0)):
            submit(task)

    fill()
    while under_way:
        future = next(completed)
        task = under_way.pop(future)
        try:
            yield future.result()
        except KilledWorker:
            # The scheduler blames all tasks of a worker that died: one seed at a time tells.
            if len(task.seeds) == 1 and task.deaths:
                yield failed(plan, task, "failed: the worker process died")
            else:
                suspects.extend(replace(task, seeds=(one,), deaths=1) for one in task.seeds)
        # The scheduler forgets the result at once.
        future.release()
        fill()
