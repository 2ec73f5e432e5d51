# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``evaluate`` for the orientation, the magnetic field and the pressure of a board."""

import argparse
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import program, rotation
from imu_sim_ros.bags import sensor_tables
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.bags.sensor_tables import TableRows, read_table
from imu_sim_ros.bags.text.reader import is_text
from imu_sim_ros.commands.inputs import skipped_rows
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.jobs.tracks import read_track, truth_topic
from imu_sim_ros.navigation.association import common_rows, interpolate_poses, interpolate_vectors
from imu_sim_ros.navigation.evaluation import (
    anees_band,
    attitude_errors,
    invertible,
    nees,
    statistics,
    tilt_and_heading,
)
from imu_sim_ros.sensors import known_tables
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.types import Array

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
    kind = None
    if arguments.estimate_topic is not None:
        kind = sensor_tables.table_of(arguments.estimate, arguments.estimate_topic, known_tables())
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
    """Read, compare, and say what came out."""
    skipped = skipped_rows(arguments, "evaluate", arguments.estimate)
    measured = read_table(arguments.estimate, kind, arguments.estimate_topic, skipped)
    where = f"{arguments.estimate}, {arguments.estimate_topic}"
    if kind.of_readings and not len(measured.t_ns):
        raise InputError(f"{where}: no message has an orientation: orientation_covariance[0] is -1")
    if len(measured.t_ns) < 2:
        raise InputError(f"{where}: {len(measured.t_ns)} values; two or more are needed")
    if kind.of_readings:
        result = _orientation(arguments, measured)
    else:
        result = _readings(arguments, measured, kind)
    if arguments.json:
        program.print_json(result)
    elif not arguments.quiet:
        _print(result)


def _orientation(arguments: argparse.Namespace, measured: TableRows) -> dict[str, Any]:
    """Compare orientations of the IMU with the truth of the body and the IMU's mounting."""
    topic = truth_topic(arguments.truth, arguments.truth_topic)
    skipped = skipped_rows(arguments, "evaluate", arguments.truth)
    truth = read_track(arguments.truth, topic, skipped=skipped).poses
    rows = common_rows(measured.t_ns, truth.t_ns, arguments.max_gap)
    q_wi = rotation.normalise(measured.values[rows])
    q_wb = interpolate_poses(truth, measured.t_ns[rows]).q_wb
    true = rotation.multiply(q_wb, _mounting(arguments)[None])
    errors = attitude_errors(q_wi, true)
    tilt, heading = tilt_and_heading(q_wi, true)
    return {
        **_common(arguments, "orientation", measured, rows),
        "attitude_error_rad": statistics(np.linalg.norm(errors, axis=1))._asdict(),
        "tilt_error_rad": statistics(tilt)._asdict(),
        "heading_error_rad": statistics(np.abs(heading))._asdict(),
        "mean_heading_error_rad": float(np.mean(heading)),
        "rms_attitude_vector_rad": np.sqrt(np.mean(errors**2, axis=0)),
        **_consistency(errors, measured.covariance[rows]),
    }


def _mounting(arguments: argparse.Namespace) -> Array:
    """Return q_bi of the sensor that is named."""
    layer = {} if arguments.imu is None else {"imu.preset": arguments.imu}
    imu = load_simulation(layer).imu
    return rotation.from_matrix(np.reshape(imu.mounting, (3, 3)))


def _readings(arguments: argparse.Namespace, measured: TableRows, kind: Table) -> dict[str, Any]:
    """Compare readings with the ideal ones of a recording and, if it has them, their biases."""
    truths = sensor_tables.truths_of(kind, arguments.estimate_topic)
    ideal_topic = arguments.truth_topic or truths.ideal
    if is_text(arguments.truth):
        raise InputError(f"{arguments.truth}: has no {ideal_topic}; a bag that has it is needed")
    skipped = skipped_rows(arguments, "evaluate", arguments.truth)
    truth = read_table(arguments.truth, kind, ideal_topic, skipped)
    rows = common_rows(measured.t_ns, truth.t_ns, arguments.max_gap)
    t_ns = measured.t_ns[rows]
    errors = measured.values[rows] - interpolate_vectors(truth.t_ns, truth.values, t_ns)
    result = {
        **_common(arguments, kind.name, measured, rows),
        "unit": kind.quantity.unit,
        "error": _moments(errors),
        "error_without_bias": None,
    }
    with open_bag(arguments.truth) as bag:
        biased = any(info.name.lstrip("/") == truths.bias.lstrip("/") for info in bag.topics)
    if not biased:
        why = f"the covariance is that of white noise, and there is no {truths.bias}"
        return {**result, "nees": None, "no_nees": why}
    bias_t_ns, bias = sensor_tables.read_bias(arguments.truth, kind, truths.bias)
    errors = errors - interpolate_vectors(bias_t_ns, bias, t_ns)
    result["error_without_bias"] = _moments(errors)
    return {**result, **_consistency(errors, measured.covariance[rows])}


def _common(
    arguments: argparse.Namespace, kind: str, measured: TableRows, rows: NDArray[np.intp]
) -> dict[str, Any]:
    t_ns = measured.t_ns[rows]
    return {
        "estimate": str(arguments.estimate),
        "truth": str(arguments.truth),
        "topic": arguments.estimate_topic,
        "kind": kind,
        "samples": len(rows),
        "samples_without_truth": len(measured.t_ns) - len(rows),
        "duration_s": float(t_ns[-1] - t_ns[0]) * 1e-9,
    }


def _moments(errors: Array) -> dict[str, Array]:
    return {
        "mean": errors.mean(axis=0),
        "std": errors.std(axis=0),
        "rms": np.sqrt(np.mean(errors**2, axis=0)),
        "max": np.abs(errors).max(axis=0),
    }


def _consistency(errors: Array, covariance: Array) -> dict[str, Any]:
    """Return the NEES if the messages state a covariance."""
    stated = invertible(covariance)
    if not stated.any():
        return {"nees": None, "no_nees": "the messages state no covariance"}
    freedom = errors.shape[1]
    values = nees(errors[stated], covariance[stated])
    band = anees_band(freedom, 1)
    return {
        "nees": {
            "samples": int(np.count_nonzero(stated)),
            "expected": freedom,
            "mean": float(values.mean()),
            "band_95": list(band),
            "inside_band": float(np.mean((values >= band.low) & (values <= band.high))),
        },
        "no_nees": None,
    }


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
