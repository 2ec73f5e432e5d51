# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``generate``: simulate sensors and write a bag or dataset, as fast as the machine can."""

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, Final

from imu_sim_ros import program
from imu_sim_ros.commands import bag_output
from imu_sim_ros.commands.inputs import PoseReader, add_skip_bad_rows
from imu_sim_ros.commands.outputs import outputs
from imu_sim_ros.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.datasets.camera_outputs import FORMATS
from imu_sim_ros.errors import ImuSimError
from imu_sim_ros.jobs.generate import GenerateOptions, Setup, camera_layer, write
from imu_sim_ros.jobs.output import Watcher
from imu_sim_ros.machine import cores
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors import CARRIED, catalogue
from imu_sim_ros.simulation.parameters import carried_names, load_simulation
from imu_sim_ros.simulation.playback import of_the_node
from imu_sim_ros.simulation.topics import types
from imu_sim_ros.trajectory.parameters import TourParameters, TrajectoryParameters

EXAMPLES: Final = """
  generate -o a.bag --imu-only --trajectory static --duration 4h --topic imu/data_raw=/imu
  generate -o flight.mcap --compression lz4 --trajectory groundtruth.csv
  generate -o flight --storage sqlite3 --imu mpu6000 --duration 10min --with-configs
  generate -o MH_99/mav0 --format euroc --duration 2min
  generate -o tracks --format tracks --camera euroc_cam0 --trajectory groundtruth.csv
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = _Parser(
        prog="generate",
        description=__doc__,
        examples=EXAMPLES,
    )
    program.add_simulation_arguments(result)
    result.sensors = result.add_argument_group("sensors of the body (--set sensors=[NAME,...])")
    for name in CARRIED:
        known = ", ".join(files.names(name))
        result.sensors.add_argument(
            f"--{name}", metavar="NAME|FILE", help=f"{name}: a preset ({known}) or a file"
        )
    result.sensors.add_argument(
        "--rinex",
        action="store_true",
        help="raw measurements of the receiver as RINEX, next to the output: NAME.obs, NAME.nav",
    )
    _add_cameras(result)
    add_skip_bad_rows(result)
    group = result.add_argument_group("output")
    bag_output.add_arguments(group, FORMATS)
    group.add_argument(
        "--topics",
        metavar="NAME,...",
        default="",
        help=f"topics to write (default: {IMU_TOPIC},{TRUTH_TOPIC}); all: {', '.join(types())}",
    )
    group.add_argument("--imu-only", action="store_true", help="leave out the ground truth")
    group.add_argument(
        "--with-configs",
        action="store_true",
        help="write configurations of IMU and cameras for kalibr, VINS, OpenVINS, ORB_SLAM3, "
        "Basalt, imu_utils and allan_variance_ros, and all parameters, to OUTPUT_configs",
    )
    program.add_output_arguments(result)
    lists = result.add_argument_group("lists (print and exit)")
    for option, (folder, words) in _LISTS.items():
        lists.add_argument(option, action=_List, nargs=0, const=folder, help=words)
    lists.add_argument(
        "--list-tour",
        action=_Tour,
        metavar="PLACE[:SEED]",
        help="the waypoints of a tour through a place, as a parameter file for --trajectory",
    )
    return result


_LISTS: Final = {
    "--list-imus": ("imus", "included sensors: grade, price class, maker and type"),
    "--list-trajectories": ("trajectories", "included motions"),
    "--list-cameras": ("cameras", "included cameras"),
    "--list-scenes": ("scenes", "included scenes"),
    "--list-sensors": ("sensors", "sensors of the body, those of other packages too"),
}


class _Parser(program.Parser):
    """Its help names the sensors of other packages, for which it looks only then."""

    sensors: Any

    def format_help(self) -> str:
        """Return the help text."""
        self.sensors.description = "; ".join(catalogue.carried_lines()) or "none is installed"
        return super().format_help()


class _List(argparse.Action):
    """Prints the names in a folder of config/, or the sensors, and exits, like --help."""

    def __call__(self, parser: argparse.ArgumentParser, *_arguments: object) -> None:
        """Print the list."""
        folder = str(self.const)
        tables = {"imus": catalogue.table, "sensors": catalogue.carried_table}
        print(tables[folder]() if folder in tables else catalogue.listing(folder))
        parser.exit()


class _Tour(argparse.Action):
    """Prints the waypoints of a tour, and exits."""

    def __call__(
        self, parser: argparse.ArgumentParser, _namespace: object, value: Any, *_rest: object
    ) -> None:
        """Print them."""
        place, _, seed = str(value).partition(":")
        given: dict[str, object] = {"trajectory.type": "tour", "trajectory.place": place}
        given["trajectory.place_seed"] = int(seed) if seed.isdigit() else seed or 0
        try:
            print(_tour(load_simulation(given).trajectory), end="")
        except ImuSimError as error:
            parser.error("; ".join(error.problems))
        parser.exit()


def _tour(parameters: TrajectoryParameters) -> str:
    """Return the waypoints of a tour as the text of a parameter file."""
    from imu_sim_ros.places.catalogue import usual  # with SciPy
    from imu_sim_ros.trajectory.tour import waypoint_parameters

    assert isinstance(parameters, TourParameters)
    low, high = usual(parameters.place, parameters.place_size)
    size, center = (high - low).tolist(), (0.5 * (low + high)).tolist()
    comment = (
        f"The waypoints of a tour through a place; cameras see it with\n"
        f"--scene {parameters.place} --set scene.seed={parameters.place_seed} "
        f"--set scene.size={_list(size)} --set scene.center={_list(center)}"
    )
    return files.text(waypoint_parameters(parameters), comment=comment)


def _list(values: Iterable[float]) -> str:
    return "[" + ",".join(f"{value:g}" for value in values) + "]"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, generate, argv)


def generate(arguments: argparse.Namespace) -> None:
    """Write the requested output."""
    setup = Setup.load(_layers(arguments))
    form = bag_output.whole_form(arguments)
    written = outputs(arguments, setup.values().values())
    options = GenerateOptions(arguments.imu_only, arguments.with_configs, arguments.jobs)
    reader = PoseReader(arguments, "generate")
    _report(
        write(
            arguments.output, form, options, setup, written, _watcher(arguments), reader
        ).to_dict(),
        arguments,
    )


def _watcher(arguments: argparse.Namespace) -> Watcher:
    """Return who prints warnings, notes and progress."""
    quiet = arguments.quiet or arguments.json

    def warn(line: str) -> None:
        print(f"generate: warning: {line}", file=sys.stderr)

    def note(line: str) -> None:
        if not quiet:
            print(line)

    def progress(total: int) -> AbstractContextManager[Callable[[float], None]]:
        return program.progress(f"writing {arguments.output}", total, quiet)

    return Watcher(warn, note, progress)


def _layers(arguments: argparse.Namespace) -> dict[str, object]:
    """Return all parameters by dotted name, and print warnings about unexpected effects."""
    *below, last = program.simulation_layers(arguments)
    given: dict[str, object] = {}
    for values in below:
        given.update(values)
    short = camera_layer(arguments.camera, arguments.scene)
    _put_short(given, short, len(arguments.camera))
    _put_sensors(given, arguments)
    given.update(last)
    if not (arguments.quiet or arguments.json):
        for note in _notes(arguments, below[:-1], of_the_node(given)):
            print(f"generate: note: {note}", file=sys.stderr)
    return given


def _put_short(given: dict[str, object], short: Mapping[str, object], cameras: int) -> None:
    """Put short arguments above the files'; with ``--camera`` their further cameras do not count.

    :param cameras: how many ``--camera`` there are.
    """
    named = given.get("cameras")
    if cameras and isinstance(named, list):
        gone = set(map(str, named)) - {f"cam{k}" for k in range(cameras)}
        for name in [name for name in given if name.partition(".")[0] in gone]:
            del given[name]
    given.update(short)


def _put_sensors(given: dict[str, object], arguments: argparse.Namespace) -> None:
    """Add sensors of the body that have an option of their own to those of the files."""
    for name in CARRIED:
        preset = getattr(arguments, name)
        if preset is not None:
            named = list(carried_names(given))
            given["sensors"] = named if name in named else [*named, name]
            given[f"{name}.preset"] = preset
    if arguments.rinex:
        named = list(carried_names(given))
        given["sensors"] = named if "gnss" in named else [*named, "gnss"]
        given["gnss.raw.rinex"] = True


def _notes(
    arguments: argparse.Namespace,
    in_files: Iterable[Mapping[str, object]],
    node: Iterable[str],
) -> Iterator[str]:
    """Yield a line for each allowed parameter with an unexpected effect.

    :param in_files: the parameters that stand in files.
    :param node: names of parameters that only a node has.
    """
    shown = dict.fromkeys(name.partition("./")[0] for name in node)  # one for all topics
    if shown:
        yield f"no effect in a file: {', '.join(shown)}"
    every = dict.fromkeys(name for values in in_files for name in values)
    above = [name for name in every if name.startswith("imu.") and name != "imu.preset"]
    if arguments.imu is not None and above:
        others = f" and {len(above) - 3} more" if len(above) > 3 else ""
        yield (
            f"--imu {arguments.imu} is the base of the parameter file; "
            f"the values of the file take precedence: {', '.join(above[:3])}{others}"
        )


def _add_cameras(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that choose cameras and scene."""
    group = parser.add_argument_group("cameras")
    group.add_argument(
        "--camera",
        metavar="NAME|FILE",
        action="append",
        default=[],
        help="camera: a preset (see --list-cameras) or a file; repeatable, named cam0, cam1, "
        "... in order",
    )
    group.add_argument(
        "--jobs",
        metavar="N",
        type=int,
        default=cores(),
        help="number of threads that render images (default: one per processor)",
    )
    group.add_argument(
        "--scene",
        metavar="NAME|FILE",
        help="scene: a preset (see --list-scenes), a parameter file, or points (CSV, PLY)",
    )


def _report(result: dict[str, Any], arguments: argparse.Namespace) -> None:
    if arguments.json:
        program.print_json(result)
    elif not arguments.quiet:
        counts = ", ".join(f"{count:,} {name}" for name, count in result["messages"].items())
        speed = sum(result["messages"].values()) / result["wall_s"]
        shown = f"{speed / 1e3:,.0f} k" if speed >= 1e4 else f"{speed:,.0f}"
        print(
            f"{result['output']}: {counts}; {result['bytes'] / 1e6:,.1f} MB in "
            f"{result['wall_s']:.2f} s ({shown} messages/s)"
        )


if __name__ == "__main__":
    sys.exit(main())
