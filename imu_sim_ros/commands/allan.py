# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``allan``: estimate the noise parameters of an IMU at rest, with confidence intervals.

The estimates are maximum likelihood on the cosine spectrum of the record, not lines through the
Allan curve; see imu_sim_ros.calibration.
"""

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Final

from imu_sim_ros import program
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.calibration.noise.analysis import MODELS
from imu_sim_ros.calibration.noise.truth import load_truth
from imu_sim_ros.commands.common import FORCE, SKIP_BAD_ROWS, outputs, skipped_rows
from imu_sim_ros.errors import InputError
from imu_sim_ros.jobs.allan import FILES, Noise, lines, of_files, write_files

EXAMPLES: Final = """
allan rest.mcap -o allan
allan first.bag second.bag --topic /imu0 --model gauss_markov
allan rest.mcap --truth adis16448 --no-files --json
"""


_ARGUMENTS: Final = {
    "bags BAG": {
        "nargs": "+",
        "help": "bag, EuRoC folder or CSV file of one IMU at rest; several bags are combined",
    },
    "--topic TOPIC": "sensor_msgs/Imu topic, if a bag has several",
    "-o --output DIR": "folder for the files (default: allan)",
    "--model": {
        "choices": MODELS,
        "default": "standard",
        "help": "standard: Q, N, B, K and R as far as the data resolve them; gauss_markov: white "
        "noise and a first-order Gauss-Markov process",
    },
    "--truth NAME|FILE": "compare with the parameters that generated the bag: a name in "
    "config/imus or a file",
    "--skip-checks": "continue when a check of the data fails",
    **SKIP_BAD_ROWS,
    **FORCE,
    "--no-files": "write no files, print only",
    **program.JSON_AND_QUIET,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser("allan", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


def allan(arguments: argparse.Namespace) -> None:
    """Analyse, write the files and print."""
    if arguments.truth:
        load_truth(arguments.truth)  # before the work begins
    written = outputs(arguments)
    folder = arguments.output or Path("allan")
    staging = None if arguments.no_files else written.add_files(folder, FILES)
    with written:
        found = _analysed(arguments)
        comparisons = found.compare(arguments.truth) if arguments.truth else []
        if staging is not None:
            write_files(found, staging, arguments.topic or "/imu0")
    if staging is not None:
        for name in set(FILES) - set(found.files):  # replaced by nothing: of an earlier record
            (folder / name).unlink(missing_ok=True)
    files = [] if arguments.no_files else [folder / name for name in found.files]
    compared = {"truth": [one.to_dict() for one in comparisons]} if comparisons else {}
    result = {**found.to_dict(), **compared}
    program.print_result(arguments, result, lines(found.result, comparisons, files))


def _analysed(arguments: argparse.Namespace) -> Noise:
    count = sum(_count(bag, arguments.topic) for bag in arguments.bags)
    with program.progress("read", count, arguments.quiet or arguments.json) as advance:
        return of_files(
            arguments.bags,
            arguments.model,
            arguments.skip_checks,
            arguments.topic,
            lambda path: skipped_rows(arguments, "allan", path),
            advance,
        )


def _count(path: Path, topic: str | None) -> int:
    """Return how many messages will be read, for the progress bar; 0 for text files."""
    if not sys.stderr.isatty():
        return 0
    try:
        with open_bag(path) as bag:
            return sum(
                info.count
                for info in bag.topics
                if info.type == "sensor_msgs/msg/Imu" and topic in (None, info.name)
            )
    except InputError:  # not a bag: a dataset, or the reader will say what is wrong
        return 0


main = partial(program.main, parser, allan)
