# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The arguments that choose what is simulated, as parameters."""

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

from imu_sim_ros import program
from imu_sim_ros.jobs.generate import camera_layer
from imu_sim_ros.machine import cores
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import listed
from imu_sim_ros.sensors import NAMED
from imu_sim_ros.simulation.playback import of_the_node
from imu_sim_ros.trajectory.parameters import trajectory_layer

_SIMULATION: Final = {
    "--imu NAME|FILE": "IMU: a preset (see --list-imus) or a file",
    "--trajectory NAME|FILE": "motion: a preset (see --list-trajectories), a parameter file, a "
    "route (GPX, KML), or recorded poses (TUM, EuRoC, bag)",
    "--robust": "repair recorded poses: drop outliers, close jumps, smooth arrival stamps "
    "(trajectory.robust)",
    "--rate HZ": "sampling rate",
    "--duration TIME": "length of the run (20s, 10min, 4h)",
    "--seed N": "seed of all random streams",
}
_CAMERAS: Final = {
    "--camera NAME|FILE": {
        "action": "append",
        "default": [],
        "help": "camera: a preset (see --list-cameras) or a file; repeatable, named cam0, cam1, "
        "... in order",
    },
    "--jobs N": {
        "default": cores(),
        "help": "number of threads that render images (default: one per processor)",
    },
    "--scene NAME|FILE": "scene: a preset (see --list-scenes), a parameter file, points (CSV, "
    "PLY), or a mesh (GLB, glTF, OBJ, PLY, STL)",
}
_RINEX: Final = {
    "--rinex": "write raw GNSS measurements as RINEX next to the output: NAME.obs, NAME.nav"
}


def add(parser: argparse.ArgumentParser) -> Any:
    """Add the arguments; returns the group of the body's sensors."""
    program.add_parameter_arguments(parser)
    program.add_options(parser.add_argument_group("simulation"), _SIMULATION)
    sensors = parser.add_argument_group("sensors of the body (--set sensors=[NAME,...])")
    presets = {name: ", ".join(files.names(name)) for name in NAMED}
    program.add_options(
        sensors,
        {
            f"--{name} NAME|FILE": {
                "action": "append",
                "default": [],
                "help": f"simulate {name}: a preset ({known}) or a file; repeatable, further ones "
                f"are named {name}1, {name}2, ...",
            }
            for name, known in presets.items()
        },
    )
    program.add_options(sensors, _RINEX)
    program.add_options(parser.add_argument_group("cameras"), _CAMERAS)
    return sensors


def layers(arguments: argparse.Namespace) -> dict[str, object]:
    """Return all parameters by dotted name, and print warnings about unexpected effects."""
    in_files, last = program.parameter_layers(arguments, "simulator")
    given = {**in_files, **_short(arguments)}
    short = camera_layer(arguments.camera, arguments.scene)
    _put_short(given, short, len(arguments.camera))
    _put_sensors(given, arguments)
    given.update(last)
    if not (arguments.quiet or arguments.json):
        for note in _notes(arguments, in_files, of_the_node(given)):
            print(f"generate: note: {note}", file=sys.stderr)
    return given


def _short(arguments: argparse.Namespace) -> dict[str, object]:
    """Return what short arguments say: above the files, below ``--set``."""
    short: dict[str, object] = {}
    if arguments.imu is not None:
        short["imu.preset"] = arguments.imu
    if arguments.trajectory is not None:
        short.update(trajectory_layer(arguments.trajectory))
    if arguments.robust:
        short["trajectory.robust"] = True
    return short | program.given(arguments, "rate", "duration", "seed")


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
    used = ["gnss"] if arguments.rinex else []
    for kind in NAMED:
        for k, preset in enumerate(getattr(arguments, kind)):
            name = f"{kind}{k}" if k else kind
            used.append(name)
            given[f"{name}.preset"] = preset
            if k:
                given[f"{name}.type"] = kind
    if used:
        given["sensors"] = list(dict.fromkeys([*listed("sensors", given), *used]))
    if arguments.rinex:
        given["gnss.raw.rinex"] = True


def _notes(
    arguments: argparse.Namespace,
    in_files: Iterable[str],
    node: Iterable[str],
) -> Iterator[str]:
    """Yield a line for each allowed parameter with an unexpected effect.

    :param in_files: names of the parameters that stand in files.
    :param node: names of parameters that only a node has.
    """
    shown = dict.fromkeys(name.partition("./")[0] for name in node)  # one for all topics
    if shown:
        yield f"no effect in a file: {', '.join(shown)}"
    above = [name for name in in_files if name.startswith("imu.") and name != "imu.preset"]
    if arguments.imu is not None and above:
        others = f" and {len(above) - 3} more" if len(above) > 3 else ""
        yield (
            f"--imu {arguments.imu} is the base of the parameter file; "
            f"the values of the file take precedence: {', '.join(above[:3])}{others}"
        )
