# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``dead_reckon``: integrate the IMU readings of a bag, and compare with the truth.

The parameters are those of the integrator node, so one parameter file works with both.
"""

import argparse
import sys
from functools import partial
from typing import Final

from imu_sim_ros.commands import program
from imu_sim_ros.commands.common import FORCE, output_and_plot, save_plot
from imu_sim_ros.jobs.dead_reckon import dead_reckon, dead_reckon_all, lines, plot_tracks
from imu_sim_ros.jobs.writing import PARAMETERS
from imu_sim_ros.sensors.imu.presets import load_all
from imu_sim_ros.terminal.signatures import arguments_of, call_job, parse_assignment, reader

EXAMPLES: Final = """
dead_reckon flight.mcap --all
dead_reckon flight.bag --initial-state level -o track.csv --plot track.png
dead_reckon V1_02/mav0 --correction calibration/correction.yaml --json
"""


_ARGUMENTS: Final = {
    **arguments_of(dead_reckon),
    "--all": "run all methods with all attitude updates",
    "-o --output FILE": "write the trajectory: .csv with velocity, anything else in TUM format",
    "--plot FILE": "write a plot: paths, and error over time",
    **FORCE,
    **program.JSON_AND_QUIET,
    "--params-file FILE": {
        "type": str,
        "action": "append",
        "default": [],
        "help": "ROS 2 parameter file, or kalibr's, OpenVINS' or EuRoC's of an IMU; repeatable",
        "group": PARAMETERS,
    },
    "--set KEY=VALUE": {
        "type": reader(parse_assignment),
        "action": "append",
        "default": [],
        "help": "set one parameter, e.g. imu.gyroscope_bias=[0.01,0,0]; repeatable",
        "group": PARAMETERS,
    },
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser(
        "dead_reckon", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS
    )


def run(arguments: argparse.Namespace) -> None:
    """Integrate, compare with the truth, and print the results."""
    # A node's file may ask for the covariance, which no result of this program states, and for the
    # first frame.
    without_effect = (("covariance", True), ("frame", ""))
    file_parameters, overrides = (
        {name: value for name, value in layer.items() if (name, value) not in without_effect}
        for layer in (load_all(arguments.params_file, "integrator"), dict(arguments.set))
    )
    with output_and_plot(arguments) as (output, plot):
        if arguments.all:
            tracks = call_job(dead_reckon_all, arguments, file_parameters, overrides)
        else:
            tracks = [call_job(dead_reckon, arguments, file_parameters, overrides)]
        if output is not None:
            tracks[0].save(output)
        save_plot(plot, lambda: plot_tracks(tracks))
    summaries = [track.to_dict() for track in tracks]
    result = summaries if arguments.all else summaries[0]
    program.print_result(arguments, result, lines(summaries))


main = partial(program.main, parser, run)

if __name__ == "__main__":
    sys.exit(main())
