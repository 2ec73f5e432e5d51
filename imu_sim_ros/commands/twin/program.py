# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``twin``: a sensor on its vehicle, from a recording in motion with a true trajectory.

Finds the constant errors and the vibration of a real flight, writes a parameter file that simulates
them on this flight or another, and a picture of the real residual beside the simulated one.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from imu_sim_ros.api.readings import Readings
from imu_sim_ros.api.twin import Twin
from imu_sim_ros.api.twin import twin as find
from imu_sim_ros.bags import read_imu
from imu_sim_ros.commands import common
from imu_sim_ros.commands.shared import (
    PoseReader,
    add_force,
    add_skip_bad_rows,
    outputs,
    skipped_rows,
)
from imu_sim_ros.commands.twin.tables import print_twin
from imu_sim_ros.conventions import GRAVITY

EXAMPLES: Final = """
twin flight.bag --truth mocap.tum -o twin
twin imu.csv --truth groundtruth.csv --fit 20s --json
twin flight.mcap --truth flight.mcap --truth-topic /ground_truth/odom --no-files
"""
_FILES: Final = ("twin.yaml", "twin.png")


def parser() -> common.Parser:
    """Return the command's arguments."""
    result = common.Parser(prog="twin", description=__doc__, examples=EXAMPLES)
    result.add_argument(
        "recording", metavar="RECORDING", type=Path, help="bag, EuRoC folder or CSV file"
    )
    result.add_argument(
        "--truth",
        metavar="POSES",
        type=Path,
        required=True,
        help="true poses of the body: TUM or EuRoC text, or a bag",
    )
    result.add_argument("--topic", help="sensor_msgs/Imu topic, where the bag has several")
    result.add_argument(
        "--truth-topic", metavar="TOPIC", help="of the poses, where there are several"
    )
    _add_numbers(result)
    result.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        default=Path("twin"),
        help="folder for twin.yaml and twin.png (default: twin)",
    )
    result.add_argument("--no-files", action="store_true", help="write no files, print only")
    add_skip_bad_rows(result)
    add_force(result)
    common.add_output_arguments(result)
    return result


def _add_numbers(result: argparse.ArgumentParser) -> None:
    result.add_argument(
        "--fit",
        metavar="TIME",
        type=common.duration,
        help="use this much of the recording, and compare the twin with the rest",
    )
    result.add_argument(
        "--gravity", type=float, default=-GRAVITY[2], help="local gravity [m/s^2] (%(default)s)"
    )
    result.add_argument(
        "--cutoff",
        metavar="HZ",
        type=float,
        default=12.0,
        help="motion of the truth at higher frequencies counts as vibration (%(default)s)",
    )
    result.add_argument(
        "--max-offset",
        metavar="TIME",
        type=common.duration,
        default=0.5,
        help="largest offset between both clocks that is looked for (%(default)s s)",
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return common.main(parser, run, argv)


def run(arguments: argparse.Namespace) -> None:
    """Find the twin, write the files and print."""
    written = outputs(arguments)
    staging = None if arguments.no_files else written.add_files(arguments.output, _FILES)
    with written:
        found = _found(arguments)
        if staging is not None:
            from imu_sim_ros.plots import style

            found.write(staging / _FILES[0])
            style.save(found.plot(), staging / _FILES[1])
    for warning in found.warnings:
        print(f"twin: warning: {warning}", file=sys.stderr)
    if arguments.json:
        common.print_json(found.as_json())
    elif not arguments.quiet:
        print_twin(found)
        if not arguments.no_files:
            print("\n".join(str(arguments.output / name) for name in _FILES))


def _found(arguments: argparse.Namespace) -> Twin:
    left_out = skipped_rows(arguments, "twin", arguments.recording)
    imu = read_imu(arguments.recording, arguments.topic, left_out)
    poses = PoseReader(arguments, "twin")(arguments.truth, arguments.truth_topic)
    return find(
        Readings(imu.t_ns, imu.gyro, imu.accel, str(arguments.recording)),
        poses,
        fit=arguments.fit,
        gravity=arguments.gravity,
        cutoff=arguments.cutoff,
        max_offset=arguments.max_offset,
    )
