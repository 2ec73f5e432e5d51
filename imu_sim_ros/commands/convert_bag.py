# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``convert_bag``: convert a bag or dataset to another format; recover interrupted bags."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from imu_sim_ros import program
from imu_sim_ros.commands import bag_output
from imu_sim_ros.commands.inputs import add_skip_bad_rows
from imu_sim_ros.commands.outputs import outputs
from imu_sim_ros.jobs.convert import IMAGES, ConvertOptions, write

EXAMPLES: Final = """
  convert_bag recording -o recording.bag --compression lz4  # rosbag2 -> ROS 1
  convert_bag flight.bag -o flight/mav0 --format euroc  # ROS 1 -> EuRoC
  convert_bag MH_01_easy -o MH_01.mcap --images compressed  # EuRoC -> MCAP, with its images
  convert_bag torn.mcap -o whole.mcap --recover  # an interrupted recording
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(
        prog="convert_bag",
        description=__doc__,
        examples=EXAMPLES,
    )
    result.add_argument(
        "input", type=Path, help="ROS 1 bag, .mcap, rosbag2 folder, EuRoC folder or CSV file"
    )
    bag_output.add_arguments(result)
    result.add_argument(
        "--topics", metavar="NAME,...", default="", help="topics to convert (default: all)"
    )
    result.add_argument(
        "--images",
        choices=IMAGES,
        help="messages for a folder's images (default: raw); select a bag's images with --topics",
    )
    result.add_argument(
        "--recover",
        action="store_true",
        help="recover all complete messages of an interrupted or damaged bag",
    )
    add_skip_bad_rows(result)
    program.add_output_arguments(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, convert_bag, argv)


def convert_bag(arguments: argparse.Namespace) -> None:
    """Convert the input as the arguments say."""
    form = bag_output.whole_form(arguments)
    options = ConvertOptions(arguments.images, arguments.recover)
    watcher = bag_output.watcher(arguments, "convert_bag", "convert_bag: ")
    made = write(arguments.input, arguments.output, form, options, outputs(arguments), watcher)
    _report(made.to_dict(), arguments)


def _report(result: dict[str, Any], arguments: argparse.Namespace) -> None:
    if arguments.json:
        program.print_json(result)
        return
    if arguments.quiet:
        return
    counts = ", ".join(f"{count:,} {name}" for name, count in result["messages"].items())
    word = "recovered" if result["recovered"] else "written"
    last_ns = result["last_stamp_ns"]
    until = f", up to stamp {last_ns / 1e9:.9f} s" if last_ns is not None else ""
    print(f"{result['output']}: {word}: {counts or 'no messages'}{until}")


if __name__ == "__main__":
    sys.exit(main())
