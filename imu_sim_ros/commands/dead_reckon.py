# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``dead_reckon``: integrate the IMU readings of a bag, and compare with the truth.

The parameters are those of the integrator node, so one parameter file works with both.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from imu_sim_ros import program
from imu_sim_ros.commands.inputs import add_skip_bad_rows, skipped_rows
from imu_sim_ros.commands.outputs import add_force, output_and_plot
from imu_sim_ros.conventions import TRUTH_TOPIC
from imu_sim_ros.jobs.dead_reckon import (
    CURVED_EARTH,
    Track,
    World,
    initial_condition,
    integrated,
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


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="dead_reckon", description=__doc__, examples=EXAMPLES)
    result.add_argument(
        "bag", type=Path, metavar="BAG", help="a bag of any format, or a EuRoC folder"
    )
    result.add_argument(
        "--imu-topic", metavar="TOPIC", help="topic of the readings, if the bag has several"
    )
    result.add_argument("--truth-topic", metavar="TOPIC", help=f"default: {TRUTH_TOPIC}")
    result.add_argument(
        "--method", choices=METHODS, help="integration of position and velocity (default: midpoint)"
    )
    result.add_argument(
        "--attitude-update",
        choices=ATTITUDE_UPDATES,
        help="integration of the attitude (default: so3)",
    )
    result.add_argument(
        "--all", action="store_true", help="run all methods with all attitude updates"
    )
    result.add_argument(
        "--initial-state",
        choices=INITIAL_STATES,
        help="start at the truth (the default), at initial_* of the parameters, or level: roll and "
        "pitch from gravity at rest, gyroscope bias from the mean of level_time; position and yaw "
        "then come from the truth if there is one",
    )
    result.add_argument(
        "--correction",
        type=Path,
        metavar="FILE",
        help="parameter file with known biases, scales and misalignments, as written by calibrate",
    )
    result.add_argument(
        "--skip",
        type=program.duration,
        metavar="TIME",
        default=0.0,
        help="skip the readings before this time, counted from the first",
    )
    result.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="write the trajectory: .csv with velocity, anything else in TUM format",
    )
    result.add_argument(
        "--plot", type=Path, metavar="FILE", help="write a plot: paths, and error over time"
    )
    program.add_parameter_arguments(result)
    add_skip_bad_rows(result)
    add_force(result)
    program.add_output_arguments(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, run, argv)


def run(arguments: argparse.Namespace) -> None:
    """Integrate, compare, and say what came out."""
    with output_and_plot(arguments) as written:
        made = _tracks(arguments)
        if arguments.output is not None:
            made[0].save(written.where(arguments.output))
        if arguments.plot is not None:
            from imu_sim_ros.plots import style  # 0.5 s of matplotlib

            style.save(plot_tracks(made), written.where(arguments.plot))
        summaries = [track.to_dict() for track in made]
    if arguments.json:
        program.print_json(summaries if arguments.all else summaries[0])
    elif not arguments.quiet:
        _print(summaries)


def _tracks(arguments: argparse.Namespace) -> list[Track]:
    """Return the trajectory of each way to integrate that is asked for."""
    world = read_world(arguments.bag)
    if world.curved_earth:
        print(f"dead_reckon: {arguments.bag}: {CURVED_EARTH}", file=sys.stderr)
    settings = _settings(arguments, world)
    recording = read_recording(
        arguments.bag,
        arguments.imu_topic,
        arguments.truth_topic,
        skipped_rows(arguments, "dead_reckon", arguments.bag),
        skipped_rows(arguments, "dead_reckon", f"the truth of {arguments.bag}"),
    )
    start = initial_condition(settings, recording.after(arguments.skip))
    if not arguments.all:
        return [integrated(start, settings)]
    return [
        integrated(start, replace(settings, method=method, attitude_update=attitude))
        for method in METHODS
        for attitude in ATTITUDE_UPDATES
    ]


def _settings(arguments: argparse.Namespace, world: World) -> IntegratorParameters:
    chosen: dict[str, object] = {}
    for name in ("method", "attitude_update", "initial_state"):
        if getattr(arguments, name) is not None:
            chosen[name] = getattr(arguments, name)
    if arguments.correction is not None:
        chosen["calibration"] = str(arguments.correction)
    layers = program.parameter_layers(arguments, "integrator")
    merged: dict[str, object] = {"initial_state": "truth", **world.parameters}
    for values in (*layers[:-1], chosen, layers[-1]):
        merged.update(values)
    return build_layered(IntegratorParameters, layer_integrator, merged)


def _print(summaries: Sequence[dict[str, Any]]) -> None:
    first = summaries[0]
    print(
        f"{first['samples']} readings, {first['duration_s']:.6g} s, "
        f"{first['distance_m']:.6g} m travelled, initial state: {first['initial_state']}"
    )
    columns = {
        "position [m]": "final_position_error_m",
        "of path [%]": "final_position_error_percent",
        "rms [m]": "rms_position_error_m",
        "v [m/s]": "final_velocity_error_m_s",
        "att. [rad]": "final_attitude_error_rad",
    }
    rows = [
        [summary["method"], summary["attitude_update"]]
        + ["-" if summary[key] is None else f"{summary[key]:.4g}" for key in columns.values()]
        for summary in summaries
    ]
    title = "Final errors against the truth; rms: of the position over the run"
    program.print_table(["method", "attitude", *columns], rows, title)


if __name__ == "__main__":
    sys.exit(main())
