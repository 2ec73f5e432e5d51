# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``dead_reckon``: integrate the IMU readings of a bag, and compare with the truth.

The parameters are those of the integrator node, so one parameter file works with both.
"""

import argparse
import sys
from dataclasses import replace
from functools import partial
from typing import Final

from imu_sim_ros import program
from imu_sim_ros.commands.common import COMMON, output_and_plot, save_plot, skipped_rows
from imu_sim_ros.conventions import TRUTH_TOPIC
from imu_sim_ros.datasets.world import KnownWorld
from imu_sim_ros.jobs.dead_reckon import (
    Track,
    initial_condition,
    integrated,
    lines,
    plot_tracks,
    read_recording,
    read_world,
)
from imu_sim_ros.navigation.parameters import (
    ATTITUDE_UPDATES,
    INITIAL_STATES,
    METHODS,
    IntegratorParameters,
    layer_integrator,
)
from imu_sim_ros.parameters.files import build_layered

EXAMPLES: Final = """
dead_reckon flight.mcap --all
dead_reckon flight.bag --initial-state level -o track.csv --plot track.png
dead_reckon V1_02/mav0 --correction calibration/correction.yaml --json
"""


_ARGUMENTS: Final = {
    "bag BAG": "a bag of any format, or a EuRoC folder",
    "--imu-topic TOPIC": "topic of the readings, if the bag has several",
    "--truth-topic TOPIC": f"topic of the truth (default: {TRUTH_TOPIC})",
    "--method": {
        "choices": METHODS,
        "help": "integration of position and velocity (default: midpoint)",
    },
    "--attitude-update": {
        "choices": ATTITUDE_UPDATES,
        "help": "integration of the attitude (default: so3)",
    },
    "--all": "run all methods with all attitude updates",
    "--initial-state": {
        "choices": INITIAL_STATES,
        "help": "truth (default); parameters: initial_position and so on; level: roll, pitch and "
        "gyroscope bias from level_time at rest, position and yaw from the truth if there is one",
    },
    "--correction FILE": "parameter file with known biases, scales and misalignments, as written "
    "by calibrate",
    "--skip TIME": {
        "default": 0.0,
        "help": "skip the readings in this time after the first one",
    },
    "-o --output FILE": "write the trajectory: .csv with velocity, anything else in TUM format",
    "--plot FILE": "write a plot: paths, and error over time",
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(
        "dead_reckon", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS
    )
    program.add_parameter_arguments(result)
    program.add_options(result, COMMON)
    return result


def run(arguments: argparse.Namespace) -> None:
    """Integrate, compare, and say what came out."""
    with output_and_plot(arguments) as written:
        made = _tracks(arguments)
        if arguments.output is not None:
            made[0].save(written.where(arguments.output))
        save_plot(arguments, written, lambda: plot_tracks(made))
        summaries = [track.to_dict() for track in made]
    result = summaries if arguments.all else summaries[0]
    program.print_result(arguments, result, lines(summaries))


def _tracks(arguments: argparse.Namespace) -> list[Track]:
    """Return the trajectory of each way to integrate that is asked for."""
    _settings(arguments, KnownWorld({}))  # wrong ones are refused before anything is read
    world = read_world(arguments.bag, arguments.imu_topic, arguments.truth_topic)
    settings = _settings(arguments, world)
    recording = read_recording(
        arguments.bag,
        arguments.imu_topic,
        arguments.truth_topic,
        skipped_rows(arguments, "dead_reckon", arguments.bag),
        skipped_rows(arguments, "dead_reckon", f"the truth of {arguments.bag}"),
    )
    start = initial_condition(settings, recording.after(arguments.skip))
    for note in (*world.notes, *settings.warnings()):
        print(f"dead_reckon: {arguments.bag}: {note}", file=sys.stderr)
    if not arguments.all:
        return [integrated(start, settings)]
    return [
        integrated(start, replace(settings, method=method, attitude_update=attitude))
        for method in METHODS
        for attitude in ATTITUDE_UPDATES
    ]


def _settings(arguments: argparse.Namespace, world: KnownWorld) -> IntegratorParameters:
    chosen = program.given(arguments, "method", "attitude_update", "initial_state")
    if arguments.correction is not None:
        chosen["calibration"] = str(arguments.correction)
    layers = program.parameter_layers(arguments, "integrator")
    merged: dict[str, object] = {"initial_state": "truth", **world.parameters}
    for values in (*layers[:-1], chosen, layers[-1]):
        merged.update(values)
    return build_layered(IntegratorParameters, layer_integrator, merged)


main = partial(program.main, parser, run)

if __name__ == "__main__":
    sys.exit(main())
