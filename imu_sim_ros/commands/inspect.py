# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``inspect``: list what recordings contain and what is wrong with them, worst first."""

import argparse
import sys
from collections.abc import Sequence
from typing import Final

from imu_sim_ros.commands import program
from imu_sim_ros.commands.common import FORCE, outputs
from imu_sim_ros.jobs.inspect import inspect
from imu_sim_ros.recordings.findings.finding import Finding
from imu_sim_ros.terminal.signatures import arguments_of, call_job

EXAMPLES: Final = """
inspect flight.mcap
inspect rest.bag imu.csv --json
inspect recording.mcap --fail-on error,samples_lost
inspect recording.mcap -o recording.html
"""
FINDINGS_STATUS: Final = 3
"""Exit status if a recording has a finding of ``--fail-on``."""
_ARGUMENTS: Final = {
    **arguments_of(inspect),
    "--fail-on KIND,...": "exit with status 3 if there is a finding of these kinds; error, warning "
    "and note stand for all findings of at least that severity",
    "-o --output FILE": "write an HTML page",
    **FORCE,
    **program.JSON_AND_QUIET,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser("inspect", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    failures: list[Finding] = []
    status = program.main(parser, lambda arguments: failures.extend(run(arguments)), argv)
    for kind in dict.fromkeys(finding.kind for finding in failures):
        print(f"inspect: --fail-on: {kind}", file=sys.stderr)
    return FINDINGS_STATUS if failures and not status else status


def run(arguments: argparse.Namespace) -> list[Finding]:
    """Inspect, write the page and print; returns the findings of ``--fail-on``."""
    kinds = [kind.strip() for kind in (arguments.fail_on or "").split(",") if kind.strip()]
    written = outputs(arguments)
    page = None
    if arguments.output is not None:
        page = written.add(arguments.output, endings=(".html", ".htm"))
    with written.stage():
        inspection = call_job(inspect, arguments)
        failures = inspection.select(kinds)
        if page is not None:
            inspection.save(page.path)
    program.show(arguments, inspection)
    return failures


if __name__ == "__main__":
    sys.exit(main())
