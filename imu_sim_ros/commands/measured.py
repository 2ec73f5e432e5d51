# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``evaluate`` for the orientation, the magnetic field and the pressure of a board."""

import argparse
from typing import Any, Final

import numpy as np

from imu_sim_ros import program
from imu_sim_ros.commands.inputs import skipped_rows
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.jobs.measured import evaluate_measured, sensor_of

_UNFIT: Final = ("align", "rpe", "time_offset", "tracks", "output", "plot")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what only these evaluations take."""
    parser.add_argument(
        "--imu",
        metavar="NAME|FILE",
        help="sensor of an orientation, for its imu.mounting on the body (default: aligned)",
    )


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
    if arguments.json:
        program.print_json(result)
    elif not arguments.quiet:
        _print(result)


def _print(result: dict[str, Any]) -> None:
    print(f"{result['topic']}: {result['samples']} samples, {result['duration_s']:.6g} s")
    if result["samples_without_truth"]:
        print(f"{result['samples_without_truth']} samples skipped: no truth at their times")
    if result["kind"] == "orientation":
        names = ("rmse", "mean", "median", "std", "min", "max")
        rows = [
            [f"{what} [deg]", *(f"{np.degrees(result[f'{what}_error_rad'][k]):.3g}" for k in names)]
            for what in ("attitude", "tilt", "heading")
        ]
        program.print_table(["error", *names], rows)
        print(f"mean heading error: {np.degrees(result['mean_heading_error_rad']):.3g} deg")
    else:
        _print_moments(result)
    if result["nees"] is None:
        print(f"no NEES: {result['no_nees']}")
        return
    low, high = result["nees"]["band_95"]
    print(
        f"NEES: {result['nees']['mean']:.3g}, {result['nees']['expected']} expected; "
        f"{100.0 * result['nees']['inside_band']:.0f} % between {low:.3g} and {high:.3g}, "
        "95 % expected"
    )


def _print_moments(result: dict[str, Any]) -> None:
    names = ("mean", "std", "rms", "max")
    for key, title in (
        ("error", "reading minus truth"),
        ("error_without_bias", "and minus the true bias"),
    ):
        if result[key] is not None:
            columns = np.array([result[key][name] for name in names]).T
            axes = "xyz" if len(columns) > 1 else ("",)
            rows = [
                [f"{axis} [{result['unit']}]".strip(), *(f"{value:.3g}" for value in row)]
                for axis, row in zip(axes, columns, strict=True)
            ]
            program.print_table(["axis", *names], rows, title)
