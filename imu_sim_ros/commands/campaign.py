# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``campaign``: run any estimator over a grid of sensors, motions, faults and seeds."""

import argparse
import shlex
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Final

from imu_sim_ros import program
from imu_sim_ros.commands.common import FORCE
from imu_sim_ros.errors import InputError, MachineError
from imu_sim_ros.machine import cores

EXAMPLES: Final = """
  campaign which_imu -o which_imu
  campaign plan.yaml -o results --workers 2 --baseline last/results.csv
  campaign plan.yaml -o results --resume --scheduler tcp://localhost:8786
"""
GATE_FAILED: Final = 3
"""Exit status if a requirement is not met, or a run is worse than the baseline."""
MANY: Final = 100_000
"""Number of runs from which --yes is required."""


_OPTIONS: Final = {
    "-o --output DIR": "folder for the results",
    "--resume": "continue with the results in the folder",
    **FORCE,
    "--retry-failed": "with --resume: repeat failed runs",
    "--workers N": {
        "default": cores(),
        "help": "worker processes on this machine; default: one per core; 1 starts no worker "
        "process",
    },
    "--scheduler ADDRESS": "run on a Dask cluster, tcp://host:8786",
    "--dask": "run on a local Dask cluster with its dashboard",
    "--worker-timeout S": {
        "type": float,
        "default": 60.0,
        "help": "time to wait for the first worker of a scheduler; default: %(default)g s",
    },
    "--batch N": "seeds per task; default: 50 for built-in estimators, 1 for programs",
    "--baseline FILE": "results.csv or results.parquet of an earlier campaign: end with status "
    f"{GATE_FAILED} if results are significantly worse",
    "--metric NAME": {
        "default": "",
        "help": "metric of the tables and of --baseline; default: ate_rmse_m, or the plan's first",
    },
    "--tolerance SHARE": "difference that does not matter: 5%%, or a number in the metric's unit; "
    "default: the plan's, 2%%",
    "--non-inferiority SHARE": "with --baseline: also end with status "
    f"{GATE_FAILED} unless each result is proven to be less than this share worse: 5%%, or a "
    "number in the metric's unit; with --power: the number of seeds that this proof needs",
    "--junit FILE": "write requirements, verdicts and failures as JUnit XML",
    "--no-report": "write no report.html",
    "--check": "check the plan, print its runs, and exit",
    "--power SHARE": "print the number of seeds needed to find a difference of this size, and "
    "exit; with --non-inferiority, this is the true difference, such as 0%%",
    "--scatter SHARE": {
        "default": "20%",
        "help": "for --power: standard deviation of the logarithm of the ratio of both results on "
        "the same seed ('scatter' in the --json of an earlier campaign); default: %(default)s",
    },
    "--yes": f"confirm {MANY:,} runs or more",
    **program.JSON_AND_QUIET,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="campaign", description=__doc__, examples=EXAMPLES)
    result.add_argument("plan", metavar="PLAN", help="a file, or a name in config/campaigns")
    program.add_options(result, _OPTIONS)
    return result


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
    from imu_sim_ros.jobs import campaign as job

    path, folder = find_plan(arguments.plan), arguments.output
    plan = load_plan(path)
    quiet = arguments.quiet or arguments.json
    workers = job.Workers(
        arguments.workers,
        arguments.scheduler,
        arguments.dask,
        arguments.worker_timeout,
        (lambda line: None) if quiet else print,
    )
    margin = arguments.non_inferiority
    if margin is not None:
        margin = parse_tolerance(margin, "--non-inferiority")
    names = ("resume", "force", "retry_failed", "batch", "metric", "baseline")
    options = job.Options(
        **program.given(arguments, *names),
        tolerance=None if arguments.tolerance is None else parse_tolerance(arguments.tolerance),
        non_inferiority=margin if arguments.power is None else None,
        report=not arguments.no_report,
        command=f"imu_sim campaign {shlex.quote(arguments.plan)} -o {shlex.quote(str(folder))}",
    )
    problems = [*workers.problems(), *options.problems(plan, folder)]
    if not (arguments.check or arguments.power is not None):
        if folder is None:
            problems.append("-o DIR: is needed, the folder of the results")
        if plan.run_count >= MANY and not arguments.yes:
            duration = job.expected_duration(plan, arguments.workers)
            words = f"{duration}; start it with --yes"
            problems.append(f"the plan has {plan.run_count:,} runs: {words}")
    if problems:
        raise InputError(problems)
    check_plan(plan, path)
    if arguments.power is not None:
        wanted, scatter = parse_tolerance(arguments.power), parse_tolerance(arguments.scatter)
        found = job.Power(plan, wanted, scatter, options.tolerance or plan.tolerance, margin)
        program.print_result(arguments, found.to_dict(), found.lines())
        return []
    if arguments.check:
        print(plan.described())
        return []

    def progress(done: int) -> AbstractContextManager[job.Advance]:
        return program.progress("", plan.run_count, quiet, done=done)

    made = job.make(plan, path, folder, workers, options, progress)
    if arguments.junit is not None:
        write_junit(arguments.junit, plan.options.name, made.judgement)
    program.print_result(arguments, made.to_dict(), job.lines(made))
    if made.runs and not made.done:
        raise MachineError([*made.problems, *job.reasons(made.judgement)])
    return made.problems


if __name__ == "__main__":
    sys.exit(main())
