# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``evaluate``: compare an estimated trajectory with the truth: ATE, RPE, drift, NEES."""

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros import program
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.commands import measured
from imu_sim_ros.commands import tables as consistency
from imu_sim_ros.commands.inputs import PoseReader, add_skip_bad_rows, skipped_rows
from imu_sim_ros.commands.outputs import add_force, output_and_plot
from imu_sim_ros.jobs import reprojection
from imu_sim_ros.jobs.tracks import Track, read_track, truth_topic
from imu_sim_ros.navigation.association import (
    ALIGNMENTS,
    Alignment,
    align,
    common_rows,
    interpolate_poses,
    interpolate_vectors,
    time_offset,
)
from imu_sim_ros.navigation.evaluation import (
    AbsoluteErrors,
    absolute_errors,
    distances,
    pairs,
    relative_errors,
    stated_nees,
    statistics,
    why_no_nees,
)
from imu_sim_ros.poses import PoseSequence, write_tum
from imu_sim_ros.rotation import rotate_inverse

DEFAULT_FRACTIONS = (0.1, 0.2, 0.3, 0.4, 0.5)
"""Default distances of the RPE, as shares of the length of the path."""

EXAMPLES: Final = """
evaluate track.csv flight.mcap
evaluate estimate.tum groundtruth.csv --align se3 --rpe 1s --rpe 10m
evaluate vio.tum flight.mcap --align yaw --time-offset
evaluate run.mcap run.mcap --estimate-topic /dead_reckoned/odom --plot errors.png
evaluate flight.mcap flight.mcap --estimate-topic imu/data  # or imu/mag, imu/pressure
"""


_TRACKS: Final = (
    "folder of generate --format tracks: report the reprojection error, in pixels, of its "
    "landmarks as seen from the estimate; poses further apart than 20 ms are not interpolated"
)


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="evaluate", description=__doc__, examples=EXAMPLES)
    kinds = "TUM or EuRoC text, or a bag"
    result.add_argument("estimate", type=Path, metavar="ESTIMATE", help=kinds)
    result.add_argument("truth", type=Path, metavar="TRUTH", help=f"{kinds}; may be the same bag")
    result.add_argument(
        "--estimate-topic", metavar="TOPIC", help="topic of the estimate, if several"
    )
    result.add_argument("--truth-topic", metavar="TOPIC", help="topic of the truth, if several")
    result.add_argument(
        "--align",
        choices=ALIGNMENTS,
        default="none",
        help="align the estimate with the truth first: in yaw and position (4 degrees of freedom), "
        "a rigid motion, or with scale",
    )
    result.add_argument(
        "--rpe",
        metavar="DELTA",
        type=_delta,
        action="append",
        help="relative error over 1s, 10m or 5frames; repeatable. Default: 1s, and tenths of the "
        "path's length up to half of it",
    )
    result.add_argument(
        "--time-offset",
        action="store_true",
        help="find the time offset of the estimate from the motion (up to 1 s) and remove it "
        "before comparing",
    )
    result.add_argument(
        "--max-gap",
        metavar="TIME",
        type=program.duration,
        default=0.5,
        help="do not interpolate the truth across longer gaps (default: 0.5s)",
    )
    result.add_argument("--tracks", type=Path, metavar="DIR", help=_TRACKS)
    result.add_argument("--plot", type=Path, metavar="FILE", help="write a plot")
    result.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="write the aligned estimate in TUM format"
    )
    measured.add_arguments(result)
    add_skip_bad_rows(result)
    add_force(result)
    program.add_output_arguments(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, run, argv)


def run(arguments: argparse.Namespace) -> None:
    """Read, associate, align, compare, and say what came out."""
    kind = measured.table_of(arguments)
    if kind is not None:
        measured.evaluate(arguments, kind)
        return
    with output_and_plot(arguments) as written:
        result = _made(arguments, written)
    if arguments.json:
        program.print_json(result)
    elif not arguments.quiet:
        _print(result)


def _made(arguments: argparse.Namespace, written: Outputs) -> dict[str, Any]:
    """Compare and write; returns what came out."""
    reader = PoseReader(arguments, "evaluate")
    left_out = skipped_rows(arguments, "evaluate", arguments.estimate)
    estimate = read_track(arguments.estimate, arguments.estimate_topic, True, reader, left_out)
    topic = truth_topic(arguments.truth, arguments.truth_topic)
    left_out = skipped_rows(arguments, "evaluate", arguments.truth)
    truth = read_track(arguments.truth, topic, reader=reader, skipped=left_out)
    offset = _time_offset(arguments, estimate, truth) if arguments.time_offset else None
    if offset is not None:
        estimate = _shifted(estimate, offset["value_s"])
    rows = common_rows(estimate.poses.t_ns, truth.poses.t_ns, arguments.max_gap)
    at_ns = estimate.poses.t_ns[rows]
    true_poses = interpolate_poses(truth.poses, at_ns)
    poses = PoseSequence(at_ns, estimate.poses.position[rows], estimate.poses.q_wb[rows])
    alignment = align(poses.position, true_poses.position, arguments.align)
    poses = alignment.apply(poses)
    errors = absolute_errors(poses, true_poses)
    result = _result(arguments, estimate, poses, true_poses, errors, alignment)
    result["time_offset"] = offset
    velocity_b = None
    result["velocity_error_m_s"] = None
    if estimate.velocity is not None and truth.velocity is not None:
        true_velocity = interpolate_vectors(truth.poses.t_ns, truth.velocity, at_ns)
        velocity = alignment.scale * estimate.velocity[rows] @ alignment.r.T
        lengths = np.linalg.norm(true_velocity - velocity, axis=1)
        result["velocity_error_m_s"] = statistics(lengths)._asdict()
        velocity_b = rotate_inverse(true_poses.q_wb, true_velocity)
        velocity_b -= rotate_inverse(poses.q_wb, velocity)
    result["nees"] = None
    stated, twist = (
        None if each is None else each[rows]
        for each in (estimate.pose_covariance, estimate.twist_covariance)
    )
    result["no_nees"] = why_no_nees(arguments.align, stated)
    if result["no_nees"] is None and stated is not None:
        own = PoseSequence(at_ns, estimate.poses.position[rows], estimate.poses.q_wb[rows])
        linear = None if twist is None else twist[:, :3, :3]
        result["nees"] = stated_nees(stated, own, true_poses, arguments.align, velocity_b, linear)
        if result["nees"] is None:
            result["no_nees"] = "the estimate's covariances are singular"
    result["reprojection"] = None
    if arguments.tracks is not None:
        result["reprojection"] = reprojection.reprojection(arguments.tracks, poses, truth.poses)
    if arguments.output is not None:
        write_tum(written.where(arguments.output), poses)
    if arguments.plot is not None:
        title = f"{arguments.estimate.name} against {arguments.truth.name}"
        title += f", alignment: {arguments.align}, ATE {result['ate_m']['rmse']:.4g} m"
        _draw(written.where(arguments.plot), poses, true_poses, errors, title)
    return result


def _time_offset(arguments: argparse.Namespace, estimate: Track, truth: Track) -> dict[str, float]:
    """Return the offset to be added to the estimate's stamps, and the ATE without it."""
    scaled = arguments.align == "sim3"
    value = time_offset(estimate.poses, truth.poses, arguments.max_gap, scaled)
    rows = common_rows(estimate.poses.t_ns, truth.poses.t_ns, arguments.max_gap)
    position = estimate.poses.position[rows]
    true_position = interpolate_poses(truth.poses, estimate.poses.t_ns[rows]).position
    found = align(position, true_position, arguments.align)
    lengths = np.linalg.norm(true_position - (found.scale * position @ found.r.T + found.t), axis=1)
    return {"value_s": value, "ate_rmse_m_before": statistics(lengths).rmse}


def _shifted(track: Track, seconds: float) -> Track:
    t_ns = track.poses.t_ns + round(seconds * 1e9)
    return track._replace(poses=track.poses._replace(t_ns=t_ns))


def _delta(words: str) -> tuple[float, str]:
    match = re.fullmatch(r"(\d+\.?\d*|\.\d+)\s*(s|min|m|km|frames?)", words.strip())
    if match is None or float(match[1]) == 0.0:
        raise argparse.ArgumentTypeError(f"{words!r} is not a delta such as 1s, 10m or 5frames")
    scale, unit = {
        "s": (1.0, "s"),
        "min": (60.0, "s"),
        "m": (1.0, "m"),
        "km": (1000.0, "m"),
        "frame": (1.0, "frames"),
        "frames": (1.0, "frames"),
    }[match[2]]
    return float(match[1]) * scale, unit


def _result(
    arguments: argparse.Namespace,
    estimate: Track,
    poses: PoseSequence,
    truth: PoseSequence,
    errors: AbsoluteErrors,
    alignment: Alignment,
) -> dict[str, Any]:
    lengths = np.linalg.norm(errors.position, axis=1)
    distance = float(distances(truth.position)[-1])
    return {
        "estimate": str(arguments.estimate),
        "truth": str(arguments.truth),
        "poses": len(poses.t_ns),
        "poses_without_truth": len(estimate.poses.t_ns) - len(poses.t_ns),
        "duration_s": float(poses.t_ns[-1] - poses.t_ns[0]) * 1e-9,
        "distance_m": distance,
        "alignment": {
            "kind": arguments.align,
            "scale": alignment.scale,
            "rotation": alignment.r,
            "translation_m": alignment.t,
        },
        "ate_m": statistics(lengths)._asdict(),
        "attitude_error_rad": statistics(np.linalg.norm(errors.attitude, axis=1))._asdict(),
        "rms_attitude_vector_rad": np.sqrt(np.mean(errors.attitude**2, axis=0)),
        "final_attitude_vector_rad": errors.attitude[-1],
        "final_position_error_m": float(lengths[-1]),
        "final_drift_percent": 100.0 * float(lengths[-1]) / distance if distance > 0.0 else None,
        "rpe": _relative(arguments, poses, truth, distance),
    }


def _relative(
    arguments: argparse.Namespace, poses: PoseSequence, truth: PoseSequence, distance: float
) -> list[dict[str, Any]]:
    wanted: list[tuple[float, str]] = arguments.rpe or []
    if not wanted:
        if truth.t_ns[-1] - truth.t_ns[0] >= 1e9:
            wanted = [(1.0, "s")]
        if distance > 0.0:
            wanted = [*wanted, *((fraction * distance, "m") for fraction in DEFAULT_FRACTIONS)]
    return [_relative_over(delta, unit, poses, truth) for delta, unit in wanted]


def _relative_over(
    delta: float, unit: str, poses: PoseSequence, truth: PoseSequence
) -> dict[str, Any]:
    first, second = pairs(truth, delta, unit)
    errors = relative_errors(poses, truth, first, second)
    moved = errors.length > 0.0
    return {
        "delta": delta,
        "unit": unit,
        "pairs": len(first),
        "translation_m": statistics(errors.translation)._asdict(),
        "rotation_rad": statistics(errors.rotation)._asdict(),
        "translation_percent": 100.0
        * float(np.mean(errors.translation[moved] / errors.length[moved]))
        if moved.any()
        else None,
    }


def _draw(
    path: Path, poses: PoseSequence, truth: PoseSequence, errors: AbsoluteErrors, title: str
) -> None:
    from imu_sim_ros.plots import navigation, style  # 0.5 s of matplotlib

    t = (poses.t_ns - poses.t_ns[0]) * 1e-9
    positions = (poses.position, truth.position, errors.position)
    style.save(navigation.evaluation(t, *positions, errors.attitude, title), path)


def _print(result: dict[str, Any]) -> None:
    print(
        f"{result['poses']} poses, {result['duration_s']:.6g} s, {result['distance_m']:.6g} m, "
        f"alignment: {result['alignment']['kind']}"
    )
    if result["poses_without_truth"]:
        print(f"{result['poses_without_truth']} poses skipped: no truth at their times")
    if result["alignment"]["kind"] == "sim3":
        print(f"scale of the estimate: {result['alignment']['scale']:.6g}")
    if result["time_offset"] is not None:
        print(
            f"time offset: {1e3 * result['time_offset']['value_s']:.2f} ms added to the estimate's "
            f"stamps; ATE {result['time_offset']['ate_rmse_m_before']:.4g} m without, "
            f"{result['ate_m']['rmse']:.4g} m with it"
        )
    names = ("rmse", "mean", "median", "std", "min", "max")
    rows = [("ATE position [m]", result["ate_m"]), ("attitude [rad]", result["attitude_error_rad"])]
    if result["velocity_error_m_s"] is not None:
        rows.append(("velocity [m/s]", result["velocity_error_m_s"]))
    for entry in result["rpe"]:
        over = f"RPE {entry['delta']:.3g} {entry['unit']}"
        rows.append((f"{over} [m]", entry["translation_m"]))
        rows.append((f"{over} [rad]", entry["rotation_rad"]))
    table = [[name, *(f"{values[key]:.3g}" for key in names)] for name, values in rows]
    program.print_table(["error", *names], table)
    if result["final_drift_percent"] is not None:
        print(
            f"final drift: {result['final_position_error_m']:.4g} m, "
            f"{result['final_drift_percent']:.4g} % of the distance"
        )
    if result["nees"] is not None:
        consistency.show(result["nees"])
    else:
        print(f"no NEES: {result['no_nees']}")
    if result["reprojection"] is not None:
        print("\n".join(reprojection.lines(result["reprojection"])))


if __name__ == "__main__":
    sys.exit(main())
