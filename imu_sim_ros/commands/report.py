# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``report``: write one self-contained HTML page about campaigns or recorded bags."""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

from imu_sim_ros.commands import program
from imu_sim_ros.commands.common import FORCE, outputs
from imu_sim_ros.jobs.report import default_output, report
from imu_sim_ros.terminal.signatures import arguments_of, call_job

EXAMPLES: Final = """
report results
report flight.mcap -o flight.html
report flight.mcap track.csv other.tum -o compared.html --title "Two filters, one flight"
report friday --baseline monday --baseline tuesday
report monday tuesday -o both.html --metric final_position_error_m
"""
_ARGUMENTS: Final = {
    **arguments_of(report),
    "-o --output FILE": "HTML file to write; default: report.html in the first campaign's folder, "
    "or NAME.html for a bag",
    **FORCE,
    **program.JSON_AND_QUIET,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser("report", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


def run(arguments: argparse.Namespace) -> None:
    """Write the page where all that it is about is safe."""
    path = arguments.output or default_output(arguments.inputs)
    inputs = [file for argument in arguments.inputs for file in _files(argument)]
    written = outputs(argparse.Namespace(**{**vars(arguments), "inputs": inputs}))
    page = written.add(path, endings=(".html", ".htm"))
    with written.stage():
        page_report = call_job(report, arguments, overrides={"output": page.path})
    program.show(arguments, replace(page_report, output=path))


def _files(path: Path) -> Iterator[Path]:
    """Yield a campaign's files for its folder, as the page may lie among them."""
    from imu_sim_ros.reports.campaign import is_campaign

    if is_campaign(path):
        yield from (file for file in path.iterdir() if file.suffix != ".html")
    else:
        yield path


main = partial(program.main, parser, run)

if __name__ == "__main__":
    sys.exit(main())
