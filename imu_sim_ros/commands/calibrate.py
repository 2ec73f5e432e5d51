# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``calibrate``: deterministic errors of an IMU from six-position, rate-table or temperature runs.

Writes a parameter file for the simulator, a correction for the integrator, and a picture.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros import program
from imu_sim_ros.bags.read import (
    ImuMessages,
    OdometryMessages,
    read_imu,
    read_odometry,
    read_temperature,
)
from imu_sim_ros.bags.sensor_tables import read_measured
from imu_sim_ros.calibration.deterministic import correction
from imu_sim_ros.calibration.deterministic.ellipsoid import calibrate_magnetometer
from imu_sim_ros.calibration.deterministic.positions import FIXTURES, NORM, calibrate_six_position
from imu_sim_ros.calibration.deterministic.steady import Steady, find_steady
from imu_sim_ros.calibration.deterministic.temperature import calibrate_temperature, temperatures_at
from imu_sim_ros.calibration.deterministic.turntable import (
    calibrate_turntable,
    known_rates,
    specific_force,
    true_rates,
)
from imu_sim_ros.calibration.noise.truth import load_truth
from imu_sim_ros.commands import tables as calibration_table
from imu_sim_ros.commands.inputs import add_skip_bad_rows, skipped_rows
from imu_sim_ros.commands.outputs import add_force, outputs
from imu_sim_ros.conventions import GRAVITY
from imu_sim_ros.errors import InputError, naming
from imu_sim_ros.inputs.rows import Skipped
from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.navigation.state import correction_of
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.sensors.magnetometer.declaration import SENSOR
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
    six = _kind(kinds, "six_position", "accelerometer: rest with each axis up and down")
    six.add_argument(
        "--simple", action="store_true", help="bias and scale only, without misalignment"
    )
    six.add_argument(
        "--fixture",
        choices=FIXTURES,
        default=FIXTURES[0],
        help="exact: each axis pointed up and down; norm: ten rests or more in any positions, the "
        "norm of gravity is fitted and S comes out upper triangular; auto: chosen by a test of the "
        "residuals",
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
    temperature = _kind(kinds, "temperature", "both triads against temperature: soak or ramp")
    _add_rates(temperature)
    temperature.add_argument(
        "--temperature-topic",
        metavar="TOPIC",
        help="sensor_msgs/Temperature topic, if the bag has several",
    )
    temperature.add_argument(
        "--reference", metavar="DEGC", type=float, default=25.0, help="T0 (default: 25)"
    )
    magnetometer = _kind(kinds, "magnetometer", "hard and soft iron: turned all around")
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
    if not 1.0 < arguments.gravity < 30.0:
        raise InputError(f"gravity = {arguments.gravity:g}: must be between 1 and 30 m/s^2")
    strength = getattr(arguments, "field", None)
    if strength is not None and not 0.0 < strength < 1.0:
        raise InputError(f"--field {strength:g}: must be above 0 and below 1 T")
    written = outputs(arguments)
    folder = arguments.output or Path(arguments.kind)
    names = ["imu.yaml", "correction.yaml", f"{arguments.kind}.png"]
    staging = None if arguments.no_files else written.add_files(folder, names)
    with written:
        truth = load_truth(arguments.truth) if arguments.truth else None
        with naming(arguments.bag):
            values, facts, draw = _KINDS[arguments.kind](arguments)
        true = {} if truth is None else correction.true_parameters(truth, values)
        if facts.get("fixture") == NORM and true:
            correction.turn_to_upper_triangular(true)
        if staging is not None:
            _write(arguments, staging, values, draw)
    if arguments.json:
        program.print_json(calibration_table.as_json(values, facts, true))
    elif not arguments.quiet:
        files = [] if arguments.no_files else [folder / name for name in names]
        calibration_table.print_all(values, facts, true, files)


Result = tuple[correction.Parameters, dict[str, Any], Callable[[Path], None]]


def _imu(arguments: argparse.Namespace) -> ImuMessages:
    return read_imu(arguments.bag, arguments.topic, _left_out(arguments))


def _left_out(arguments: argparse.Namespace) -> Skipped | None:
    return skipped_rows(arguments, "calibrate", arguments.bag)


def _six_position(arguments: argparse.Namespace) -> Result:
    imu = _imu(arguments)
    steady = find_steady(imu.t_ns, imu.gyro, imu.accel)
    found = calibrate_six_position(
        steady, arguments.gravity, simple=arguments.simple, fixture=arguments.fixture
    )
    facts = {
        "positions": found.positions.stretches,
        "seconds_at_rest": float(found.positions.duration.sum()),
        "rms_residual": _rms(found.residuals),
        "fixture": found.fixture,
        "fixture_reason": found.reason,
    }

    def draw(path: Path) -> None:
        from imu_sim_ros.plots import calibration as pictures

        pictures.draw_six_position(found, arguments.gravity, path, arguments.bag.name)

    return correction.six_position_parameters(found), facts, draw


def _turntable(arguments: argparse.Namespace) -> Result:
    imu = _imu(arguments)
    if arguments.accelerometer is not None:
        imu = imu._replace(accel=_corrected(imu, arguments.accelerometer))
    steady, rate = _rates(arguments, imu)
    found = calibrate_turntable(steady, rate, arguments.gravity)
    facts = {
        "stretches": steady.stretches,
        "rates": sorted({round(float(r), 6) for r in np.abs(rate).max(axis=1)}),
        "rms_residual": _rms(found.residuals),
    }
    if found.g_sensitivity is None:
        facts["note"] = "each axis must be seen up and down to separate g-sensitivity from bias"

    def draw(path: Path) -> None:
        from imu_sim_ros.plots import calibration as pictures

        pictures.draw_turntable(found, path, arguments.bag.name)

    return correction.turntable_parameters(found), facts, draw


def _corrected(imu: ImuMessages, path: Path) -> Array:
    """Return the accelerometer's readings without the errors that a calibration found."""
    values = build(IntegratorParameters, files.load(path, "integrator"))
    return correction_of(values).apply(imu.gyro, imu.accel)[1]


def _temperature(arguments: argparse.Namespace) -> Result:
    imu = _imu(arguments)
    steady, rate = _rates(arguments, imu, needed=False)
    left_out = _left_out(arguments)
    messages = read_temperature(arguments.bag, arguments.temperature_topic, left_out)
    at = temperatures_at(steady, messages.t_ns, messages.temperature)
    force = specific_force(steady, arguments.gravity)
    found = calibrate_temperature(steady, at, rate, force, arguments.reference)
    facts = {
        "stretches": steady.stretches,
        "temperature_degC": [float(at.min()), float(at.max())],
        **{
            f"{name}_{kind}_order": [
                len(a.bias) - 1 if kind == "bias" else len(a.scale) for a in triad.axes
            ]
            for name, triad in (
                ("gyroscope", found.gyroscope),
                ("accelerometer", found.accelerometer),
            )
            for kind in ("bias", "scale")
        },
    }

    def draw(path: Path) -> None:
        from imu_sim_ros.plots import calibration as pictures

        pictures.draw_temperature(found, path, arguments.bag.name)

    return correction.temperature_parameters(found), facts, draw


def _magnetometer(arguments: argparse.Namespace) -> Result:
    _, readings = read_measured(arguments.bag, SENSOR.table, arguments.topic, _left_out(arguments))
    found = calibrate_magnetometer(readings, arguments.field)
    facts = {
        "readings": len(readings),
        "field_T": found.field,
        "field_given": arguments.field is not None,
        "noise_T": found.noise,
        "rms_residual_T": float(np.sqrt(np.mean(found.residuals**2))),
    }

    def draw(path: Path) -> None:
        from imu_sim_ros.plots import calibration as pictures

        pictures.draw_ellipsoid(found, readings, path, f"{arguments.bag.name}: magnetometer")

    return correction.magnetometer_parameters(found), facts, draw


_KINDS: dict[str, Callable[[argparse.Namespace], Result]] = {
    "six_position": _six_position,
    "turntable": _turntable,
    "temperature": _temperature,
    "magnetometer": _magnetometer,
}


def _rates(
    arguments: argparse.Namespace, imu: ImuMessages, *, needed: bool = True
) -> tuple[Steady, Array]:
    """Return the steady pieces and their true rates, as given or from the truth in the bag."""
    steady = find_steady(imu.t_ns, imu.gyro, imu.accel, rotating=needed)
    rates = arguments.rates
    if arguments.rates_deg is not None:
        rates = np.radians(arguments.rates_deg)
    if rates is not None:
        return known_rates(steady, rates)
    truth = _truth(arguments)
    if truth is not None:
        return true_rates(steady, truth.t_ns, truth.angular_velocity_b)
    if needed:
        raise InputError(
            f"{arguments.bag}: the table's rates are not known: give --rates (rad/s) or --rates-deg"
        )
    return known_rates(steady, np.array([np.inf]))


def _truth(arguments: argparse.Namespace) -> OdometryMessages | None:
    try:
        left_out = skipped_rows(arguments, "calibrate", f"the truth of {arguments.bag}")
        return read_odometry(arguments.bag, arguments.truth_topic, left_out)
    except InputError:
        if arguments.truth_topic is not None:
            raise
        return None


def _rms(values: Array) -> list[float]:
    return [float(x) for x in np.sqrt(np.mean(values**2, axis=0))]


def _write(
    arguments: argparse.Namespace,
    folder: Path,
    values: correction.Parameters,
    draw: Callable[[Path], None],
) -> None:
    """Write both parameter files and the picture into a folder."""
    comment = f"Calibrated from {arguments.bag} ({arguments.kind})."
    correction.write_simulator(
        values, folder / "imu.yaml", f"{comment} For simulator and generate."
    )
    correction.write_correction(
        values,
        folder / "correction.yaml",
        f"{comment} For integrator and dead_reckon: x = S^-1 (reading - b)."
        if arguments.kind != "magnetometer"
        else f"{comment} field = matrix (reading - bias), bias in T.",
    )
    draw(folder / f"{arguments.kind}.png")


if __name__ == "__main__":
    sys.exit(main())
