# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many runs of any estimator over a grid of sensors, motions, faults and seeds."""

from __future__ import annotations

import contextlib
import errno
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from imu_sim_ros import arguments
from imu_sim_ros.campaigns import campaign as runs
from imu_sim_ros.campaigns import engine as engines
from imu_sim_ros.campaigns.metrics import SUCCESS, Tolerance, parse_tolerance
from imu_sim_ros.campaigns.plan import Plan, check_plan, find_plan, load_plan
from imu_sim_ros.campaigns.results import TABLE, Row, Store, read_results
from imu_sim_ros.campaigns.verdict import Judgement, judge
from imu_sim_ros.errors import InputError, system_error
from imu_sim_ros.jobs.report import report, write_campaign_page

if TYPE_CHECKING:
    from imu_sim_ros.campaigns.engine import Engine

__all__ = ["Campaign", "Options", "Workers", "campaign", "make", "report"]


@dataclass(frozen=True)
class Workers:
    """The processes or the cluster that make the runs."""

    processes: int = 1
    """On this machine; 1 starts no further one."""
    scheduler: str | None = None
    """Address of a Dask scheduler, ``tcp://host:8786``."""
    dask: bool = False
    """On a local Dask cluster."""
    timeout: float = 60.0
    """[s] How long a scheduler without workers is waited for."""
    tell: Callable[[str], None] = field(default=lambda line: None, repr=False)
    """Receives the address of the dashboard."""

    def problems(self) -> Iterator[str]:
        """Yield a line for each problem."""
        if self.processes < 1:
            yield f"--workers {self.processes}: must be at least 1"
        if not 0.0 < self.timeout < 1e6:
            yield f"--worker-timeout {self.timeout:g}: must be above 0 s"
        if self.dask and self.scheduler:
            yield "--dask and --scheduler: choose one"

    @contextlib.contextmanager
    def engine(self, plan: Plan) -> Iterator[Engine]:
        """Yield the engine of the runs."""
        if not (self.dask or self.scheduler):
            yield engines.local(self.processes)
            return
        with engines.client(self.scheduler, self.processes, self.timeout) as client:
            engines.check_workers(client, plan)
            if address := engines.dashboard(client):
                self.tell(f"dashboard: {address}")
            yield engines.dask(client)


@dataclass(frozen=True)
class Options:
    """How the results are made, and with which results they are compared."""

    resume: bool = False
    force: bool = False
    retry_failed: bool = False
    batch: int | None = None
    """Seeds in a task; None: chosen by the estimators."""
    metric: str = ""
    """Metric of the verdict; empty: the plan's first."""
    baseline: Path | None = None
    """Results of an earlier campaign."""
    tolerance: Tolerance | None = None
    """None: the plan's."""
    report: bool = True
    command: str = ""
    """Name of the program in the footer of the page."""

    def problems(self, plan: Plan, output: Path | None) -> Iterator[str]:
        """Yield a line for each problem."""
        known = (*plan.metrics, SUCCESS)
        if self.batch is not None and self.batch < 1:
            yield f"--batch {self.batch}: must be at least 1"
        if self.metric and self.metric not in known:
            yield f"--metric {self.metric}: must be one of {', '.join(known)}"
        if self.resume and self.force:
            yield "--resume and --force: choose one"
        if self.baseline is not None and output is not None and _lies_in(self.baseline, output):
            yield f"--baseline {self.baseline}: is written by this campaign"


def _lies_in(path: Path, folder: Path) -> bool:
    here, there = Path(os.path.realpath(path)), Path(os.path.realpath(folder))
    return here == there or there in here.parents


@dataclass(frozen=True, repr=False)
class Campaign:
    """The results of a campaign."""

    plan: Plan
    folder: Path
    """Holds the tables, the page and the log of runs."""
    runs: list[Row]
    """One for each run, ordered by cell, seed and estimator: the columns of ``results.csv``."""
    new: int
    """Runs made now; the others existed before."""
    judgement: Judgement
    """Who is best, by how much, and how sure that is; failures, requirements, the baseline."""
    wall_s: float

    @property
    def done(self) -> int:
        """Runs that succeeded."""
        return self.judgement.done

    @property
    def problems(self) -> list[str]:
        """A line for each requirement that is not met and for all that is worse than before."""
        return self.judgement.problems

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        return {
            "runs": len(self.runs),
            "done": self.done,
            "failed": len(self.runs) - self.done,
            "wall_s": self.wall_s,
            "results": str(self.folder / TABLE),
            "judgement": self.judgement.to_dict(),
        }

    def __repr__(self) -> str:
        heads = [one.line(self.judgement.metric) for one in self.judgement.headline[:1]]
        words = [f"{len(self.runs)} runs, {self.done} done", *heads]
        return f"<Campaign {self.plan.options.name}: {'; '.join(words)}>"


def campaign(
    plan: str | PathLike[str],
    output: str | PathLike[str],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    resume: bool = False,
    force: bool = False,
    metric: str = "",
    baseline: str | PathLike[str] | None = None,
    tolerance: str | None = None,
) -> Campaign:
    r"""Make all runs of a plan, and judge the results.

    With several workers, call this function below ``if __name__ == "__main__":``, as for all
    processes that Python spawns.

    :param plan: file of the plan, or a name in config/campaigns.
    :param output: folder of the results and the page.
    :param workers: number of processes on this machine; with 1, no further process is started.
    :param scheduler: address of a Dask scheduler, ``tcp://host:8786``, instead of processes.
    :param resume: continue with the results in the folder.
    :param force: start over, discarding the results in the folder.
    :param metric: metric of the verdict, or ``success``; if empty, the first metric of the plan.
    :param baseline: folder, ``results.csv`` or ``results.parquet`` of an earlier campaign.
    :param tolerance: difference that does not matter, ``5 %`` or a number in the metric's unit.
    :returns: a :class:`Campaign` with the rows of results and the judgement.
    :raises ConfigurationError: for an invalid plan or argument, with a line for each problem.
    :raises InputError: for a folder or file that cannot be used.

    >>> import imu_sim_ros as ims
    >>> plan = folder / "plan.yaml"
    >>> _ = plan.write_text("parameters: {duration: 1.0}\ngrid: {imu: [tactical]}\nseeds: 2\n")
    >>> found = ims.campaign(plan, folder / "results")
    >>> found.done, sorted(found.runs[0])[:3]
    (2, ['align', 'ate_rmse_m', 'ate_rmse_rad'])
    """
    path = find_plan(str(arguments.path("plan", plan, "a file, or a name in config/campaigns")))
    options = Options(
        resume=arguments.switch("resume", resume),
        force=arguments.switch("force", force),
        metric=arguments.text("metric", metric, "the name of a metric", empty=True),
        baseline=None if baseline is None else arguments.path("baseline", baseline),
        tolerance=None if tolerance is None else parse_tolerance(tolerance),
        command="campaign() of imu_sim_ros",
    )
    place = arguments.path("output", output, "the path of a folder")
    loaded = load_plan(path)
    most = "a number of processes, from 1 to 10000"
    found_in = Workers(
        arguments.whole("workers", workers, most, 1, 10_000),
        None if scheduler is None else arguments.text("scheduler", scheduler, "tcp://HOST:PORT"),
    )
    problems = [*found_in.problems(), *options.problems(loaded, place)]
    if problems:
        raise InputError(problems)
    check_plan(loaded, path)
    return make(loaded, path, place, found_in, options)


Watch = Callable[[Sequence[Row]], None]


@contextlib.contextmanager
def _unwatched(there: int) -> Iterator[Watch]:
    yield lambda rows: None


def make(
    plan: Plan,
    path: Path,
    folder: Path,
    workers: Workers,
    options: Options,
    watched: Callable[[int], contextlib.AbstractContextManager[Watch]] = _unwatched,
) -> Campaign:
    """Make the runs of a plan that has been checked; arguments and result as for :func:`campaign`.

    :param path: of the plan's file.
    :param watched: is given how many runs there are, and yields what receives those that come.
    """
    started = time.perf_counter()
    earlier = None if options.baseline is None else read_results(options.baseline)
    metric = options.metric or plan.metrics[0]
    with (
        _explaining_full_disk(folder),
        Store(folder, options.resume, options.force) as store,
        workers.engine(plan) as engine,
    ):
        store.keep_plan(path)
        before = min(sum(1 for _ in store.rows()), plan.run_count)
        with watched(before) as watch:
            outcome = runs.run(plan, store, engine, watch, options.retry_failed, options.batch)
        if options.report:
            # A metric that no run has cannot be drawn.
            there = metric == SUCCESS or any(row.get(metric) is not None for row in outcome.rows)
            drawn = metric if there else ""
            baselines = [] if options.baseline is None else [options.baseline]
            write_campaign_page(folder, drawn, baselines, options.tolerance, options.command)
    found = judge(plan, outcome.rows, metric, earlier, options.tolerance)
    wall_s = time.perf_counter() - started
    return Campaign(plan, folder, outcome.rows, outcome.new, found, wall_s)


@contextlib.contextmanager
def _explaining_full_disk(folder: Path) -> Iterator[None]:
    """Name the folder if the disk is full, because the system's error does not."""
    try:
        yield
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise system_error(folder, error) from error
        raise
