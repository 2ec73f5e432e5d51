# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The runs of a campaign on a Dask cluster (``dask.distributed``, an extra)."""

import os
import signal
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from imu_sim_ros.campaign.engine import Task, failed, work
from imu_sim_ros.campaign.plan import Plan
from imu_sim_ros.errors import InputError, MissingDependencyError

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

Row = dict[str, Any]

_AT_HAND: Final = 4
"""Tasks that the scheduler holds for each thread of the cluster: enough that none waits, and few
enough that its memory does not grow with the campaign."""
_CONNECT_S: Final = 5.0


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
    if scheduler is None:
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
        os.environ.update(threads)
        with (
            LocalCluster(n_workers=workers, threads_per_worker=1) as cluster,
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


def _kill(cluster: "LocalCluster") -> None:
    """End the worker processes at once: asked, they take seconds, and nothing of theirs is kept."""
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
        return _run(connected, plan, iter(todo), folder)

    return start


def _run(
    connected: "Client", plan: Plan, todo: Iterator[Task], folder: Path
) -> Generator[list[Row], None, None]:
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    shared = connected.scatter(plan, broadcast=True, hash=False)
    under_way: dict[Any, Task] = {}
    completed = as_completed()

    def fill() -> None:
        threads = sum(connected.nthreads().values()) or 1
        while len(under_way) < threads * _AT_HAND:
            task = next(todo, None)
            if task is None:
                return
            future = connected.submit(
                work, shared, task, folder, pure=False, retries=plan.options.retries
            )
            under_way[future] = task
            completed.add(future)

    fill()
    while under_way:
        future = next(completed)
        task = under_way.pop(future)
        try:
            rows = future.result()
        except KilledWorker:
            rows = failed(plan, task, "failed: the worker process died")
        # The scheduler forgets the result at once.
        future.release()
        yield rows
        fill()
