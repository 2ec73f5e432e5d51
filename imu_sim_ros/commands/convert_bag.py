# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``convert_bag``: convert a bag or dataset to another format; recover interrupted bags."""

import argparse
import sys
from functools import partial
from typing import Final

from imu_sim_ros import program
from imu_sim_ros.commands import bag_output
from imu_sim_ros.commands.common import SKIP_BAD_ROWS, outputs
from imu_sim_ros.jobs.convert import IMAGES, ConvertOptions, write

EXAMPLES: Final = """
  convert_bag recording -o recording.bag --compression lz4  # rosbag2 -> ROS 1
  convert_bag flight.bag -o flight/mav0 --format euroc  # ROS 1 -> EuRoC
  convert_bag MH_01_easy -o MH_01.mcap --images compressed  # EuRoC -> MCAP, with its images
  convert_bag torn.mcap -o whole.mcap --recover  # an interrupted recording
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    arguments = bag_output.INPUT
    result = program.Parser(
        "convert_bag", description=__doc__, examples=EXAMPLES, arguments=arguments
    )
    bag_output.add_arguments(result)
    program.add_options(result, _OPTIONS)
    return result


_OPTIONS: Final = {
    "--topics NAME,...": {"default": "", "help": "topics to convert (default: all)"},
    "--images": {
        "choices": IMAGES,
        "help": "messages for a folder's images (default: raw); select a bag's images with "
        "--topics",
    },
    "--recover": "recover all complete messages of an interrupted or damaged bag",
    **SKIP_BAD_ROWS,
    **program.JSON_AND_QUIET,
}


def convert_bag(arguments: argparse.Namespace) -> None:
    """Convert the input as the arguments say."""
    form = bag_output.whole_form(arguments)
    options = ConvertOptions(arguments.images, arguments.recover)
    watcher = bag_output.watcher(arguments, "convert_bag", "convert_bag: ")
    made = write(arguments.input, arguments.output, form, options, outputs(arguments), watcher)
    counts = bag_output.counts(made.messages) or "no messages"
    last_ns = made.last_stamp_ns
    until = f", up to stamp {last_ns / 1e9:.9f} s" if last_ns is not None else ""
    word = "recovered" if made.recovered else "written"
    lines = [f"{made.output}: {word}: {counts}{until}"]
    if made.not_converted:
        lines.append(f"{made.output}: has no place for {', '.join(made.not_converted)}")
    program.print_result(arguments, made.to_dict(), lines)


main = partial(program.main, parser, convert_bag)

if __name__ == "__main__":
    sys.exit(main())
