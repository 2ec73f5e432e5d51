# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``campaign``: run any estimator over a grid of sensors, motions, faults and seeds."""

import argparse
import contextlib
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from imu_sim_ros import program
from imu_sim_ros.commands.outputs import add_force
from imu_sim_ros.errors import InputError, MachineError
from imu_sim_ros.machine import cores

if TYPE_CHECKING:
    from imu_sim_ros.campaigns.metrics import Tolerance
    from imu_sim_ros.campaigns.plan import Plan
    from imu_sim_ros.campaigns.results import Row
    from imu_sim_ros.campaigns.summary import Group
    from imu_sim_ros.campaigns.verdict import Contest, Judgement
    from imu_sim_ros.jobs.campaign import Campaign

EXAMPLES: Final = """
  campaign which_imu -o which_imu
  campaign plan.yaml -o results --workers 2 --baseline last/results.csv
  campaign plan.yaml -o results --resume --scheduler tcp://localhost:8786
"""
GATE_FAILED: Final = 3
"""Exit status if a requirement is not met, or a run is worse than the baseline."""
MANY: Final = 100_000
"""Number of runs from which --yes is required."""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(
        prog="campaign",
        description=__doc__,
        examples=EXAMPLES,
    )
    result.add_argument("plan", metavar="PLAN", help="a file, or a name in config/campaigns")
    result.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder for the results")
    result.add_argument(
        "--resume", action="store_true", help="continue with the results in the folder"
    )
    add_force(result)
    result.add_argument(
        "--retry-failed", action="store_true", help="with --resume: repeat failed runs"
    )
    _add_engine_arguments(result)
    _add_gate_arguments(result)
    result.add_argument("--no-report", action="store_true", help="write no report.html")
    result.add_argument(
        "--check", action="store_true", help="check the plan, print its runs, and exit"
    )
    result.add_argument(
        "--power",
        metavar="SHARE",
        help="print the number of seeds needed to find a difference of this size, and exit",
    )
    result.add_argument(
        "--scatter",
        metavar="SHARE",
        default="20%",
        help="for --power: scatter of the ratio of both results on the same seed (its logarithm's "
        "standard deviation, 'scatter' of an earlier campaign's --json); default: %(default)s",
    )
    result.add_argument("--yes", action="store_true", help=f"confirm {MANY:,} runs or more")
    program.add_output_arguments(result)
    return result


def _add_gate_arguments(result: argparse.ArgumentParser) -> None:
    """Add the arguments for comparisons and for the gate."""
    result.add_argument(
        "--baseline",
        type=Path,
        metavar="FILE",
        help="results.csv or results.parquet of an earlier campaign: end with "
        f"status {GATE_FAILED} if results are significantly worse",
    )
    result.add_argument(
        "--metric",
        default="",
        metavar="NAME",
        help="metric of the tables and of --baseline; default: ate_rmse_m, or the plan's first",
    )
    result.add_argument(
        "--tolerance",
        metavar="SHARE",
        help="difference that does not matter: 5%%, or a number in the metric's unit; default: the "
        "plan's, 2%%",
    )
    result.add_argument(
        "--junit",
        type=Path,
        metavar="FILE",
        help="write requirements, verdicts and failures as JUnit XML",
    )


def _add_engine_arguments(result: argparse.ArgumentParser) -> None:
    """Add the arguments that select where the runs are made."""
    result.add_argument(
        "--workers",
        type=int,
        metavar="N",
        default=cores(),
        help="processes on this machine; default: one per core (%(default)s); 1 starts no "
        "further one",
    )
    result.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on a Dask cluster, tcp://host:8786"
    )
    result.add_argument(
        "--dask", action="store_true", help="run on a local Dask cluster with its dashboard"
    )
    result.add_argument(
        "--worker-timeout",
        type=float,
        metavar="S",
        default=60.0,
        help="time to wait for the first worker of a scheduler; default: %(default)g s",
    )
    result.add_argument(
        "--batch",
        type=int,
        metavar="N",
        help="seeds in a task; default: 50 for built-in estimators, 1 for programs",
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    gate: list[str] = []
    status = program.main(parser, lambda arguments: gate.extend(run(arguments)), argv)
    for line in gate:
        print(f"campaign: {line}", file=sys.stderr)
    return GATE_FAILED if gate and not status else status


def run(arguments: argparse.Namespace) -> list[str]:
    """Run a campaign; return a line for every requirement that is not met."""
    from imu_sim_ros.campaigns.junit import write_junit
    from imu_sim_ros.campaigns.metrics import parse_tolerance
    from imu_sim_ros.campaigns.plan import check_plan, find_plan, load_plan
    from imu_sim_ros.jobs.campaign import Options, Workers, make

    path, folder = find_plan(arguments.plan), arguments.output
    plan = load_plan(path)
    quiet = arguments.quiet or arguments.json
    workers = Workers(
        arguments.workers,
        arguments.scheduler,
        arguments.dask,
        arguments.worker_timeout,
        (lambda line: None) if quiet else print,
    )
    options = Options(
        resume=arguments.resume,
        force=arguments.force,
        retry_failed=arguments.retry_failed,
        batch=arguments.batch,
        metric=arguments.metric,
        baseline=arguments.baseline,
        tolerance=None if arguments.tolerance is None else parse_tolerance(arguments.tolerance),
        report=not arguments.no_report,
        command=f"campaign {shlex.quote(arguments.plan)} -o {shlex.quote(str(folder))}",
    )
    problems = [*workers.problems(), *options.problems(plan, folder), *_problems(arguments, plan)]
    if problems:
        raise InputError(problems)
    check_plan(plan, path)
    if arguments.power is not None:
        _print_power(arguments, plan, options.tolerance or plan.tolerance)
        return []
    if arguments.check:
        print(_described(plan))
        return []
    found = make(plan, path, folder, workers, options, partial(_bar, plan, folder, quiet))
    if arguments.junit is not None:
        write_junit(arguments.junit, plan.options.name, found.judgement)
    if arguments.json:
        program.print_json(found.to_dict())
    elif not arguments.quiet:
        _print(found)
    if found.runs and not found.done:
        reasons = [f"no run is done: {one}" for one in _reasons(found.judgement)]
        raise MachineError([*found.problems, *reasons])
    return found.problems


def _reasons(found: "Judgement") -> list[str]:
    """Return why runs failed, each reason once."""
    counted: dict[str, int] = {}
    for failure in found.failures:
        counted[failure.reason] = counted.get(failure.reason, 0) + failure.runs
    return [f"{runs:,} x {reason}" for reason, runs in list(counted.items())[:10]]


@contextlib.contextmanager
def _bar(
    plan: "Plan", folder: Path, quiet: bool, there: int
) -> Iterator[Callable[[Sequence["Row"]], None]]:
    """Show a bar while the runs are made."""
    from imu_sim_ros.campaigns.campaign import Tally

    tally = Tally(plan, there)
    with program.progress("", plan.run_count, quiet, done=there) as advance:
        advance(0, tally.add([]))
        try:
            yield lambda rows: advance(len(rows), tally.add(rows))
        except KeyboardInterrupt as stop:
            stop.args = (f"{folder} has the runs made so far; continue with --resume",)
            raise


def _problems(arguments: argparse.Namespace, plan: "Plan") -> Iterator[str]:
    """Yield the problems with the command's own arguments."""
    runs = not (arguments.check or arguments.power)
    if arguments.output is None and runs:
        yield "-o DIR: is needed, the folder of the results"
    if plan.run_count >= MANY and runs and not arguments.yes:
        yield f"the plan has {plan.run_count:,} runs: {_duration(arguments, plan)}"


def _duration(arguments: argparse.Namespace, plan: "Plan") -> str:
    """Return how long a campaign takes, from its first run; of programs only their limit says."""
    from imu_sim_ros.campaigns import campaign
    from imu_sim_ros.campaigns.parameters import CommandEstimator

    total, words = campaign.seconds_of_all_runs(plan), "at"
    if total is None:
        limits = (e.timeout for e in plan.estimators.values() if isinstance(e, CommandEstimator))
        total, words = plan.run_count * max(limits), "at up to"
    one, hours = total / plan.run_count, total / max(arguments.workers, 1) / 3600.0
    each = f"{one * 1e3:.2g} ms" if one < 1.0 else f"{one:.3g} s"
    processes = "1 process" if arguments.workers == 1 else f"{arguments.workers} processes"
    about = f"about {max(hours, 0.1):,.1f} hours on {processes}"
    return f"{words} {each} each {about}; start it with --yes"


def _print_power(arguments: argparse.Namespace, plan: "Plan", tolerance: "Tolerance") -> None:
    """Print the chance to find a difference with the plan's seeds, and the seeds it takes."""
    from imu_sim_ros.campaigns.cells import cell_count
    from imu_sim_ros.campaigns.metrics import parse_tolerance
    from imu_sim_ros.campaigns.statistics import power, seeds_needed

    wanted, scatter = (parse_tolerance(word) for word in (arguments.power, arguments.scatter))
    shares = {"--power": wanted, "--scatter": scatter, "tolerance": tolerance}
    problems = [
        f"{name} {share}: must be a share such as 10 %"
        for name, share in shares.items()
        if not share.relative
    ]
    if not problems and wanted.value <= tolerance.value:
        problems.append(f"--power {wanted}: must be above the tolerance, {tolerance}")
    if scatter.value <= 0.0:
        problems.append(f"--scatter {scatter}: must be above 0")
    if problems:
        raise InputError(problems)
    comparisons = cell_count(plan.axes) * len(plan.estimators)
    sizes = (wanted.value, scatter.value, tolerance.value, comparisons)
    chance = power(len(plan.seeds), *sizes)
    needed = {share: seeds_needed(share, *sizes) for share in (0.5, 0.8, 0.95)}
    if arguments.json:
        program.print_json(
            {
                "difference": wanted.value,
                "scatter": scatter.value,
                "tolerance": tolerance.value,
                "comparisons": comparisons,
                "seeds": len(plan.seeds),
                "power": chance,
                "seeds_needed": {f"{share:g}": seeds for share, seeds in needed.items()},
            }
        )
        return
    print(
        f"A difference of {wanted} beyond a tolerance of {tolerance}, scatter {scatter}, "
        f"{comparisons} comparison{'s' * (comparisons != 1)}: the plan's {len(plan.seeds)} seeds "
        f"find it in {100.0 * chance:.0f} % of campaigns"
    )
    for share, seeds in needed.items():
        shown = "more than 100,000" if seeds is None else f"{seeds:,}"
        print(f"{100.0 * share:.0f} %: {shown} seeds")


def _described(plan: "Plan") -> str:
    from imu_sim_ros.campaigns.cells import cell_count

    counts = ((cell_count(plan.axes), "cell"), (len(plan.seeds), "seed"))
    factors = (*counts, (len(plan.estimators), "estimator"))
    shown = " x ".join(f"{count} {word}{'s' * (count != 1)}" for count, word in factors)
    return f"{plan.options.name}: {shown} = {plan.run_count:,} run{'s' * (plan.run_count != 1)}"


def _print(made: "Campaign") -> None:
    from imu_sim_ros.campaigns.summary import groups
    from imu_sim_ros.campaigns.verdict import counts

    metric, found = made.judgement.metric, groups(made.runs, made.plan.grid_names)
    rows = [_row(group, metric) for group in found[:_SHOWN]]
    header = ["cell", "estimator", "done", "median", "95 % interval", "p95", "NEES (band)"]
    program.print_table(header, rows, f"{metric}, median with 95 % interval")
    if len(found) > _SHOWN:
        print(f"{len(found) - _SHOWN} more in {made.folder / 'summary.csv'}")
    _print_differences(made.judgement)
    _print_baseline(made.judgement)
    _print_slopes(made.runs, found, metric)
    for status, count in counts(made.runs).items():
        if status != "done":
            print(f"{count} runs {status}")
    print(
        f"{made.folder}: {len(made.runs):,} runs, {made.new:,} of them new, in {made.wall_s:.1f} s"
    )


def _print_differences(found: "Judgement") -> None:
    """Print who is best, and the effects of the headline's contests."""
    for contest in found.headline[:_SHOWN]:
        print(contest.line(found.metric))
    rows = [
        [_place(contest), effect.a, effect.b, effect.size(), _number(effect.p), effect.verdict]
        for contest in found.contests
        for effect in contest.effects
        if effect.significant
    ]
    if rows:
        title = f"Significant differences ({len(rows)}; same seeds, Wilcoxon, Holm)"
        program.print_table(["of", "A", "B", "A than B", "p", "A is"], rows[:_SHOWN], title)
    for note in sorted({e.note for c in found.contests for e in c.effects if e.note}):
        print(note)


def _print_baseline(found: "Judgement") -> None:
    """Print how each group compares with the baseline, worse groups first."""
    effects = sorted(found.baseline or [], key=lambda effect: effect.verdict != "worse")
    rows = [[one.a, one.note or one.size(), _number(one.p), one.verdict] for one in effects]
    if rows:
        title = f"Against the baseline: {found.metric}"
        header = ["cell; estimator", "than before", "p", "is"]
        program.print_table(header, rows[:_SHOWN], title)


def _place(contest: "Contest") -> str:
    return ", ".join(f"{name}={word}" for name, word in contest.where.items()) or "all"


def _print_slopes(rows: Sequence["Row"], found: Sequence["Group"], metric: str) -> None:
    from imu_sim_ros.campaigns.summary import slopes

    grid = found[0].grid if found else ()
    slopes_of = [
        [one.parameter, one.estimator, _number(slope.value), f"{slope.low:.3g} - {slope.high:.3g}"]
        for one in slopes(rows, grid, metric)
        if (slope := one.sensitivity.slope)
    ]
    if slopes_of:
        header = ["parameter", "estimator", "slope", "95 % interval"]
        title = f"Sensitivity: d log({metric}) / d log(parameter)"
        program.print_table(header, slopes_of, title)


_SHOWN: Final = 40


def _row(group: "Group", metric: str) -> list[str]:
    from imu_sim_ros.campaigns.statistics import quantile

    values = group.values(metric)  # none of success, whose interval is in summary.csv
    median, p95 = quantile(values, 0.5), quantile(values, 0.95)
    ends = [_number(end) for end in (median.low, median.high)]
    return [
        group.cell,
        group.estimator,
        f"{group.done} of {len(group.rows)}",
        _number(median.value),
        " - ".join(ends),
        _number(p95.value),
        _consistency(group),
    ]


def _consistency(group: "Group") -> str:
    """Return the mean NEES with the band that it lies in if the covariance is right."""
    nees = group.values("nees_position")
    if not len(nees):
        return "not valid" if group.not_valid("nees_position") else "-"
    from imu_sim_ros.navigation.evaluation import anees_band

    low, high = anees_band(3, len(nees))
    return f"{nees.mean():.3g} ({low:.2f} - {high:.2f})"


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.4g}"


if __name__ == "__main__":
    sys.exit(main())
