# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``calibrate``: estimate the deterministic errors of a sensor from calibration runs.

Writes a parameter file for the simulator, a correction for the integrator, and a picture.
"""

import argparse
import inspect
import sys
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros import program
from imu_sim_ros.calibration.deterministic.positions import FIXTURES
from imu_sim_ros.commands.common import COMMON, GRAVITY_OPTION, outputs
from imu_sim_ros.commands.tables import calibration_lines
from imu_sim_ros.jobs.calibrate import RUNS
from imu_sim_ros.types import Array

EXAMPLES: Final = "\n".join(line for run in RUNS.values() for line in run.examples)


def _numbers(words: str) -> Array:
    try:
        values = np.array([abs(float(word)) for word in words.split(",")])
    except ValueError:
        raise argparse.ArgumentTypeError(f"{words!r}: numbers separated by commas") from None
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        raise argparse.ArgumentTypeError(f"{words!r}: rates must be finite and not zero")
    return values


_FIRST: Final = {
    "bag BAG": "bag, EuRoC folder or CSV file",
    "--topic TOPIC": "topic of the readings, if the bag has several",
    "-o --output DIR": "folder for the files (default: the name of the run)",
    "--truth NAME|FILE": "compare with the parameters that generated the bag",
    "--no-files": "write no files, print only",
    **COMMON,
}
_RATES: Final = {
    "--rates R,R,...": {"type": _numbers, "help": "magnitudes of the table's rates [rad/s]"},
    "--rates-deg R,R,...": {
        "dest": "rates",
        "type": lambda words: np.radians(_numbers(words)),
        "help": "the same [deg/s]",
    },
}
_REFERENCE: Final = "reference temperature T0 of the polynomials [degC] (default: %(default)g)"
_OWN: Final[dict[str, dict[str, Any]]] = {
    "gravity": GRAVITY_OPTION,
    "simple": {"--simple": "bias and scale only, without misalignment"},
    "fixture": {
        "--fixture": {
            "choices": FIXTURES,
            "help": "exact: each axis points exactly up and down; norm: ten or more rests in "
            "any positions, fits the norm of gravity with an upper triangular S; auto: chooses by "
            "a test of the residuals (default: %(default)s)",
        }
    },
    "truth_topic": {
        "--truth-topic TOPIC": "Odometry topic to take the rates from if none are given"
    },
    "accelerometer": {
        "--accelerometer FILE": "correction.yaml of a six-position run, for a tilted table: "
        "take the specific force from the accelerometer"
    },
    "temperature_topic": {
        "--temperature-topic TOPIC": "sensor_msgs/Temperature topic, if the bag has several"
    },
    "reference": {"--reference DEGC": {"type": float, "help": _REFERENCE}},
    "strength": {
        "--field T": {
            "dest": "strength",
            "type": float,
            "help": "strength of the Earth's field [T]; without it, the soft iron is scaled "
            "to determinant 1",
        }
    },
}
"""Options of the jobs that have a parameter of this name; its default is theirs."""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser("calibrate", description=__doc__, examples=EXAMPLES)
    kinds = result.add_subparsers(dest="kind", required=True, metavar="RUN")
    for name, run in RUNS.items():
        own = program.add_subcommand(kinds, f"calibrate {name}", run.text, EXAMPLES, _FIRST)
        parameters = inspect.signature(run.job).parameters
        if "rates" in parameters:
            program.add_options(own.add_mutually_exclusive_group(), _RATES)
        for parameter, option in _OWN.items():
            if parameter in parameters:
                own.set_defaults(**{parameter: parameters[parameter].default})
                program.add_options(own, option)
    return result


def calibrate(arguments: argparse.Namespace) -> None:
    """Calibrate, write the files and print."""
    written = outputs(arguments)
    folder = arguments.output or Path(arguments.kind)
    names = ["imu.yaml", "correction.yaml", f"{arguments.kind}.png"]
    staging = None if arguments.no_files else written.add_files(folder, names)
    job = RUNS[arguments.kind].job
    own = inspect.signature(job).parameters.keys() & vars(arguments).keys()
    with written:
        found = job(arguments.bag, **program.given(arguments, *own))
        for line in found.warnings:
            print(f"calibrate: {line}", file=sys.stderr)
        true = found.true_values(arguments.truth) if arguments.truth else {}
        if staging is not None:
            for name in names:
                found.save(staging / name, for_simulator=name == "imu.yaml")
    files = [] if arguments.no_files else [folder / name for name in names]
    lines = calibration_lines(found.parameters, found.facts, true, files)
    program.print_result(arguments, found.to_dict(arguments.truth), lines)


main = partial(program.main, parser, calibrate)
