# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``evaluate``: compare an estimated trajectory with the truth: ATE, RPE, drift, NEES."""

import argparse
import re
from functools import partial
from pathlib import Path
from typing import Final

from imu_sim_ros import program
from imu_sim_ros.commands import measured
from imu_sim_ros.commands.common import COMMON, PoseReader, output_and_plot, save_plot, skipped_rows
from imu_sim_ros.jobs.evaluate import Evaluation, compared, lines
from imu_sim_ros.jobs.tracks import read_track, truth_topic
from imu_sim_ros.navigation.association import ALIGNMENTS

EXAMPLES: Final = """
evaluate track.csv flight.mcap
evaluate estimate.tum groundtruth.csv --align se3 --rpe 1s --rpe 10m
evaluate vio.tum flight.mcap --align yaw --time-offset
evaluate run.mcap run.mcap --estimate-topic /dead_reckoned/odom --plot errors.png
evaluate flight.mcap flight.mcap --estimate-topic imu/data  # or imu/mag, imu/pressure
"""

_UNITS: Final = {
    "s": (1.0, "s"),
    "min": (60.0, "s"),
    "m": (1.0, "m"),
    "km": (1000.0, "m"),
    **dict.fromkeys(("frame", "frames"), (1.0, "frames")),
}


def _delta(words: str) -> tuple[float, str]:
    match = re.fullmatch(r"(\d+\.?\d*|\.\d+)\s*(s|min|m|km|frames?)", words.strip())
    if match is None or float(match[1]) == 0.0:
        raise argparse.ArgumentTypeError(f"{words!r} is not a delta such as 1s, 10m or 5frames")
    scale, unit = _UNITS[match[2]]
    return float(match[1]) * scale, unit


_POSES: Final = "TUM or EuRoC text, or a bag"
_ARGUMENTS: Final = {
    "estimate ESTIMATE": {"type": Path, "help": _POSES},
    "truth TRUTH": {"type": Path, "help": f"{_POSES}; may be the same bag"},
    "--estimate-topic TOPIC": "topic of the estimate, if the bag has several",
    "--truth-topic TOPIC": "topic of the truth, if the bag has several",
    "--align": {
        "choices": ALIGNMENTS,
        "default": "none",
        "help": "align the estimate with the truth first (default: none). yaw: heading and "
        "position, 4 degrees of freedom; se3: a rigid motion; sim3: a rigid motion and scale",
    },
    "--rpe DELTA": {
        "type": _delta,
        "action": "append",
        "help": "relative error over 1s, 10m or 5frames; repeatable. Default: 1s, and tenths of "
        "the path's length up to half of it",
    },
    "--time-offset": "find the time offset of the estimate from the motion (up to 1 s) and remove "
    "it before comparing",
    "--max-gap TIME": {
        "default": 0.5,
        "help": "do not interpolate the truth across longer gaps (default: 0.5s)",
    },
    "--tracks DIR": "folder of generate --format tracks: report the reprojection error, in pixels, "
    "of its landmarks as seen from the estimate; poses further apart than 20 ms are not "
    "interpolated",
    "--plot FILE": "write a plot",
    "-o --output FILE": "write the aligned estimate in TUM format",
    **measured.ARGUMENTS,
    **COMMON,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser("evaluate", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


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
        title = f"{arguments.estimate.name} against {arguments.truth.name}"
        save_plot(arguments, written, lambda: found.plot(title))
    program.print_result(arguments, result, lines(result))


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


main = partial(program.main, parser, run)
