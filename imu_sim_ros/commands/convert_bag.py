# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``convert_bag``: convert a bag or dataset to another format; recover interrupted bags."""

import argparse
import sys
from functools import partial
from typing import Final

from imu_sim_ros.commands import program
from imu_sim_ros.jobs.convert import convert
from imu_sim_ros.terminal.signatures import arguments_of, call_job

EXAMPLES: Final = """
  convert_bag recording -o recording.bag --compression lz4  # rosbag2 -> ROS 1
  convert_bag flight.bag -o flight/mav0 --format euroc  # ROS 1 -> EuRoC
  convert_bag MH_01_easy -o MH_01.mcap --images compressed  # EuRoC -> MCAP, with its images
  convert_bag torn.mcap -o whole.mcap --recover  # an interrupted recording
"""
_ARGUMENTS: Final = {**arguments_of(convert), **program.JSON_AND_QUIET}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser(
        "convert_bag", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS
    )


def convert_bag(arguments: argparse.Namespace) -> None:
    """Convert the input as the arguments say."""
    program.show(arguments, call_job(convert, arguments))


main = partial(program.main, parser, convert_bag)

if __name__ == "__main__":
    sys.exit(main())
