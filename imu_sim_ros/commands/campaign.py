# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``campaign``: run any estimator over a grid of sensors, motions, faults and seeds."""

import argparse
import shlex
import sys
from collections.abc import Sequence
from typing import Final

from imu_sim_ros.bags.threads import core_count
from imu_sim_ros.campaigns.junit import write_junit
from imu_sim_ros.campaigns.metrics import parse_tolerance
from imu_sim_ros.campaigns.plan import check_plan, find_plan, load_plan
from imu_sim_ros.commands import program
from imu_sim_ros.core.errors import InputError, MachineError
from imu_sim_ros.jobs.campaign import Limits, Power, campaign, duration_text, failure_reasons
from imu_sim_ros.terminal.signatures import arguments_of, call_job

EXAMPLES: Final = """
  campaign which_imu -o which_imu
  campaign plan.yaml -o results --workers 2 --baseline last/results.csv
  campaign plan.yaml -o results --resume --scheduler tcp://localhost:8786
"""
GATE_FAILED: Final = 3
"""Exit status if a requirement is not met, or a run is worse than the baseline."""
MANY: Final = 100_000
"""Number of runs from which --yes is required."""


_ARGUMENTS: Final = {
    **arguments_of(campaign),
    "-o --output DIR": "folder for the results",
    "--junit FILE": "write requirements, verdicts and failures as JUnit XML",
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
    return program.Parser("campaign", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    gate: list[str] = []
    status = program.main(parser, lambda arguments: gate.extend(run(arguments)), argv)
    for line in gate:
        print(f"campaign: {line}", file=sys.stderr)
    return GATE_FAILED if gate and not status else status


def run(arguments: argparse.Namespace) -> list[str]:
    """Run a campaign; return a line for every requirement that is not met."""
    if arguments.power is not None or arguments.check:
        _look_at(arguments)
        return []
    problems = []
    plan, folder = load_plan(find_plan(arguments.plan)), arguments.output
    if folder is None:
        problems.append("-o DIR: is needed, the folder of the results")
    processes = core_count() if arguments.workers is None else arguments.workers
    if plan.run_count >= MANY and not arguments.yes:
        advice = f"{duration_text(plan, processes)}; start it with --yes"
        problems.append(f"the plan has {plan.run_count:,} runs: {advice}")
    if problems:
        raise InputError(problems)
    command = f"imu_sim campaign {shlex.quote(arguments.plan)} -o {shlex.quote(str(folder))}"
    outcome = call_job(campaign, arguments, {"workers": core_count()}, {"command": command})
    if arguments.junit is not None:
        write_junit(arguments.junit, plan.options.name, outcome.judgement)
    program.show(arguments, outcome)
    if outcome.runs and not outcome.done:
        raise MachineError([*outcome.problems, *failure_reasons(outcome.judgement)])
    return outcome.problems


def _look_at(arguments: argparse.Namespace) -> None:
    """Print the runs that a plan contains, or the seeds that it needs."""
    path = find_plan(arguments.plan)
    plan = load_plan(path)
    check_plan(plan, path)
    if arguments.power is None:
        print(plan.title())
        return
    effect = parse_tolerance(arguments.power, "--power")
    scatter = parse_tolerance(arguments.scatter, "--scatter")
    limits = Limits.of(arguments.tolerance, arguments.non_inferiority)
    tolerance = limits.tolerance or plan.tolerance
    program.show(arguments, Power(plan, effect, scatter, tolerance, limits.non_inferiority))


if __name__ == "__main__":
    sys.exit(main())
