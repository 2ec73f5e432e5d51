# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``generate``: simulate sensors and write a bag or dataset, as fast as the machine can."""

import argparse
import sys
from functools import partial
from typing import Any, Final

from imu_sim_ros import program
from imu_sim_ros.commands import bag_output, simulation_arguments
from imu_sim_ros.commands.common import SKIP_BAD_ROWS, PoseReader, outputs
from imu_sim_ros.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.datasets.camera_outputs import FORMATS
from imu_sim_ros.errors import ImuSimError
from imu_sim_ros.jobs.generate import GenerateOptions, load_body, write
from imu_sim_ros.jobs.output import Watcher
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors import catalogue
from imu_sim_ros.simulation.parameters import SimulationParameters, load_simulation
from imu_sim_ros.simulation.sensors import mounted
from imu_sim_ros.simulation.topics import offered
from imu_sim_ros.trajectory.parameters import TourParameters

EXAMPLES: Final = """
  generate -o a.bag --imu-only --trajectory static --duration 4h --topic imu/data_raw=/imu
  generate -o flight.mcap --compression lz4 --trajectory groundtruth.csv
  generate -o flight --storage sqlite3 --imu mpu6000 --duration 10min --with-configs
  generate -o MH_99/mav0 --format euroc --duration 2min
  generate -o tracks --format tracks --camera euroc_cam0 --trajectory groundtruth.csv
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = _Parser("generate", description=__doc__, examples=EXAMPLES)
    result.sensors = simulation_arguments.add(result)
    program.add_options(result, SKIP_BAD_ROWS)
    group = result.add_argument_group("output")
    bag_output.add_arguments(group, FORMATS)
    program.add_options(group, _OUTPUT)
    program.add_options(result, program.JSON_AND_QUIET)
    lists = result.add_argument_group("lists (print and exit)")
    program.add_options(lists, _LISTS)
    return result


_ALL: Final = ", ".join(offered(mounted(SimulationParameters())))
_OUTPUT: Final = {
    "--topics NAME,...": {
        "default": "",
        "help": f"topics to write (default: {IMU_TOPIC},{TRUTH_TOPIC}); all: {_ALL}",
    },
    "--imu-only": "leave out the ground truth",
    "--with-configs": "write all parameters and a configuration file for each supported stack "
    "(kalibr, VINS, OpenVINS, ORB_SLAM3, Basalt, imu_utils, allan_variance_ros; with GNSS or "
    "wheels also robot_localization, FusionCore and MINS) to OUTPUT_configs",
}


class _Parser(program.Parser):
    """Its help names the sensors of other packages, for which it looks only then."""

    sensors: Any

    def format_help(self) -> str:
        """Return the help text."""
        self.sensors.description = "; ".join(catalogue.sensor_lines()) or "none is installed"
        return super().format_help()


class _List(argparse.Action):
    """Prints the names in a folder of config/, or the sensors, and exits, like --help."""

    def __call__(self, parser: argparse.ArgumentParser, *_arguments: object) -> None:
        """Print the list."""
        folder = str(self.const)
        tables = {"imus": catalogue.table, "sensors": catalogue.sensor_table}
        print(tables[folder]() if folder in tables else catalogue.listing(folder))
        parser.exit()


class _Tour(argparse.Action):
    """Prints the waypoints of a tour, and exits."""

    def __call__(
        self, parser: argparse.ArgumentParser, _namespace: object, value: Any, *_rest: object
    ) -> None:
        """Print them."""
        from imu_sim_ros.trajectory.tour import waypoints_file  # with SciPy

        place, _, seed = str(value).partition(":")
        given: dict[str, object] = {"trajectory.type": "tour", "trajectory.place": place}
        given["trajectory.place_seed"] = int(seed) if seed.isdigit() else seed or 0
        try:
            tour = load_simulation(given).trajectory
            assert isinstance(tour, TourParameters)
            print(waypoints_file(tour), end="")
        except ImuSimError as error:
            parser.error("; ".join(error.problems))
        parser.exit()


def _list(folder: str, text: str) -> dict[str, Any]:
    return {"action": _List, "nargs": 0, "const": folder, "help": text}


_LISTS: Final = {
    "--list-imus": _list("imus", "list the included IMUs: grade, price class, maker and type"),
    "--list-trajectories": _list("trajectories", "list the included trajectories"),
    "--list-cameras": _list("cameras", "list the included cameras"),
    "--list-scenes": _list("scenes", "list the included scenes"),
    "--list-sensors": _list(
        "sensors",
        "list the sensors of the body with their topics and parameters, including "
        "those of other packages",
    ),
    "--list-tour PLACE[:SEED]": {
        "action": _Tour,
        "help": "print the waypoints of a tour through a place, as a parameter file for "
        "--trajectory",
    },
}


def generate(arguments: argparse.Namespace) -> None:
    """Write the requested output."""
    body = load_body(simulation_arguments.layers(arguments))
    form = bag_output.whole_form(arguments)
    written = outputs(arguments, flatten(body).values())
    options = GenerateOptions(arguments.imu_only, arguments.with_configs, arguments.jobs)
    reader = PoseReader(arguments, "generate")
    watcher = _watcher(arguments)
    made = write(arguments.output, form, options, body, written, watcher, reader)
    speed = bag_output.time_and_speed(sum(made.messages.values()), made.wall_s, "messages")
    line = f"{bag_output.counts(made.messages)}; {made.bytes / 1e6:,.1f} MB in {speed}"
    program.print_result(arguments, made.to_dict(), [f"{made.output}: {line}"])


def _watcher(arguments: argparse.Namespace) -> Watcher:
    """Return who prints warnings, notes and progress."""
    quiet = arguments.quiet or arguments.json

    def warn(line: str) -> None:
        print(f"generate: warning: {line}", file=sys.stderr)

    note = (lambda line: None) if quiet else print
    text = f"writing {arguments.output}"
    return Watcher(warn, note, lambda total: program.progress(text, total, quiet))


main = partial(program.main, parser, generate)

if __name__ == "__main__":
    sys.exit(main())
