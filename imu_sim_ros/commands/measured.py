# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``evaluate`` for the orientation, the magnetic field and the pressure of a board."""

import argparse
from typing import Final

from imu_sim_ros import program
from imu_sim_ros.commands.common import skipped_rows
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.jobs.measured import evaluate_measured, lines, sensor_of

_UNFIT: Final = ("align", "rpe", "time_offset", "tracks", "output", "plot")


ARGUMENTS: Final = {
    "--imu NAME|FILE": "for an orientation: the sensor, whose imu.mounting applies (default: "
    "aligned with the body)",
}
"""Of these evaluations only."""


def table_of(arguments: argparse.Namespace) -> Table | None:
    """Return the kind of the estimate, as sensors declare their tables; None for a trajectory.

    :raises InputError: for arguments that apply to trajectories only, or the other way round.
    """
    kind = sensor_of(arguments.estimate, arguments.estimate_topic)
    of_orientation = kind is not None and kind.of_readings
    unfit = [] if of_orientation or arguments.imu is None else ["imu"]
    if kind is not None:
        unfit += [name for name in _UNFIT if getattr(arguments, name) not in (None, False, "none")]
    if unfit:
        what = "a trajectory" if kind is None else f"{arguments.estimate_topic}"
        raise InputError(
            [f"--{name.replace('_', '-')}: does not apply to {what}" for name in unfit]
        )
    return kind


def evaluate(arguments: argparse.Namespace, kind: Table) -> None:
    """Compare, and say what came out."""
    found = evaluate_measured(
        kind,
        (arguments.estimate, arguments.estimate_topic),
        (arguments.truth, arguments.truth_topic),
        arguments.max_gap,
        arguments.imu,
        lambda path: skipped_rows(arguments, "evaluate", path),
    )
    result = {
        "estimate": str(arguments.estimate),
        "truth": str(arguments.truth),
        "topic": arguments.estimate_topic,
        **found.to_dict(),
    }
    program.print_result(arguments, result, lines(result))
