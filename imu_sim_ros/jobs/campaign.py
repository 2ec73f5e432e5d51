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
from typing import TYPE_CHECKING, Any, Final

from imu_sim_ros import arguments
from imu_sim_ros.campaigns import campaign as runs
from imu_sim_ros.campaigns import engine as engines
from imu_sim_ros.campaigns.cells import cell_count
from imu_sim_ros.campaigns.metrics import SUCCESS, Tolerance, parse_tolerance
from imu_sim_ros.campaigns.parameters import CommandEstimator
from imu_sim_ros.campaigns.plan import Plan, check_plan, find_plan, load_plan
from imu_sim_ros.campaigns.results import TABLE, Row, Store, read_results
from imu_sim_ros.campaigns.statistics import power, quantile, seeds_needed
from imu_sim_ros.campaigns.summary import Group, groups, slopes
from imu_sim_ros.campaigns.verdict import Judgement, counts, headline, judge
from imu_sim_ros.errors import InputError, system_error
from imu_sim_ros.jobs.report import write_campaign_page
from imu_sim_ros.navigation.evaluation import anees_band
from imu_sim_ros.text_tables import TextTable

if TYPE_CHECKING:
    from imu_sim_ros.campaigns.engine import Engine

__all__ = ["Campaign", "Options", "Workers", "campaign", "make"]


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
    non_inferiority: Tolerance | None = None
    """Margin of non-inferiority to the baseline; None: not asked."""
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
        if self.non_inferiority is not None and self.baseline is None:
            yield f"--non-inferiority {self.non_inferiority}: needs --baseline"
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
        """One line for each requirement that is not met and each result worse than the baseline."""
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
        heads = (
            [
                "; ".join(
                    headline(
                        self.judgement.headline, self.judgement.metric, self.judgement.tolerance
                    )
                )
            ]
            if self.judgement.headline
            else []
        )
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
    non_inferiority: str | None = None,
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
    :param non_inferiority: with ``baseline``, margin by which each result must be proven not to be
        worse; without it, only a significantly worse result is a problem.
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
        non_inferiority=None
        if non_inferiority is None
        else parse_tolerance(non_inferiority, "non_inferiority"),
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


Advance = Callable[..., None]
"""Receives how many more runs there are, and words about all of them."""


@contextlib.contextmanager
def _no_progress(done: int) -> Iterator[Advance]:
    yield lambda count, text: None


def make(
    plan: Plan,
    path: Path,
    folder: Path,
    workers: Workers,
    options: Options,
    progress: Callable[[int], contextlib.AbstractContextManager[Advance]] = _no_progress,
) -> Campaign:
    """Make the runs of a plan that has been checked; arguments and result as for :func:`campaign`.

    :param path: of the plan's file.
    :param progress: is given how many runs there are, and yields what receives those that come.
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
        tally = runs.Tally(plan, before)
        with _explaining_interruption(folder), progress(before) as advance:
            advance(0, tally.add([]))
            outcome = runs.run(
                plan,
                store,
                engine,
                lambda rows: advance(len(rows), tally.add(rows)),
                options.retry_failed,
                options.batch,
            )
        if options.report:
            # A metric that no run has cannot be drawn.
            there = metric == SUCCESS or any(row.get(metric) is not None for row in outcome.rows)
            drawn = metric if there else ""
            baselines = [] if options.baseline is None else [options.baseline]
            limits = options.tolerance, options.non_inferiority
            write_campaign_page(folder, drawn, baselines, limits, options.command)
    found = judge(plan, outcome.rows, metric, earlier, options.tolerance, options.non_inferiority)
    wall_s = time.perf_counter() - started
    return Campaign(plan, folder, outcome.rows, outcome.new, found, wall_s)


@contextlib.contextmanager
def _explaining_interruption(folder: Path) -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt as stop:
        stop.args = (f"{folder} has the runs made so far; continue with --resume",)
        raise


@contextlib.contextmanager
def _explaining_full_disk(folder: Path) -> Iterator[None]:
    """Name the folder if the disk is full, because the system's error does not."""
    try:
        yield
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise system_error(folder, error) from error
        raise


def reasons(found: Judgement) -> list[str]:
    """Return why runs failed if none is done, each reason once."""
    counted: dict[str, int] = {}
    for failure in found.failures:
        counted[failure.reason] = counted.get(failure.reason, 0) + failure.runs
    return [f"no run is done: {runs:,} x {reason}" for reason, runs in list(counted.items())[:10]]


def expected_duration(plan: Plan, processes: int) -> str:
    """Return how long a campaign takes, from its first run; of programs only their limit says."""
    total, words = runs.seconds_of_all_runs(plan), "at"
    if total is None:
        limits = (e.timeout for e in plan.estimators.values() if isinstance(e, CommandEstimator))
        total, words = plan.run_count * max(limits), "at up to"
    one, hours = total / plan.run_count, total / max(processes, 1) / 3600.0
    each = f"{one * 1e3:.2g} ms" if one < 1.0 else f"{one:.3g} s"
    on = "1 process" if processes == 1 else f"{processes} processes"
    return f"{words} {each} each about {max(hours, 0.1):,.1f} hours on {on}"


class Power:
    """The chance to find a difference with a plan's seeds, and the seeds it takes.

    :param wanted: the difference, a share.
    :param scatter: of the ratio of both results on the same seed.
    :param tolerance: difference that does not matter.
    :param margin: with it, the chance to prove all results not to be worse by it, if they really
        are worse by ``wanted``, and independent of each other.
    :raises InputError: for what is no share, or out of range.
    """

    def __init__(
        self,
        plan: Plan,
        wanted: Tolerance,
        scatter: Tolerance,
        tolerance: Tolerance,
        margin: Tolerance | None = None,
    ) -> None:
        shares = {"--power": wanted, "--scatter": scatter, "tolerance": tolerance}
        if margin is not None:
            shares["--non-inferiority"] = margin
        problems = [
            f"{name} {share}: must be a share such as 10 %"
            for name, share in shares.items()
            if not share.relative
        ]
        if not problems and margin is not None and wanted.value >= margin.value:
            problems.append(f"--power {wanted}: must be below --non-inferiority, {margin}")
        if not problems and margin is None and wanted.value <= tolerance.value:
            problems.append(f"--power {wanted}: must be above the tolerance, {tolerance}")
        if scatter.value <= 0.0:
            problems.append(f"--scatter {scatter}: must be above 0")
        if problems:
            raise InputError(problems)
        self.wanted, self.scatter, self.tolerance, self.margin = wanted, scatter, tolerance, margin
        self.seeds = len(plan.seeds)
        self.comparisons = cell_count(plan.axes) * len(plan.estimators)
        sizes = (wanted.value, scatter.value, tolerance.value, self.comparisons)
        together = 1
        if margin is not None:  # the same test, with both hypotheses exchanged; all must succeed
            sizes = (margin.value, scatter.value, wanted.value, 1)
            together = self.comparisons
        self.power = power(self.seeds, *sizes) ** together
        self.needed = {
            share: seeds_needed(share ** (1.0 / together), *sizes) for share in (0.5, 0.8, 0.95)
        }

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        return {
            "difference": self.wanted.value,
            "scatter": self.scatter.value,
            "tolerance": self.tolerance.value,
            "non_inferiority": None if self.margin is None else self.margin.value,
            "comparisons": self.comparisons,
            "seeds": self.seeds,
            "power": self.power,
            "seeds_needed": {f"{share:g}": seeds for share, seeds in self.needed.items()},
        }

    def lines(self) -> Iterator[str]:
        """Yield it in words."""
        many = f"{self.comparisons} comparison{'s' * (self.comparisons != 1)}"
        if self.margin is not None:
            yield (
                f"Non-inferiority by {self.margin}, true difference {self.wanted}, scatter "
                f"{self.scatter}, {many}: the plan's {self.seeds} seeds prove it in "
                f"{100.0 * self.power:.0f} % of campaigns"
            )
        else:
            yield (
                f"A difference of {self.wanted} beyond a tolerance of {self.tolerance}, scatter "
                f"{self.scatter}, {many}: the "
                f"plan's {self.seeds} seeds find it in {100.0 * self.power:.0f} % of campaigns"
            )
        for share, seeds in self.needed.items():
            shown = "more than 100,000" if seeds is None else f"{seeds:,}"
            yield f"{100.0 * share:.0f} %: {shown} seeds"


_SHOWN: Final = 40
"""Rows of a table."""


def lines(made: Campaign) -> Iterator[str | TextTable]:
    """Yield the text of a campaign's results."""
    metric, found = made.judgement.metric, groups(made.runs, made.plan.grid_names)
    rows = [_row(group, metric) for group in found[:_SHOWN]]
    header = ["cell", "estimator", "done", "coverage", "median", "95 % interval", "p95"]
    header.append("NEES (band)")
    yield TextTable(header, rows, f"{metric}, median with 95 % interval")
    if len(found) > _SHOWN:
        yield (f"{len(found) - _SHOWN} more in {made.folder / 'summary.csv'}")
    yield from _difference_lines(made.judgement)
    yield from _baseline_tables(made.judgement)
    yield from _slope_tables(made.runs, found, metric)
    for status, count in counts(made.runs).items():
        if status != "done":
            yield f"{count} runs {status}"
    yield (
        f"{made.folder}: {len(made.runs):,} runs, {made.new:,} of them new, in {made.wall_s:.1f} s"
    )


def _difference_lines(found: Judgement) -> Iterator[str | TextTable]:
    """Yield who is best, and the effects of the headline's contests."""
    if len(found.headline) > 1:
        yield "; ".join(headline(found.headline, found.metric, found.tolerance))
    for contest in found.headline[:_SHOWN]:
        yield contest.line(found.metric, found.tolerance)
    rows = [
        [
            *(contest.place, effect.a, effect.b, effect.size(), effect.at_once()),
            *(_number(effect.p), effect.verdict),
        ]
        for contest in found.contests
        for effect in contest.effects
        if effect.significant
    ]
    if rows:
        title = f"Significant differences ({len(rows)}; same seeds, Wilcoxon, Holm)"
        yield TextTable(
            ["of", "A", "B", "A than B", "95 %, all at once", "p", "A is"], rows[:_SHOWN], title
        )
    yield from sorted({e.note for c in found.contests for e in c.effects if e.note})


def _baseline_tables(found: Judgement) -> Iterator[TextTable]:
    """Yield how each group compares with the baseline, worse groups first."""
    effects = sorted(found.baseline or [], key=lambda effect: effect.verdict != "worse")
    rows = [[one.a, one.note or one.size(), _number(one.p), one.verdict] for one in effects]
    if rows:
        title = f"Against the baseline: {found.metric}"
        header = ["cell; estimator", "than before", "p", "is"]
        yield TextTable(header, rows[:_SHOWN], title)


def _slope_tables(rows: Sequence[Row], found: Sequence[Group], metric: str) -> Iterator[TextTable]:
    grid = found[0].grid if found else ()
    slopes_of = [
        [one.parameter, one.estimator, _number(slope.value), f"{slope.low:.3g} - {slope.high:.3g}"]
        for one in slopes(rows, grid, metric)
        if (slope := one.sensitivity.slope)
    ]
    if slopes_of:
        header = ["parameter", "estimator", "slope", "95 % interval"]
        title = f"Sensitivity: d log({metric}) / d log(parameter)"
        yield TextTable(header, slopes_of, title)


def _row(group: Group, metric: str) -> list[str]:
    values = group.values(metric)  # none of success, whose interval is in summary.csv
    median, p95 = quantile(values, 0.5), quantile(values, 0.95)
    ends = [_number(end) for end in (median.low, median.high)]
    return [
        group.cell,
        group.estimator,
        f"{group.done} of {len(group.rows)}",
        _coverage(group),
        _number(median.value),
        " - ".join(ends),
        _number(p95.value),
        _consistency(group),
    ]


def _coverage(group: Group) -> str:
    covered = group.coverage()
    return "-" if covered is None else f"{100.0 * covered:.3g} %"


def _consistency(group: Group) -> str:
    """Return the mean NEES with the band that it lies in if the covariance is right."""
    nees = group.values("nees_position")
    if not len(nees):
        return "not valid" if group.not_valid("nees_position") else "-"
    low, high = anees_band(3, len(nees))
    return f"{nees.mean():.3g} ({low:.2f} - {high:.2f})"


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.4g}"
