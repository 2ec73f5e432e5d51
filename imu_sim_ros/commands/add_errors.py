# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``add_errors``: add the errors of a chosen sensor to another simulator's ideal readings."""

import argparse
from functools import partial
from typing import Final

from imu_sim_ros import program
from imu_sim_ros.commands import bag_output
from imu_sim_ros.commands.common import SKIP_BAD_ROWS, outputs
from imu_sim_ros.jobs.add_errors_bag import USUAL
from imu_sim_ros.jobs.add_errors_files import FORMATS, ErrorOptions, write
from imu_sim_ros.simulation.error_parameters import NODE
from imu_sim_ros.simulation.topics import OF_THE_ERROR_MODEL

EXAMPLES: Final = """
  add_errors ideal.mcap -o noisy.mcap --imu bmi088 --seed 3
  add_errors gazebo.bag -o noisy.bag --imu model.sdf --input-topic /imu
  add_errors airsim.mcap -o noisy.mcap --imu mpu6000 --set input.axes=frd
  add_errors MH_99 -o MH_99_noisy --format euroc --imu adis16448
"""


_SENSOR: Final = {
    "--imu NAME|FILE": "sensor: a preset (see generate --list-imus), a parameter file, or a "
    "Gazebo model (model.sdf)",
    "--rate HZ": "sampling rate (default: that of the input)",
    "--seed N": "seed of all random streams",
}
_TOPICS: Final = {
    "--input-topic NAME": "topic of the ideal readings, or of odometry (default: the only "
    "sensor_msgs/Imu topic)",
    "--topics NAME,...": {
        "default": "",
        "help": f"topics to add (default: {','.join(USUAL)}); all: {', '.join(OF_THE_ERROR_MODEL)}",
    },
    "--without NAME,...": {"default": "", "help": "topics of the input to leave out"},
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    arguments = bag_output.INPUT
    result = program.Parser(
        "add_errors", description=__doc__, examples=EXAMPLES, arguments=arguments
    )
    bag_output.add_arguments(result, FORMATS)
    program.add_options(result.add_argument_group("sensor"), _SENSOR)
    program.add_options(result.add_argument_group("topics"), _TOPICS)
    program.add_options(result, SKIP_BAD_ROWS)
    program.add_parameter_arguments(result)
    program.add_options(result, program.JSON_AND_QUIET)
    return result


def add_errors(arguments: argparse.Namespace) -> None:
    """Write what the arguments ask for."""
    options = ErrorOptions(arguments.input_topic, bag_output.names(arguments.without))
    layers = _layers(arguments)
    watcher = bag_output.watcher(arguments, "add_errors", "add_errors: warning: ")
    form, written = bag_output.whole_form(arguments), outputs(arguments, layers.values())
    made = write(arguments.input, arguments.output, form, options, layers, written, watcher)
    result = made.to_dict()
    kinds = ("missing", "pauses", "restarts", "repeated", "backward")
    notes = "".join(f", {result[kind]:,} {kind}" for kind in kinds if result[kind])
    speed = bag_output.time_and_speed(result["readings"], made.wall_s, "readings")
    line = f"{made.output}: {bag_output.counts(made.messages)}{notes}; {speed}"
    program.print_result(arguments, result, [line])


def _layers(arguments: argparse.Namespace) -> dict[str, object]:
    """Return the parameters that files and arguments give."""
    result, own = program.parameter_layers(arguments, NODE)
    if arguments.imu is not None:
        result["imu.preset"] = arguments.imu
    return {**result, **program.given(arguments, "rate", "seed"), **own}


main = partial(program.main, parser, add_errors)
