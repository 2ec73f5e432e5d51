# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``evaluate``: compare an estimated trajectory with the truth: ATE, RPE, drift, NEES."""

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from imu_sim_ros import program
from imu_sim_ros.commands import measured
from imu_sim_ros.commands import tables as consistency
from imu_sim_ros.commands.inputs import PoseReader, add_skip_bad_rows, skipped_rows
from imu_sim_ros.commands.outputs import add_force, output_and_plot
from imu_sim_ros.jobs import reprojection
from imu_sim_ros.jobs.evaluate import Evaluation, compared
from imu_sim_ros.jobs.tracks import read_track, truth_topic
from imu_sim_ros.navigation.association import ALIGNMENTS

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
        found = _compared(arguments)
        result = {
            "estimate": str(arguments.estimate),
            "truth": str(arguments.truth),
            **found.to_dict(arguments.rpe or ()),
        }
        if arguments.output is not None:
            found.save(written.where(arguments.output))
        if arguments.plot is not None:
            from imu_sim_ros.plots import style  # 0.5 s of matplotlib

            picture = found.plot(f"{arguments.estimate.name} against {arguments.truth.name}")
            style.save(picture, written.where(arguments.plot))
    if arguments.json:
        program.print_json(result)
    elif not arguments.quiet:
        _print(result)


def _compared(arguments: argparse.Namespace) -> Evaluation:
    """Read both trajectories and compare them."""
    reader = PoseReader(arguments, "evaluate")
    left_out = skipped_rows(arguments, "evaluate", arguments.estimate)
    estimate = read_track(arguments.estimate, arguments.estimate_topic, True, reader, left_out)
    topic = truth_topic(arguments.truth, arguments.truth_topic)
    left_out = skipped_rows(arguments, "evaluate", arguments.truth)
    truth = read_track(arguments.truth, topic, reader=reader, skipped=left_out)
    how = (arguments.align, arguments.max_gap, arguments.time_offset, arguments.tracks)
    return compared(estimate, truth, *how)


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
