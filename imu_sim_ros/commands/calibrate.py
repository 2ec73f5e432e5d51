# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``calibrate``: estimate the deterministic errors of a sensor from calibration runs.

Writes a parameter file for the simulator, a correction for the integrator, and a picture.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros import program
from imu_sim_ros.calibration.deterministic.positions import FIXTURES
from imu_sim_ros.commands import tables
from imu_sim_ros.commands.inputs import add_skip_bad_rows
from imu_sim_ros.commands.outputs import add_force, outputs
from imu_sim_ros.conventions import GRAVITY
from imu_sim_ros.jobs.calibrate import (
    Calibration,
    calibrate_magnetometer,
    calibrate_six_position,
    calibrate_temperature,
    calibrate_turntable,
)
from imu_sim_ros.types import Array

EXAMPLES: Final = """
calibrate six_position positions.bag -o calibration
calibrate six_position positions.mcap --truth positions_truth.yaml --json
calibrate turntable table.mcap --rates-deg 30,60,120
calibrate turntable table.mcap --truth table_truth.yaml --no-files
calibrate temperature soak.mcap --reference 25 --truth mpu6000
calibrate temperature ramp.bag --temperature-topic /imu/temperature -o thermal
calibrate magnetometer tumble.bag --field 4.92e-5 --truth tumble_truth.yaml
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="calibrate", description=__doc__, examples=EXAMPLES)
    kinds = result.add_subparsers(dest="kind", required=True, metavar="RUN")
    six = _kind(kinds, "six_position", "accelerometer: rests with each axis up and down")
    six.add_argument(
        "--simple", action="store_true", help="bias and scale only, without misalignment"
    )
    six.add_argument(
        "--fixture",
        choices=FIXTURES,
        default=FIXTURES[0],
        help="exact: each axis pointed up and down; norm: ten rests or more in any positions, the "
        "norm of gravity is fitted and S is upper triangular; auto (default): chosen by a test of "
        "the residuals",
    )
    table = _kind(kinds, "turntable", "gyroscope: known rates about each axis, both directions")
    _add_rates(table)
    table.add_argument(
        "--accelerometer",
        metavar="FILE",
        type=Path,
        help="correction.yaml of a six-position run: on a tilted table the force is taken "
        "as measured",
    )
    temperature = _kind(kinds, "temperature", "both triads over temperature: soak or ramp")
    _add_rates(temperature)
    temperature.add_argument(
        "--temperature-topic",
        metavar="TOPIC",
        help="sensor_msgs/Temperature topic, if the bag has several",
    )
    temperature.add_argument(
        "--reference", metavar="DEGC", type=float, default=25.0, help="T0 (default: 25)"
    )
    magnetometer = _kind(kinds, "magnetometer", "hard and soft iron: rotations in all directions")
    magnetometer.add_argument(
        "--field",
        metavar="T",
        type=float,
        help="strength of the Earth's field [T]; without it the soft iron has the determinant 1",
    )
    return result


def _kind(kinds: Any, name: str, text: str) -> argparse.ArgumentParser:
    """Return the parser of one kind of run, with what all have in common."""
    examples = program.examples_of(EXAMPLES, f"calibrate {name} ")
    result: argparse.ArgumentParser = kinds.add_parser(
        name, help=text, description=text, examples=examples
    )
    result.add_argument("bag", metavar="BAG", type=Path, help="bag, EuRoC folder or CSV file")
    result.add_argument("--topic", help="sensor_msgs/Imu topic, if the bag has several")
    result.add_argument(
        "--gravity", type=float, default=-GRAVITY[2], help="local gravity [m/s^2] (%(default)s)"
    )
    result.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="folder for the files (default: RUN)"
    )
    result.add_argument(
        "--truth", metavar="NAME|FILE", help="compare with the parameters that generated the bag"
    )
    result.add_argument("--no-files", action="store_true", help="write no files, print only")
    add_skip_bad_rows(result)
    add_force(result)
    program.add_output_arguments(result)
    return result


def _add_rates(parser: argparse.ArgumentParser) -> None:
    group = parser.add_mutually_exclusive_group()
    group.add_argument(
        "--rates", metavar="R,R,...", type=_numbers, help="the table's rates [rad/s], without sign"
    )
    group.add_argument(
        "--rates-deg", metavar="R,R,...", type=_numbers, help="the same in degrees per second"
    )
    parser.add_argument(
        "--truth-topic",
        metavar="TOPIC",
        help="Odometry topic to take the rates from if none are given",
    )


def _numbers(words: str) -> Array:
    try:
        values = np.array([abs(float(word)) for word in words.split(",")])
    except ValueError:
        raise argparse.ArgumentTypeError(f"{words!r}: numbers separated by commas") from None
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        raise argparse.ArgumentTypeError(f"{words!r}: rates must be finite and not zero")
    return values


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, calibrate, argv)


def calibrate(arguments: argparse.Namespace) -> None:
    """Calibrate, write the files and print."""
    written = outputs(arguments)
    folder = arguments.output or Path(arguments.kind)
    names = ["imu.yaml", "correction.yaml", f"{arguments.kind}.png"]
    staging = None if arguments.no_files else written.add_files(folder, names)
    with written:
        found = _JOBS[arguments.kind](arguments)
        for line in found.warnings:
            print(f"calibrate: {line}", file=sys.stderr)
        true = found.true_values(arguments.truth) if arguments.truth else {}
        if staging is not None:
            for name in names:
                found.save(staging / name, for_simulator=name == "imu.yaml")
    if arguments.json:
        program.print_json(found.to_dict(arguments.truth))
    elif not arguments.quiet:
        files = [] if arguments.no_files else [folder / name for name in names]
        tables.print_all(found.parameters, found.facts, true, files)


def _six_position(arguments: argparse.Namespace) -> Calibration:
    return calibrate_six_position(
        arguments.bag,
        simple=arguments.simple,
        fixture=arguments.fixture,
        gravity=arguments.gravity,
        **_common(arguments),
    )


def _turntable(arguments: argparse.Namespace) -> Calibration:
    return calibrate_turntable(
        arguments.bag,
        accelerometer=arguments.accelerometer,
        truth_topic=arguments.truth_topic,
        rates=_rates(arguments),
        gravity=arguments.gravity,
        **_common(arguments),
    )


def _temperature(arguments: argparse.Namespace) -> Calibration:
    return calibrate_temperature(
        arguments.bag,
        reference=arguments.reference,
        temperature_topic=arguments.temperature_topic,
        truth_topic=arguments.truth_topic,
        rates=_rates(arguments),
        gravity=arguments.gravity,
        **_common(arguments),
    )


def _magnetometer(arguments: argparse.Namespace) -> Calibration:
    return calibrate_magnetometer(arguments.bag, strength=arguments.field, **_common(arguments))


def _common(arguments: argparse.Namespace) -> dict[str, Any]:
    return {"topic": arguments.topic, "skip_bad_rows": arguments.skip_bad_rows}


def _rates(arguments: argparse.Namespace) -> Array | None:
    """Return the table's rates [rad/s]; None: those of the truth in the bag."""
    if arguments.rates_deg is not None:
        return np.radians(arguments.rates_deg)
    rates: Array | None = arguments.rates
    return rates


_JOBS: Final[dict[str, Callable[[argparse.Namespace], Calibration]]] = {
    "six_position": _six_position,
    "turntable": _turntable,
    "temperature": _temperature,
    "magnetometer": _magnetometer,
}


if __name__ == "__main__":
    sys.exit(main())
