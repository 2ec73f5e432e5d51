# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments that every simulation takes, and the layers of parameters that they give."""

import argparse
from collections.abc import Mapping

from imu_sim_ros import timebase
from imu_sim_ros.config import files
from imu_sim_ros.errors import ConfigurationError


def duration(words: str) -> float:
    """Return the seconds of ``20s``, ``10min``, ``4h``, ``2d`` or a plain number."""
    try:
        return timebase.parse_duration(words)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def assignment(words: str) -> tuple[str, object]:
    """Return name and value of ``key=value``; the value is YAML, none an empty string."""
    name, equals, value = words.partition("=")
    if not equals or not name.strip():
        raise argparse.ArgumentTypeError(f"{words!r} is not of the form key=value")
    try:
        return name.strip(), files.parse_yaml(value) if value.strip() else ""
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{name}: {error}") from None


def add_parameter_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that set parameters: files and single values."""
    group = parser.add_argument_group("parameters (later ones win)")
    group.add_argument(
        "--params-file",
        metavar="FILE",
        action="append",
        default=[],
        help="ROS 2 parameter file, or a kalibr imu.yaml; repeatable",
    )
    group.add_argument(
        "--set",
        metavar="KEY=VALUE",
        type=assignment,
        action="append",
        default=[],
        help="one parameter, for instance imu.gyroscope_bias=[0.01,0,0]; repeatable",
    )


def add_simulation_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that choose what is simulated."""
    add_parameter_arguments(parser)
    group = parser.add_argument_group("simulation")
    group.add_argument(
        "--imu",
        metavar="NAME|FILE",
        help=f"the sensor: {', '.join(files.names('imus'))}, or a file",
    )
    group.add_argument(
        "--trajectory",
        metavar="NAME|FILE",
        help=f"the motion: {', '.join(files.names('trajectories'))}, a parameter file, "
        "or recorded poses in TUM or EuRoC format",
    )
    group.add_argument(
        "--robust",
        action="store_true",
        help="repair recorded poses: drop outliers, close jumps, even out stamps of "
        "arrival (trajectory.robust)",
    )
    group.add_argument("--rate", metavar="HZ", type=float, help="samples per second")
    group.add_argument("--duration", metavar="TIME", type=duration, help="20s, 10min, 4h")
    group.add_argument("--seed", metavar="N", type=int, help="seed of all random streams")


def add_output_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--json`` and ``--quiet``."""
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def parameter_layers(arguments: argparse.Namespace, node: str) -> list[Mapping[str, object]]:
    """Return what files and ``--set`` give to a node, in order; all bad files are reported."""
    layers: list[Mapping[str, object]] = []
    problems: list[str] = []
    for path in arguments.params_file:
        try:
            layers.append(files.load(path, node))
        except ConfigurationError as error:
            problems += error.problems
    if problems:
        raise ConfigurationError(problems)
    return [*layers, dict(arguments.set)]


def simulation_layers(arguments: argparse.Namespace) -> list[Mapping[str, object]]:
    """Return the layers of a simulation: short arguments are above the files, below ``--set``."""
    short: dict[str, object] = {}
    if arguments.imu is not None:
        short["imu.preset"] = arguments.imu
    if arguments.trajectory is not None:
        short.update(files.trajectory_layer(arguments.trajectory))
    if arguments.robust:
        short["trajectory.robust"] = True
    for name in ("rate", "duration", "seed"):
        if getattr(arguments, name) is not None:
            short[name] = getattr(arguments, name)
    layers = parameter_layers(arguments, "simulator")
    return [*layers[:-1], short, layers[-1]]
