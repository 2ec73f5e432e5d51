# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``evaluate``: compare an estimated trajectory with the truth: ATE, RPE, drift, NEES."""

import argparse
import sys
from functools import partial
from typing import Final

from imu_sim_ros.commands import program
from imu_sim_ros.commands.common import FORCE, output_and_plot, save_plot
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.jobs.evaluate import Evaluation, evaluate
from imu_sim_ros.terminal.signatures import arguments_of, call_job

EXAMPLES: Final = """
evaluate track.csv flight.mcap
evaluate estimate.tum groundtruth.csv --align se3 --rpe 1s --rpe 10m
evaluate vio.tum flight.mcap --align yaw --time-offset
evaluate run.mcap run.mcap --estimate-topic /dead_reckoned/odom --plot errors.png
evaluate flight.mcap flight.mcap --estimate-topic imu/data  # or imu/mag, imu/pressure
"""
_ARGUMENTS: Final = {
    **arguments_of(evaluate),
    "--plot FILE": "write a plot",
    "-o --output FILE": "write the aligned estimate in TUM format",
    **FORCE,
    **program.JSON_AND_QUIET,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser("evaluate", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


def run(arguments: argparse.Namespace) -> None:
    """Compare, write the requested files, and print the results."""
    with output_and_plot(arguments) as (output, plot):
        evaluation = call_job(evaluate, arguments)
        if isinstance(evaluation, Evaluation):
            title = f"{arguments.estimate.name} against {arguments.truth.name}"
            save_plot(plot, lambda: evaluation.plot(title))
            if output is not None:
                evaluation.save(output)
        else:
            options = program.arguments_given(arguments, "plot", "output")
            if options:
                raise InputError([f"--{n}: {evaluation.topic} is no trajectory" for n in options])
    names = {"estimate": str(arguments.estimate), "truth": str(arguments.truth)}
    program.show(arguments, evaluation, **names)


main = partial(program.main, parser, run)

if __name__ == "__main__":
    sys.exit(main())
