# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``dead_reckon``: the trajectory that a bag's IMU readings give, and its error against the truth.

The parameters are those of the integrator node, so that one file serves both.
"""

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import program
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.bags.read import ImuMessages, read_imu
from imu_sim_ros.commands.inputs import PoseReader, add_skip_bad_rows, skipped_rows
from imu_sim_ros.commands.outputs import add_force, output_and_plot
from imu_sim_ros.conventions import TRUTH_TOPIC
from imu_sim_ros.datasets.truth_files import world_of
from imu_sim_ros.errors import InputError
from imu_sim_ros.jobs.navigation import CURVED_EARTH, world_parameters
from imu_sim_ros.jobs.tracks import has_truth, read_track, truth_topic, write_states
from imu_sim_ros.navigation import initialisation
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.evaluation import Drift, Truth, distances, drift_from
from imu_sim_ros.navigation.initialisation import Initial
from imu_sim_ros.navigation.parameters import (
    ATTITUDE_UPDATES,
    INITIAL_STATES,
    METHODS,
    IntegratorParameters,
    layer_integrator,
)
from imu_sim_ros.navigation.state import NavigationStates
from imu_sim_ros.parameters.files import build_layered
from imu_sim_ros.rotation import to_euler


class Result(NamedTuple):
    """One way of integrating, and what came of it."""

    method: str
    attitude: str
    states: NavigationStates
    drift: Drift | None


EXAMPLES: Final = """
dead_reckon flight.mcap --all
dead_reckon flight.bag --initial-state level -o track.csv --plot track.png
dead_reckon V1_02/mav0 --correction calibration/correction.yaml --json
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="dead_reckon", description=__doc__, examples=EXAMPLES)
    result.add_argument(
        "bag", type=Path, metavar="BAG", help="a bag of any format, or a EuRoC folder"
    )
    result.add_argument(
        "--imu-topic", metavar="TOPIC", help="topic of the readings, if the bag has several"
    )
    result.add_argument("--truth-topic", metavar="TOPIC", help=f"default: {TRUTH_TOPIC}")
    result.add_argument(
        "--method", choices=METHODS, help="integration of position and velocity (default: midpoint)"
    )
    result.add_argument(
        "--attitude-update",
        choices=ATTITUDE_UPDATES,
        help="integration of the attitude (default: so3)",
    )
    result.add_argument(
        "--all", action="store_true", help="run all methods with all attitude updates"
    )
    result.add_argument(
        "--initial-state",
        choices=INITIAL_STATES,
        help="start at the truth (the default), at initial_* of the parameters, or level: roll and "
        "pitch from gravity at rest, gyroscope bias from the mean of level_time; position and yaw "
        "then come from the truth if there is one",
    )
    result.add_argument(
        "--correction",
        type=Path,
        metavar="FILE",
        help="parameter file with known biases, scales and misalignments, as written by calibrate",
    )
    result.add_argument(
        "--skip",
        type=program.duration,
        metavar="TIME",
        default=0.0,
        help="skip the readings before this time, counted from the first",
    )
    result.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="write the trajectory: .csv with velocity, anything else in TUM format",
    )
    result.add_argument(
        "--plot", type=Path, metavar="FILE", help="write a plot: paths, and error over time"
    )
    program.add_parameter_arguments(result)
    add_skip_bad_rows(result)
    add_force(result)
    program.add_output_arguments(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, run, argv)


def run(arguments: argparse.Namespace) -> None:
    """Integrate, compare, and say what came out."""
    with output_and_plot(arguments) as written:
        summaries = _made(arguments, written)
    if arguments.json:
        program.print_json(summaries if arguments.all else summaries[0])
    elif not arguments.quiet:
        _print(summaries)


def _made(arguments: argparse.Namespace, written: Outputs) -> list[dict[str, Any]]:
    """Integrate and write; returns what came out of each way of integrating."""
    parameters = _parameters(arguments)
    left_out = skipped_rows(arguments, "dead_reckon", arguments.bag)
    found = read_imu(arguments.bag, arguments.imu_topic, left_out)
    readings = _skipped(found, arguments.skip)
    truth = _read_truth(arguments)
    if truth is None and parameters.initial_state == "truth":
        raise initialisation.without_truth(
            str(arguments.bag), "--initial-state level or --initial-state parameters"
        )
    if parameters.initial_state == "truth" and truth is not None:
        readings = _within(readings, truth, parameters.max_gap)
    readings, initial = _initial(parameters, readings, truth)
    results = [
        _integrate(parameters, method, attitude, readings, initial, truth)
        for method, attitude in _ways(arguments, parameters)
    ]
    if arguments.output is not None:
        write_states(written.where(arguments.output), results[0].states)
    if arguments.plot is not None:
        _draw(written.where(arguments.plot), results, truth, arguments.bag.name)
    return [_summary(result, parameters.initial_state) for result in results]


def _parameters(arguments: argparse.Namespace) -> IntegratorParameters:
    chosen: dict[str, object] = {}
    for name in ("method", "attitude_update", "initial_state"):
        if getattr(arguments, name) is not None:
            chosen[name] = getattr(arguments, name)
    if arguments.correction is not None:
        chosen["calibration"] = str(arguments.correction)
    layers = program.parameter_layers(arguments, "integrator")
    merged: dict[str, object] = {"initial_state": "truth", **_world(arguments.bag)}
    for values in (*layers[:-1], chosen, layers[-1]):
        merged.update(values)
    return build_layered(IntegratorParameters, layer_integrator, merged)


def _world(bag: Path) -> dict[str, object]:
    """Return gravity and the Earth's rate as the realised truth next to a bag tells, if it does."""
    world = world_of(bag)
    if world is None:
        return {}
    if world.curved_earth:
        print(f"dead_reckon: {bag}: {CURVED_EARTH}", file=sys.stderr)
    return world_parameters(world)


def _ways(
    arguments: argparse.Namespace, parameters: IntegratorParameters
) -> Iterator[tuple[str, str]]:
    if not arguments.all:
        yield parameters.method, parameters.attitude_update
        return
    for method in METHODS:
        for attitude in ATTITUDE_UPDATES:
            yield method, attitude


def _skipped(readings: ImuMessages, skip: float) -> ImuMessages:
    """Skip the readings before a time after the first."""
    if not skip or not len(readings.t_ns):
        return readings
    return _from(readings, int(readings.t_ns[0]) + round(skip * 1e9))


def _from(readings: ImuMessages, t_ns: int) -> ImuMessages:
    return _rows(readings, readings.t_ns >= t_ns)


def _rows(readings: ImuMessages, keep: NDArray[np.bool_] | slice) -> ImuMessages:
    return readings._replace(
        t_ns=readings.t_ns[keep],
        gyro=readings.gyro[keep],
        accel=readings.accel[keep],
        record_t_ns=readings.record_t_ns[keep],
    )


def _read_truth(arguments: argparse.Namespace) -> Truth | None:
    """Return the truth in the bag, None where there is none."""
    path: Path = arguments.bag
    if arguments.truth_topic is None and not has_truth(path):
        return None
    track = read_track(
        path,
        truth_topic(path, arguments.truth_topic),
        reader=PoseReader(arguments, "dead_reckon"),
        skipped=skipped_rows(arguments, "dead_reckon", f"the truth of {path}"),
    )
    if track.velocity is None:
        raise InputError(f"{path}: the truth has no velocity, which the initial state needs")
    return Truth(track.poses, track.velocity)


def _within(readings: ImuMessages, truth: Truth, tolerance: float) -> ImuMessages:
    """Skip the few readings ahead of the truth's first stamp.

    :raises InputError: where they are not few, or none remains.
    """
    first, last = int(truth.poses.t_ns[0]), int(truth.poses.t_ns[-1])
    if not len(readings.t_ns):
        return readings
    late = (first - int(readings.t_ns[0])) * 1e-9
    if first > readings.t_ns[-1] or last < readings.t_ns[0]:
        raise InputError(
            "readings and truth do not overlap in time: the readings span "
            f"{readings.t_ns[0] / 1e9:.3f} to {readings.t_ns[-1] / 1e9:.3f} s, the truth from "
            f"{first / 1e9:.3f} to {last / 1e9:.3f} s"
        )
    if late > tolerance:
        raise InputError(
            f"the truth starts {late:.6g} s after the readings; skip the readings before it "
            f"with --skip {math.ceil(late * 1e3) / 1e3:g}s, or start with --initial-state level"
        )
    return _from(readings, first)


def _initial(
    parameters: IntegratorParameters, readings: ImuMessages, truth: Truth | None
) -> tuple[ImuMessages, Initial]:
    """Return the readings from the start on, and what integration starts with."""
    if not len(readings.t_ns):
        raise InputError("0 readings: integration needs at least two")
    if parameters.initial_state == "truth" and truth is not None:
        state = truth.at(int(readings.t_ns[0]))
        return readings, initialisation.from_state(parameters, state)
    if parameters.initial_state == "parameters":
        return readings, initialisation.from_parameters(parameters)
    rest = initialisation.rest_rows(parameters, readings.t_ns)
    start_ns = int(readings.t_ns[rest.stop - 1])
    position = yaw = None
    if truth is not None and truth.poses.t_ns[0] <= start_ns <= truth.poses.t_ns[-1]:
        start = truth.at(start_ns)
        position, yaw = start.position, float(to_euler(start.q_wb)[2])
    initial = initialisation.from_rest(
        parameters, readings.gyro[rest], readings.accel[rest], position=position, yaw=yaw
    )
    return _rows(readings, slice(rest.stop - 1, None)), initial


def _integrate(
    parameters: IntegratorParameters,
    method: str,
    attitude: str,
    readings: ImuMessages,
    initial: Initial,
    truth: Truth | None,
) -> Result:
    states = dead_reckon(
        readings.t_ns,
        readings.gyro,
        readings.accel,
        initial.state,
        method,
        attitude,
        parameters.gravity,
        initial.correction,
        parameters.max_gap,
        parameters.earth_rate,
    )
    return Result(method, attitude, states, None if truth is None else drift_from(states, truth))


def _summary(result: Result, initial_state: str) -> dict[str, Any]:
    """Return the result as JSON has it; errors are null where there is no truth."""
    states, errors = result.states, result.drift
    length = float(distances(states.position)[-1]) if errors is None else errors.distance
    summary: dict[str, Any] = {
        "method": result.method,
        "attitude_update": result.attitude,
        "initial_state": initial_state,
        "samples": len(states.t_ns),
        "duration_s": float(states.t_ns[-1] - states.t_ns[0]) * 1e-9,
        "distance_m": length,
    }
    for name, unit in (("position", "m"), ("velocity", "m_s"), ("attitude", "rad")):
        summary[f"final_{name}_error_{unit}"] = errors and errors.final(name)
        summary[f"rms_{name}_error_{unit}"] = errors and errors.rms(name)
    for kind in ("final", "rms"):
        error = summary[f"{kind}_position_error_m"]
        known = error is not None and length > 0.0
        summary[f"{kind}_position_error_percent"] = 100.0 * error / length if known else None
    return summary


def _print(summaries: Sequence[dict[str, Any]]) -> None:
    first = summaries[0]
    print(
        f"{first['samples']} readings, {first['duration_s']:.6g} s, "
        f"{first['distance_m']:.6g} m travelled, initial state: {first['initial_state']}"
    )
    columns = {
        "position [m]": "final_position_error_m",
        "of path [%]": "final_position_error_percent",
        "rms [m]": "rms_position_error_m",
        "v [m/s]": "final_velocity_error_m_s",
        "att. [rad]": "final_attitude_error_rad",
    }
    rows = [
        [summary["method"], summary["attitude_update"]]
        + ["-" if summary[key] is None else f"{summary[key]:.4g}" for key in columns.values()]
        for summary in summaries
    ]
    title = "Final errors against the truth; rms: of the position over the run"
    program.print_table(["method", "attitude", *columns], rows, title)


def _draw(path: Path, results: Sequence[Result], truth: Truth | None, source: str) -> None:
    from imu_sim_ros.plots import navigation, style  # 0.5 s of matplotlib

    names = [f"{result.method}, {result.attitude}" for result in results]
    named = [(n, r.drift) for n, r in zip(names, results, strict=True) if r.drift is not None]
    errors = {
        kind: {
            name: ((d.t_ns - d.t_ns[0]) * 1e-9, np.linalg.norm(getattr(d, kind), axis=1))
            for name, d in named
        }
        for kind in ("position", "attitude")
    }
    figure = navigation.trajectories(
        {name: result.states.position for name, result in zip(names, results, strict=True)},
        None if truth is None else truth.poses.position,
        errors["position"],
        errors["attitude"],
        f"{source}: dead reckoning" + ("" if truth is None else " against the truth"),
    )
    style.save(figure, path)


if __name__ == "__main__":
    sys.exit(main())
