# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``twin``: fit a simulated sensor to a recording in motion with a true trajectory."""

import argparse
import sys
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Final

from imu_sim_ros.bags.messages.encode import NAV_SAT_FIX
from imu_sim_ros.bags.messages.transforms import JOINT_STATE
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.commands import program
from imu_sim_ros.commands.common import FORCE, outputs
from imu_sim_ros.formats.door import has_topics
from imu_sim_ros.jobs.twin import twin
from imu_sim_ros.terminal.signatures import arguments_of, call_job

EXAMPLES: Final = """
twin flight.bag --truth mocap.tum -o twin
twin imu.csv --truth groundtruth.csv --fit 20s --json
twin flight.mcap --truth flight.mcap --truth-topic /ground_truth/odom --no-files
"""
_FILES: Final = ("twin.yaml", "twin.png")
_OF_AIDING: Final = (NAV_SAT_FIX, JOINT_STATE)
_ARGUMENTS: Final = {
    **arguments_of(twin),
    "--truth POSES": {
        "type": Path,
        "required": True,
        "help": "true poses of the body: TUM or EuRoC text, or a bag",
    },
    "-o --output DIR": {
        "default": Path("twin"),
        "help": "folder for twin.yaml and twin.png (default: twin)",
    },
    "--no-files": "write no files, print only",
    **FORCE,
    **program.JSON_AND_QUIET,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser("twin", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


def run(arguments: argparse.Namespace) -> None:
    """Find the twin, write the files and print."""
    written = outputs(arguments)
    staging = None if arguments.no_files else written.add_files(arguments.output, _FILES)
    with written.stage():
        digital_twin = call_job(twin, arguments, overrides={"truth": arguments.truth})
        if staging is not None:
            from imu_sim_ros.plots import style

            digital_twin.write(staging / _FILES[0])
            style.save(digital_twin.plot(), staging / _FILES[1])
    aiding = _aiding_topics(arguments.recording)
    if aiding and not arguments.quiet:
        print(
            f"twin: {', '.join(aiding)}: not fitted; the twin is that of the IMU. --gnss and "
            "--wheels of generate add those sensors, with the accuracies that their files state; "
            "report compares topics with their truth",
            file=sys.stderr,
        )
    for warning in digital_twin.warnings:
        print(f"twin: warning: {warning}", file=sys.stderr)
    files = [] if arguments.no_files else [str(arguments.output / name) for name in _FILES]
    program.print_result(arguments, digital_twin.to_dict(), chain(digital_twin.lines(), files))


def _aiding_topics(recording: Path) -> list[str]:
    """Return the topics of a recording that receivers and wheels have, without their truth."""
    if not has_topics(recording):
        return []
    with open_bag(recording) as bag:
        topics = [
            topic for topic in bag.topics if topic.count and "ground_truth/" not in topic.name
        ]
    return [t.name for t in topics if t.type in _OF_AIDING or t.name.endswith("wheel/odom")]


main = partial(program.main, parser, run)

if __name__ == "__main__":
    sys.exit(main())
