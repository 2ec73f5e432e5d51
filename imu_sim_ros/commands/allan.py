# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``allan``: estimate the noise parameters of an IMU at rest, with confidence intervals.

The estimates are maximum likelihood on the cosine spectrum of the record, not lines through the
Allan curve; see imu_sim_ros.calibration.
"""

import argparse
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Final

from imu_sim_ros.calibration.noise.truth import ParameterComparison, load_truth
from imu_sim_ros.commands import program
from imu_sim_ros.commands.common import FORCE, outputs
from imu_sim_ros.core.errors import Problems
from imu_sim_ros.jobs.allan import FILES, Noise, allan, write_files
from imu_sim_ros.terminal.signatures import arguments_of, call_job
from imu_sim_ros.terminal.text_tables import TextTable

EXAMPLES: Final = """
allan rest.mcap -o allan
allan first.bag second.bag --topic /imu0 --model gauss_markov
allan rest.mcap --truth adis16448 --no-files --json
"""


_ARGUMENTS: Final = {
    **arguments_of(allan),
    "-o --output DIR": "folder for the files (default: allan)",
    "--truth NAME|FILE": "compare with the parameters that generated the bag: a name in "
    "config/imus or a file",
    **FORCE,
    "--no-files": "write no files, print only",
    **program.JSON_AND_QUIET,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser("allan", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


def run(arguments: argparse.Namespace) -> None:
    """Analyse, write the files and print."""
    if arguments.truth:  # checked before the work begins
        problems = Problems()
        with problems.collect(prefix="--truth: "):
            load_truth(arguments.truth)
        problems.tell()
    written = outputs(arguments)
    folder = arguments.output or Path("allan")
    staging = None if arguments.no_files else written.add_files(folder, FILES)
    with written.stage():
        noise = call_job(allan, arguments)
        comparisons = noise.compare(arguments.truth) if arguments.truth else []
        if staging is not None:
            write_files(noise, staging, arguments.topic or "/imu0")
    if staging is not None:
        for name in set(FILES) - set(noise.files):  # replaced by nothing: of an earlier record
            (folder / name).unlink(missing_ok=True)
    files = [] if arguments.no_files else [folder / name for name in noise.files]
    compared = (
        {"truth": [comparison.to_dict() for comparison in comparisons]} if comparisons else {}
    )
    result = {**noise.to_dict(), **compared}
    program.print_result(arguments, result, _lines(noise, comparisons, files))


def _lines(
    noise: Noise, comparisons: list[ParameterComparison], files: list[Path]
) -> Iterator[str | TextTable]:
    """Yield the report: the noise, the files written, and axes that are in none of them."""
    yield from noise.lines(comparisons)
    yield from map(str, files)
    if files and noise.result.reasons:
        yield f"no configuration files: {', '.join(noise.result.reasons)} not analysed"


main = partial(program.main, parser, run)

if __name__ == "__main__":
    sys.exit(main())
