# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``calibrate``: estimate the deterministic errors of a sensor from calibration runs.

Writes a parameter file for the simulator, a correction for the integrator, and a picture.
"""

import argparse
import inspect
import sys
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.calibration.noise.truth import load_truth
from imu_sim_ros.commands import program
from imu_sim_ros.commands.common import FORCE, outputs
from imu_sim_ros.core.errors import Problems
from imu_sim_ros.core.types import Array
from imu_sim_ros.jobs.calibrate import RUNS
from imu_sim_ros.terminal.signatures import arguments_of, call_job

EXAMPLES: Final = "\n".join(line for run in RUNS.values() for line in run.examples)


def _numbers(text: str) -> Array:
    """Return the magnitudes (n,) of rates separated by commas, as a type of argparse.

    The sign has no meaning: each rate is driven in both directions.
    """
    try:
        values = np.array([abs(float(word)) for word in text.split(",")])
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: numbers separated by commas") from None
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        raise argparse.ArgumentTypeError(f"{text!r}: rates must be finite and not zero")
    return values


_FILES: Final = {
    "-o --output DIR": "folder for the files (default: the name of the run)",
    "--truth NAME|FILE": "compare with the parameters that generated the bag",
    "--no-files": "write no files, print only",
    **FORCE,
    **program.JSON_AND_QUIET,
}
_RATES: Final = {
    "--rates R,R,...": {"type": _numbers, "help": "magnitudes of the table's rates [rad/s]"},
    "--rates-deg R,R,...": {
        "dest": "rates",
        "type": lambda text: np.radians(_numbers(text)),
        "help": "the same [deg/s]",
    },
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser("calibrate", description=__doc__, examples=EXAMPLES)
    kinds = result.add_subparsers(dest="kind", required=True, metavar="RUN")
    for name, run in RUNS.items():
        options = {**arguments_of(run.job), **_FILES}
        subparser = program.add_subcommand(kinds, f"calibrate {name}", run.text, EXAMPLES, options)
        if "rates" in inspect.signature(run.job).parameters:
            program.add_options(subparser.add_mutually_exclusive_group(), _RATES)
    return result


def calibrate(arguments: argparse.Namespace) -> None:
    """Calibrate, write the files and print."""
    written = outputs(arguments)
    folder = arguments.output or Path(arguments.kind)
    names = ["imu.yaml", "correction.yaml", f"{arguments.kind}.png"]
    staging = None if arguments.no_files else written.add_files(folder, names)
    rates = vars(arguments).get("rates")
    with written.stage():
        problems = Problems()
        with problems.collect():
            overrides = {} if rates is None else {"rates": rates}
            calibration = call_job(RUNS[arguments.kind].job, arguments, overrides=overrides)
        if arguments.truth:
            with problems.collect(prefix="--truth: "):
                load_truth(arguments.truth)
        problems.tell()
        for line in calibration.warnings:
            print(f"calibrate: {line}", file=sys.stderr)
        true = calibration.true_values(arguments.truth) if arguments.truth else {}
        if staging is not None:
            for name in names:
                calibration.save(staging / name, for_simulator=name == "imu.yaml")
    files = [] if arguments.no_files else [folder / name for name in names]
    lines = chain(calibration.lines(true), map(str, files))
    program.print_result(arguments, calibration.to_dict(arguments.truth), lines)


main = partial(program.main, parser, calibrate)

if __name__ == "__main__":
    sys.exit(main())
