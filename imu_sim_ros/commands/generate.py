# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``generate``: simulate sensors and write a bag or dataset, as fast as the machine can."""

import argparse
import sys
from functools import partial
from typing import Final

from imu_sim_ros.commands import program
from imu_sim_ros.core.errors import ImuSimError
from imu_sim_ros.jobs.generate import OF_SENSORS
from imu_sim_ros.jobs.generate import generate as job
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors import catalogue, switchable_sensors, switches
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.terminal.signatures import arguments_of, call_job
from imu_sim_ros.trajectory.parameters import TourParameters
from imu_sim_ros.trajectory.tour import waypoints_file

EXAMPLES: Final = """
  generate -o a.bag --imu-only --trajectory static --duration 4h --topic imu/data_raw=/imu
  generate -o flight.mcap --compression lz4 --trajectory groundtruth.csv
  generate -o flight --storage sqlite3 --imu mpu6000 --duration 10min --with-configs
  generate -o MH_99/mav0 --format euroc --duration 2min
  generate -o tracks --format tracks --camera euroc_cam0 --trajectory groundtruth.csv
"""


_SENSORS: Final = (
    {
        f"--{name} NAME|FILE": {
            "action": "append",
            "help": f"simulate {name}: a preset ({', '.join(files.names(name))}) or a file; "
            f"repeatable, further ones are named {name}1, {name}2, ...",
            "group": str(OF_SENSORS),
        }
        for name, sensor in switchable_sensors().items()
        if sensor.presets
    }
    | {
        f"--{name}": {
            "action": "store_const",
            "const": True,
            "help": f"simulate {name}",
            "group": str(OF_SENSORS),
        }
        for name, sensor in switchable_sensors().items()
        if not sensor.presets
    }
    | {
        f"--{switch.name}": {"action": "store_true", "help": switch.text, "group": str(OF_SENSORS)}
        for switch in switches().values()
    }
)


def parser() -> program.Parser:
    """Return the command's arguments."""
    arguments = {**arguments_of(job), **_SENSORS, **program.JSON_AND_QUIET, **_LISTS}
    return _Parser("generate", description=__doc__, examples=EXAMPLES, arguments=arguments)


class _Parser(program.Parser):
    """Parser whose help names the sensors of other packages, for which it looks only then."""

    def format_help(self) -> str:
        """Return the help text."""
        (group,) = (section for section in self._action_groups if section.title == OF_SENSORS)
        group.description = "; ".join(catalogue.sensor_lines()) or "none is installed"
        return super().format_help()


class _List(argparse.Action):
    """Prints the names in a folder of config/, or the sensors, and exits, like --help."""

    def __call__(self, parser: argparse.ArgumentParser, *_arguments: object) -> None:
        """Print the list."""
        folder = str(self.const)
        print(catalogue.sensor_table() if folder == "sensors" else catalogue.list_folder(folder))
        parser.exit()


class _Tour(argparse.Action):
    """Prints the waypoints of a tour, and exits."""

    def __call__(
        self, parser: argparse.ArgumentParser, _namespace: object, value: object, *_rest: object
    ) -> None:
        """Print the waypoints."""
        place, _, seed = str(value).partition(":")
        tour_parameters: dict[str, object] = {"trajectory.type": "tour", "trajectory.place": place}
        tour_parameters["trajectory.place_seed"] = int(seed) if seed.isdigit() else seed or 0
        try:
            tour = load_simulation(tour_parameters).trajectory
            assert isinstance(tour, TourParameters)
            print(waypoints_file(tour), end="")
        except ImuSimError as error:
            parser.error("; ".join(error.problems))
        parser.exit()


_AND_EXIT: Final = "lists (print and exit)"


def _list(folder: str, text: str) -> dict[str, object]:
    """Return the arguments of an option that lists a folder of config/ and ends the program."""
    return {"action": _List, "nargs": 0, "const": folder, "help": text, "group": _AND_EXIT}


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
        "group": _AND_EXIT,
    },
}


def generate(arguments: argparse.Namespace) -> None:
    """Write the requested output."""
    options = vars(arguments)
    names = [*switchable_sensors(), *(switch.name for switch in switches().values())]
    sensors = {name: enabled for name in names if (enabled := options[name])}
    program.show(arguments, call_job(job, arguments, defaults=sensors))


main = partial(program.main, parser, generate)

if __name__ == "__main__":
    sys.exit(main())
