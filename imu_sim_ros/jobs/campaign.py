# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many runs of any estimator over a grid of sensors, motions, faults and seeds."""

from __future__ import annotations

import contextlib
import errno
import os
import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

from imu_sim_ros.campaigns import campaign as runs
from imu_sim_ros.campaigns import engine as engines
from imu_sim_ros.campaigns.baseline import differences, identities_of_plan, plan_mismatch
from imu_sim_ros.campaigns.cells import cell_count
from imu_sim_ros.campaigns.metrics import SUCCESS, Tolerance, parse_tolerance
from imu_sim_ros.campaigns.parameters import CommandEstimator
from imu_sim_ros.campaigns.plan import Plan, check_plan, find_plan, load_plan
from imu_sim_ros.campaigns.results import TABLE, Row, Store, read_results
from imu_sim_ros.campaigns.statistics import ConfidenceInterval, power, quantile, seeds_for_power
from imu_sim_ros.campaigns.summary import Group, group_runs, slopes
from imu_sim_ros.campaigns.verdict import (
    EstimateFinding,
    Judgement,
    counts,
    headline,
    judge,
    list_varying_names,
)
from imu_sim_ros.core import arguments
from imu_sim_ros.core.arguments import suggest_keywords
from imu_sim_ros.core.digits import interval_texts
from imu_sim_ros.core.errors import InputError, system_error
from imu_sim_ros.core.names import short_repr, suggestion
from imu_sim_ros.core.spelling import argument, argument_prefix
from imu_sim_ros.core.types import JsonObject
from imu_sim_ros.jobs.report import write_campaign_page
from imu_sim_ros.navigation.evaluation import anees_band
from imu_sim_ros.terminal.progress import current_watcher, progress
from imu_sim_ros.terminal.signatures import Text
from imu_sim_ros.terminal.text_tables import TextTable

if TYPE_CHECKING:
    from imu_sim_ros.campaigns.engine import Engine


def _lies_in(path: Path, folder: Path) -> bool:
    """Return True if a path is a folder or in it, with links resolved."""
    path_real, folder_real = Path(os.path.realpath(path)), Path(os.path.realpath(folder))
    return path_real == folder_real or folder_real in path_real.parents


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
    """Verdict: the best, by how much, and how sure; failures, requirements, the baseline."""
    wall_s: float
    notes: list[str]
    """A line for whatever weakens the judgement."""

    @property
    def done(self) -> int:
        """Runs that succeeded."""
        return self.judgement.done

    @property
    def problems(self) -> list[str]:
        """One line for each requirement that is not met and each result worse than the baseline."""
        return self.judgement.problems

    def to_dict(self) -> JsonObject:
        """Return the content of ``--json``."""
        return {
            "runs": len(self.runs),
            "done": self.done,
            "failed": len(self.runs) - self.done,
            "wall_s": self.wall_s,
            "results": str(self.folder / TABLE),
            "judgement": self.judgement.to_dict(),
            "notes": self.notes,
        }

    def lines(self) -> Iterator[str | TextTable]:
        """Yield the text of the results, as ``campaign`` prints it."""
        return _lines(self)

    def __repr__(self) -> str:
        judgement, parts = self.judgement, [f"{len(self.runs)} runs, {self.done} done"]
        if judgement.headline:
            parts.append(
                "; ".join(headline(judgement.headline, judgement.metric, judgement.tolerance))
            )
        return f"<Campaign {self.plan.options.name}: {'; '.join(parts)}>"


@suggest_keywords
def campaign(
    plan: Annotated[str | PathLike[str], "PLAN"],
    output: Annotated[str | PathLike[str], "-o --output DIR"],
    *,
    workers: Annotated[
        int,
        "N",
        Text("worker processes on this machine; default: one per core; 1 starts no worker process"),
    ] = 1,
    scheduler: Annotated[str | None, "ADDRESS"] = None,
    dask: Annotated[bool, "--dask"] = False,
    worker_timeout: Annotated[float, "TIME"] = 60.0,
    resume: Annotated[bool, "--resume"] = False,
    force: Annotated[bool, "--force"] = False,
    retry_failed: Annotated[bool, "--retry-failed"] = False,
    batch: Annotated[int | None, "N"] = None,
    metric: Annotated[str, "NAME"] = "",
    baseline: Annotated[str | PathLike[str] | None, "FILE"] = None,
    baseline_anyway: Annotated[bool, "--baseline-anyway"] = False,
    tolerance: Annotated[str | None, "SHARE"] = None,
    non_inferiority: Annotated[str | None, "SHARE"] = None,
    report: Annotated[bool, "--no-report", Text("write no report.html")] = True,
    command: str = "campaign() of imu_sim_ros",
) -> Campaign:
    r"""Make all runs of a plan, and judge the results.

    With several workers, call this function below ``if __name__ == "__main__":``, as for all
    processes that Python spawns.

    :param plan: a file, or a name in config/campaigns
    :param output: folder for the results and the page
    :param workers: number of processes on this machine; with 1, no further process is started.
    :param scheduler: run on a Dask cluster, tcp://host:8786
    :param dask: run on a local Dask cluster with its dashboard
    :param worker_timeout: time to wait for a worker of a cluster that has none [s]
    :param resume: continue with the results in the folder
    :param force: start over, discarding the results in the folder
    :param retry_failed: with ``resume``: repeat failed runs
    :param batch: seeds per task; default: 50 for built-in estimators, 1 for programs
    :param metric: metric of the tables and of the baseline, or success; default: ate_rmse_m, or
        the plan's first
    :param baseline: folder, results.csv or results.parquet of an earlier campaign: each result that
        is significantly worse is a problem, with which the program ends with status 3
    :param baseline_anyway: compare with a baseline of another plan, which is refused otherwise: its
        simulation, alignment or limits differ
    :param tolerance: difference that does not matter: 5%, or a number in the metric's unit;
        default: the plan's, 2%
    :param non_inferiority: with ``baseline``: each result that is not proven to be less than this
        share worse is a problem, too: 5%, or a number in the metric's unit; with --power: the
        number of seeds that this proof needs
    :param report: write report.html.
    :param command: command line for the page.
    :returns: a :class:`Campaign` with the rows of results and the judgement.
    :raises ConfigurationError: for an invalid plan or argument, with a line for each problem.
    :raises InputError: for a folder or file that cannot be used.

    >>> import imu_sim_ros as ims
    >>> plan = folder / "plan.yaml"
    >>> _ = plan.write_text("parameters: {duration: 1.0}\ngrid: {imu: [tactical]}\nseeds: 2\n")
    >>> results = ims.campaign(plan, folder / "results")
    >>> results.done, sorted(results.runs[0])[:3]
    (2, ['align', 'ate_rmse_m', 'ate_rmse_rad'])
    """
    path = find_plan(str(arguments.path("plan", plan, "a file, or a name in config/campaigns")))
    folder = arguments.path("output", output, "the path of a folder")
    for name, value in (("resume", resume), ("force", force), ("retry_failed", retry_failed)):
        arguments.boolean(name, value)
    for name, value in (("report", report), ("dask", dask), ("baseline_anyway", baseline_anyway)):
        arguments.boolean(name, value)
    baseline_path = None if baseline is None else arguments.path("baseline", baseline)
    limits = Limits.of(tolerance, non_inferiority)
    allowed = "a number of processes, from 1 to 10000"
    processes = arguments.integer("workers", workers, allowed, 1, 10_000)
    arguments.number("worker_timeout", worker_timeout, "above 0 s", 0.0, 1e6, exclusive=True)
    if scheduler is not None:
        arguments.text("scheduler", scheduler, "tcp://HOST:PORT")
    if batch is not None:
        arguments.integer("batch", batch, "at least 1", 1, 1 << 31)
    campaign_plan = load_plan(path)
    problems = [
        *_metric_problems(metric, campaign_plan),
        *_exclusive_problems(("dask", dask), ("scheduler", scheduler)),
        *_exclusive_problems(("resume", resume), ("force", force)),
        *_baseline_problems(baseline_path, folder, limits, baseline_anyway),
    ]
    if problems:
        raise InputError(problems)
    check_plan(campaign_plan, path)
    started = time.perf_counter()
    baseline_rows, notes = _read_baseline(campaign_plan, baseline_path, baseline_anyway)
    judged_metric = metric or campaign_plan.metrics[0]
    with (
        _explain_full_disk(folder),
        Store(folder, resume, force) as store,
        _engine(campaign_plan, processes, scheduler, dask, worker_timeout) as engine,
    ):
        with _explain_interruption(folder):
            store.keep_plan(path)
            outcome = _execute_runs(campaign_plan, store, engine, retry_failed, batch)
            if report:
                # A metric that no run has cannot be drawn.
                has_metric = any(row.get(judged_metric) is not None for row in outcome.rows)
                drawn_metric = judged_metric if has_metric or judged_metric == SUCCESS else ""
                baselines = [baseline_path] if baseline_path else []
                write_campaign_page(
                    folder, drawn_metric, baselines, limits, command, baseline_anyway
                )
        current_watcher().complete(folder)
    judgement = judge(campaign_plan, outcome.rows, judged_metric, baseline_rows, *limits)
    wall_s = time.perf_counter() - started
    return Campaign(campaign_plan, folder, outcome.rows, outcome.executed, judgement, wall_s, notes)


def _metric_problems(metric: str, plan: Plan) -> list[str]:
    """Return a line if a plan does not have a metric; an empty name is the plan's default."""
    metric_names = (*plan.metrics, SUCCESS)
    name = arguments.text("metric", metric, "the name of a metric", empty=True)
    if not name or name in metric_names:
        return []
    return [f"{argument_prefix('metric', short_repr(name))}: {suggestion(name, metric_names)}"]


def _exclusive_problems(*name_values: tuple[str, object]) -> list[str]:
    """Return a line if all of some arguments are set; at most one of them may be.

    :param name_values: name and value of each argument.
    """
    if not all(value for _, value in name_values):
        return []
    return [f"{' and '.join(argument(name) for name, _ in name_values)}: choose one"]


def _baseline_problems(
    path: Path | None, folder: Path, limits: Limits, baseline_anyway: bool
) -> Iterator[str]:
    """Yield a line for each argument about a baseline that contradicts another argument.

    :param path: folder or table of the baseline; None: there is no baseline.
    :param folder: output of the campaign, which cannot be its baseline as well.
    """
    needs_baseline = f"needs {argument('baseline')}"
    if limits.non_inferiority is not None and path is None:
        prefix = argument_prefix("non_inferiority", str(limits.non_inferiority))
        yield f"{prefix}: {needs_baseline}"
    if baseline_anyway and path is None:
        yield f"{argument_prefix('baseline_anyway')}: {needs_baseline}"
    if path is not None and _lies_in(path, folder):
        yield f"{argument_prefix('baseline', str(path))}: is written by this campaign"


def _read_baseline(
    plan: Plan, path: Path | None, allow_mismatch: bool
) -> tuple[list[Row] | None, list[str]]:
    """Return the rows of a baseline, and a line if they are of another plan.

    :param path: folder or table of the baseline; None: there is none, nor are there rows.
    :param allow_mismatch: accept a baseline of another plan.
    :raises InputError: for a file that cannot be read, and a baseline of another plan.
    """
    if path is None:
        return None, []
    rows = read_results(path)
    difference = differences(plan, identities_of_plan(plan, rows), path, rows)
    if not difference:
        return rows, []
    if not allow_mismatch:
        raise InputError(plan_mismatch(path, difference))
    return rows, [f"the baseline is of another plan: {difference}"]


def _execute_runs(
    plan: Plan, store: Store, engine: Engine, retry_failed: bool, batch: int | None
) -> runs.Outcome:
    """Execute the runs that a store does not have yet, with progress, and return all rows.

    :param retry_failed: repeat the failed runs of the store.
    :param batch: number of seeds per task; None: the estimator's default.
    """
    done = min(sum(1 for _ in store.rows()), plan.run_count)
    tally = runs.Tally(plan, done)
    with progress("", lambda: plan.run_count, done=done) as advance:
        advance(0, tally.add([]))
        return runs.run(
            plan,
            store,
            engine,
            lambda rows: advance(len(rows), tally.add(rows)),
            retry_failed,
            batch,
        )


class Limits(NamedTuple):
    """Differences that matter."""

    tolerance: Tolerance | None
    """Difference that does not matter; None: the plan's."""
    non_inferiority: Tolerance | None
    """Margin of non-inferiority to the baseline; None: not asked."""

    @classmethod
    def of(cls, tolerance: str | None, non_inferiority: str | None) -> Limits:
        """Return the limits that texts such as ``5%`` describe.

        :raises ConfigurationError: for other texts.
        """
        texts = {"tolerance": tolerance, "non_inferiority": non_inferiority}
        return cls(
            *(None if text is None else parse_tolerance(text, name) for name, text in texts.items())
        )


@contextlib.contextmanager
def _engine(
    plan: Plan, processes: int, scheduler: str | None, dask: bool, timeout: float
) -> Iterator[Engine]:
    """Yield the engine of the runs."""
    if not (dask or scheduler):
        yield engines.local(processes)
        return
    with engines.client(scheduler, processes, timeout) as client:
        engines.check_workers(client, plan)
        if address := engines.dashboard(client):
            current_watcher().note(f"dashboard: {address}")
        yield engines.dask(client, timeout)


@contextlib.contextmanager
def _explain_interruption(folder: Path) -> Iterator[None]:
    """Add to an interruption of the block how to continue."""
    try:
        yield
    except KeyboardInterrupt as stop:
        stop.args = (
            f"{folder} has the runs made so far; continue with {argument('resume', True)}",
        )
        raise


@contextlib.contextmanager
def _explain_full_disk(folder: Path) -> Iterator[None]:
    """Name the folder if the disk is full, because the system's error does not."""
    try:
        yield
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise system_error(folder, error) from error
        raise


def failure_reasons(judgement: Judgement) -> list[str]:
    """Return why runs failed if none is done, each reason once."""
    counted: dict[str, int] = {}
    for failure in judgement.failures:
        counted[failure.reason] = counted.get(failure.reason, 0) + failure.runs
    return [f"no run is done: {runs:,} x {reason}" for reason, runs in list(counted.items())[:10]]


def duration_text(plan: Plan, processes: int) -> str:
    """Return text of a campaign's duration, from its first run or the time limit of programs."""
    total, prefix = runs.seconds_of_all_runs(plan), "at"
    if total is None:
        limits = (e.timeout for e in plan.estimators.values() if isinstance(e, CommandEstimator))
        total, prefix = plan.run_count * max(limits), "at up to"
    run_s, hours = total / plan.run_count, total / max(processes, 1) / 3600.0
    run_text = f"{run_s * 1e3:.2g} ms" if run_s < 1.0 else f"{run_s:.3g} s"
    processes_text = "1 process" if processes == 1 else f"{processes} processes"
    return f"{prefix} {run_text} each about {max(hours, 0.1):,.1f} hours on {processes_text}"


class Power:
    """The chance to find a difference with a plan's seeds, and the seeds it takes.

    :param wanted: the difference, a share.
    :param scatter: standard deviation of the logarithm of the ratio of both results on a seed.
    :param baseline_anyway: compare with a baseline of another plan, which is refused otherwise: its
        simulation, alignment or limits differ
    :param tolerance: difference that does not matter.
    :param margin: with it, the chance to prove all results not to be worse by it, if they really
        are worse by ``wanted``, and independent of each other.
    :raises InputError: for what is no share, or out of range.
    """

    def __init__(
        self,
        plan: Plan,
        difference: Tolerance,
        scatter: Tolerance,
        tolerance: Tolerance,
        margin: Tolerance | None = None,
    ) -> None:
        power_argument = argument("power", str(difference))
        shares = {"power": difference, "scatter": scatter, "tolerance": tolerance}
        if margin is not None:
            shares["non_inferiority"] = margin
        problems = [
            f"{argument(name, str(share))}: must be a share such as 10 %"
            for name, share in shares.items()
            if not share.relative
        ]
        if not problems and margin is not None and difference.value >= margin.value:
            problems.append(
                f"{power_argument}: must be below {argument('non_inferiority')}, {margin}"
            )
        if not problems and margin is None and difference.value <= tolerance.value:
            problems.append(f"{power_argument}: must be above the tolerance, {tolerance}")
        if scatter.value <= 0.0:
            problems.append(f"{argument('scatter', str(scatter))}: must be above 0")
        if problems:
            raise InputError(problems)
        self.difference, self.scatter, self.tolerance, self.margin = (
            difference,
            scatter,
            tolerance,
            margin,
        )
        self.seeds = len(plan.seeds)
        self.comparisons = cell_count(plan.axes) * len(plan.estimators)
        sizes = (difference.value, scatter.value, tolerance.value, self.comparisons)
        together = 1
        if margin is not None:  # the same test, with both hypotheses exchanged; all must succeed
            sizes = (margin.value, scatter.value, difference.value, 1)
            together = self.comparisons
        self.power = power(self.seeds, *sizes) ** together
        self.needed = {
            share: seeds_for_power(share ** (1.0 / together), *sizes) for share in (0.5, 0.8, 0.95)
        }

    def to_dict(self) -> JsonObject:
        """Return the content of ``--json``."""
        return {
            "difference": self.difference.value,
            "scatter": self.scatter.value,
            "tolerance": self.tolerance.value,
            "non_inferiority": None if self.margin is None else self.margin.value,
            "comparisons": self.comparisons,
            "seeds": self.seeds,
            "power": self.power,
            "seeds_needed": {f"{share:g}": seeds for share, seeds in self.needed.items()},
        }

    def lines(self) -> Iterator[str]:
        """Yield the lines of the report."""
        many = f"{self.comparisons} comparison{'s' * (self.comparisons != 1)}"
        if self.margin is not None:
            yield (
                f"Non-inferiority by {self.margin}, true difference {self.difference}, scatter "
                f"{self.scatter}, {many}: the plan's {self.seeds} seeds prove it in "
                f"{100.0 * self.power:.0f} % of campaigns"
            )
        else:
            yield (
                f"A difference of {self.difference} beyond a tolerance of {self.tolerance}, "
                f"scatter {self.scatter}, {many}: the plan's {self.seeds} seeds find it in "
                f"{100.0 * self.power:.0f} % of campaigns"
            )
        for share, seeds in self.needed.items():
            seeds_text = "more than 100,000" if seeds is None else f"{seeds:,}"
            yield f"{100.0 * share:.0f} %: {seeds_text} seeds"


_SHOWN: Final = 40
"""Rows of a table."""


def _lines(result: Campaign) -> Iterator[str | TextTable]:
    """Yield the report: the table of results, effects, slopes and the verdict."""
    metric, groups = result.judgement.metric, group_runs(result.runs, result.plan.grid_names)
    varying = list_varying_names(groups)
    rows = [_row(group, metric, varying) for group in groups[:_SHOWN]]
    names = [name for name in varying if name != "estimator"]
    endings = [name.rpartition(".")[2] for name in names]
    header = endings if len(set(endings)) == len(endings) else names
    header += ["estimator", "done", "coverage", "median", "95 % interval", "p95", "NEES (band)"]
    constants = [
        name if key == "estimator" else f"{key}={name}"
        for key, name in (groups[0].labels if groups else {}).items()
        if key not in varying
    ]
    title = f"{metric}, median with 95 % interval; {', '.join(constants)}"
    yield _drop_constant_columns(header, rows, title.removesuffix("; "), {"estimator"})
    if len(groups) > _SHOWN:
        yield (f"{len(groups) - _SHOWN} more in {result.folder / 'summary.csv'}")
    yield from _difference_lines(result.judgement)
    yield from result.notes
    yield from _baseline_tables(result.judgement)
    yield from _slope_tables(result.runs, groups, metric)
    for status, count in counts(result.runs).items():
        if status != "done":
            yield f"{count} runs {status}"
    for finding in result.judgement.findings[:_SHOWN]:
        share = f"{finding.runs} of {_run_count(groups, finding)} runs"
        yield f"{finding.cell}; {finding.estimator}: {share}: {finding.finding}"
    yield (
        f"{result.folder}: {len(result.runs):,} runs, {result.new:,} of them new, in "
        f"{result.wall_s:.1f} s"
    )


def _run_count(groups: Sequence[Group], finding: EstimateFinding) -> int:
    """Return how many runs the group of a finding has."""
    key = (finding.cell, finding.estimator)
    return next(len(group.rows) for group in groups if (group.cell, group.estimator) == key)


def _difference_lines(judgement: Judgement) -> Iterator[str | TextTable]:
    """Yield the best estimator, and the effects of the headline's contests."""
    if len(judgement.headline) > 1:
        yield "; ".join(headline(judgement.headline, judgement.metric, judgement.tolerance))
    for contest in judgement.headline[:_SHOWN]:
        yield contest.line(judgement.metric, judgement.tolerance)
    rows = [
        [
            *(contest.where_text, effect.a, effect.b, effect.size().replace("95 %: ", "")),
            *(effect.at_once(), _number(effect.p), effect.verdict),
        ]
        for contest in judgement.contests
        for effect in contest.effects
        if effect.significant
    ]
    if rows:
        title = f"Significant differences ({len(rows)}; same seeds, Wilcoxon, Holm)"
        constant = {"of"} if len({row[0] for row in rows}) == 1 and rows[0][0] == "all" else set()
        if len({row[-1] for row in rows}) == 1:
            title += f"; A is {rows[0][-1]}"
            constant.add("A is")
        header = ["of", "A", "B", "A than B (95 %)", "all at once", "p", "A is"]
        yield _drop_constant_columns(header, rows[:_SHOWN], title, constant)
    yield from sorted({e.note for c in judgement.contests for e in c.effects if e.note})


def _baseline_tables(judgement: Judgement) -> Iterator[TextTable]:
    """Yield how each group compares with the baseline, worse groups first."""
    effects = sorted(judgement.baseline or [], key=lambda effect: effect.verdict != "worse")
    rows = [
        [effect.a, effect.note or effect.size(), _number(effect.p), effect.verdict]
        for effect in effects
    ]
    if rows:
        title = f"Against the baseline: {judgement.metric}"
        header = ["cell; estimator", "than before", "p", "is"]
        yield TextTable(header, rows[:_SHOWN], title)


def _slope_tables(rows: Sequence[Row], groups: Sequence[Group], metric: str) -> Iterator[TextTable]:
    """Yield the table of the metric's sensitivity to each parameter, if any has one."""
    grid = groups[0].grid if groups else ()
    slope_rows = [
        [group.parameter, group.estimator, *_median_and_interval(slope)]
        for group in slopes(rows, grid, metric)
        if (slope := group.sensitivity.slope)
    ]
    if slope_rows:
        header = ["parameter", "estimator", "slope", "95 % interval"]
        title = f"Sensitivity: d log({metric}) / d log(parameter)"
        yield TextTable(header, slope_rows, title)


def _drop_constant_columns(
    header: Sequence[str], rows: Sequence[Sequence[str]], title: str, columns: Collection[str]
) -> TextTable:
    """Return a table without those of the columns that are the same in all rows.

    :param columns: names of the columns that may be left out; the title says what they have.
    """
    shown = [
        k
        for k, name in enumerate(header)
        if name not in columns or len({row[k] for row in rows}) != 1
    ]
    return TextTable([header[k] for k in shown], [[row[k] for k in shown] for row in rows], title)


def _row(group: Group, metric: str, varying: Sequence[str]) -> list[str]:
    """Return the row of a group in the table of results."""
    values = group.values(metric)  # none of success, whose interval is in summary.csv
    median, p95 = quantile(values, 0.5), quantile(values, 0.95)
    return [
        *(group.labels[name] for name in varying if name != "estimator"),
        group.estimator,
        f"{group.done} of {len(group.rows)}",
        _coverage(group),
        *_median_and_interval(median),
        _number(p95.value),
        _consistency(group),
    ]


_LEAST_SEEDS: Final = 6
"""Values from which the median has an exact 95 % interval: 1 - 2 / 2^6 is above 0.95."""


def _median_and_interval(median: ConfidenceInterval) -> list[str]:
    """Return a median and its interval, or the reason why it has none."""
    if median.value is None:
        return ["-", "no run has it"]
    if median.low is None or median.high is None:
        return [_number(median.value), f"needs {_LEAST_SEEDS} seeds"]
    value, low, high = interval_texts(median.value, median.low, median.high)
    return [value, f"{low} - {high}"]


def _coverage(group: Group) -> str:
    """Return the share of the true values that intervals cover, as text."""
    covered = group.coverage()
    return "-" if covered is None else f"{100.0 * covered:.3g} %"


def _consistency(group: Group) -> str:
    """Return the mean NEES with the band that it lies in if the covariance is right."""
    nees = group.values("nees_position")
    if not len(nees):
        return "not valid" if group.is_invalid("nees_position") else "-"
    low, high = anees_band(3, len(nees))
    return f"{nees.mean():.3g} ({low:.2f} - {high:.2f})"


def _number(value: float | None) -> str:
    """Return a number as text; - if there is none."""
    return "-" if value is None else f"{value:.4g}"
