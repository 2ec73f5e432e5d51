# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``add_errors``: add the errors of a chosen sensor to another simulator's ideal readings."""

import argparse
import sys
from functools import partial
from typing import Final

from imu_sim_ros.commands import program
from imu_sim_ros.jobs.add_errors_files import add_errors_to_file
from imu_sim_ros.terminal.signatures import arguments_of, call_job

EXAMPLES: Final = """
  add_errors ideal.mcap -o noisy.mcap --imu bmi088 --seed 3
  add_errors gazebo.bag -o noisy.bag --imu model.sdf --input-topic /imu
  add_errors airsim.mcap -o noisy.mcap --imu mpu6000 --set input.axes=frd
  add_errors MH_99 -o MH_99_noisy --format euroc --imu adis16448
"""
_ARGUMENTS: Final = {**arguments_of(add_errors_to_file), **program.JSON_AND_QUIET}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser(
        "add_errors", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS
    )


def add_errors(arguments: argparse.Namespace) -> None:
    """Write the outputs that the arguments name."""
    program.show(arguments, call_job(add_errors_to_file, arguments))


main = partial(program.main, parser, add_errors)

if __name__ == "__main__":
    sys.exit(main())
