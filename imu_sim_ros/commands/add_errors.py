# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``add_errors``: another simulator's ideal readings in, those of a chosen sensor out."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from imu_sim_ros import program
from imu_sim_ros.commands import bag_output
from imu_sim_ros.commands.inputs import add_skip_bad_rows
from imu_sim_ros.commands.outputs import outputs
from imu_sim_ros.jobs.add_errors_bag import OFFERED, USUAL
from imu_sim_ros.jobs.add_errors_files import FORMATS, ErrorOptions, write
from imu_sim_ros.simulation.error_parameters import NODE

EXAMPLES: Final = """
  add_errors ideal.mcap -o noisy.mcap --imu bmi088 --seed 3
  add_errors gazebo.bag -o noisy.bag --imu model.sdf --input-topic /imu
  add_errors airsim.mcap -o noisy.mcap --imu mpu6000 --set input.axes=frd
  add_errors MH_99 -o MH_99_noisy --format euroc --imu adis16448
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="add_errors", description=__doc__, examples=EXAMPLES)
    result.add_argument(
        "input", type=Path, help="ROS 1 bag, .mcap, rosbag2 folder, EuRoC folder or CSV file"
    )
    bag_output.add_arguments(result, FORMATS)
    group = result.add_argument_group("sensor")
    group.add_argument(
        "--imu",
        metavar="NAME|FILE",
        help="sensor: a preset (see generate --list-imus) or a file, model.sdf too",
    )
    group.add_argument(
        "--rate", metavar="HZ", type=float, help="readings per second (those of the input)"
    )
    group.add_argument("--seed", metavar="N", type=int, help="seed of all random streams")
    group = result.add_argument_group("topics")
    group.add_argument(
        "--input-topic",
        metavar="NAME",
        help="the ideal readings (the only sensor_msgs/Imu), or odometry",
    )
    group.add_argument(
        "--topics",
        metavar="NAME,...",
        default="",
        help=f"what is added ({','.join(USUAL)}), of {', '.join(OFFERED)}",
    )
    group.add_argument(
        "--without", metavar="NAME,...", default="", help="topics of the input that are left out"
    )
    add_skip_bad_rows(result)
    program.add_parameter_arguments(result)
    program.add_output_arguments(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, add_errors, argv)


def add_errors(arguments: argparse.Namespace) -> None:
    """Write what the arguments ask for."""
    options = ErrorOptions(arguments.input_topic, bag_output.names(arguments.without))
    layers = _layers(arguments)
    watcher = bag_output.watcher(arguments, "add_errors", "add_errors: warning: ")
    form, written = bag_output.whole_form(arguments), outputs(arguments, layers.values())
    made = write(arguments.input, arguments.output, form, options, layers, written, watcher)
    _report(made.to_dict(), arguments)


def _layers(arguments: argparse.Namespace) -> dict[str, object]:
    """Return the parameters that files and arguments give."""
    *of_files, own = program.parameter_layers(arguments, NODE)
    result: dict[str, object] = {}
    for layer in of_files:
        result |= layer
    if arguments.imu is not None:
        result["imu.preset"] = arguments.imu
    for name in ("rate", "seed"):
        if getattr(arguments, name) is not None:
            result[name] = getattr(arguments, name)
    return {**result, **own}


def _report(result: dict[str, Any], arguments: argparse.Namespace) -> None:
    if arguments.json:
        program.print_json(result)
        return
    if arguments.quiet:
        return
    counts = ", ".join(f"{count:,} {name}" for name, count in result["messages"].items())
    notes = "".join(
        f", {result[name]:,} {name}"
        for name in ("missing", "pauses", "restarts", "repeated", "backward")
        if result[name]
    )
    speed = result["readings"] / result["wall_s"]
    shown = f"{speed / 1e3:,.0f} k" if speed >= 1e4 else f"{speed:,.0f}"
    print(f"{result['output']}: {counts}{notes}; {result['wall_s']:.2f} s ({shown} readings/s)")


if __name__ == "__main__":
    sys.exit(main())
