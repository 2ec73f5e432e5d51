# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``report``: a campaign or recorded bags as one HTML page that needs nothing else."""

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from imu_sim_ros.bags.text import is_text
from imu_sim_ros.commands import common
from imu_sim_ros.commands.shared import (
    PoseReader,
    add_force,
    add_skip_bad_rows,
    has_truth,
    odometry_topics,
    outputs,
    read_track,
    truth_topic,
)
from imu_sim_ros.errors import InputError

if TYPE_CHECKING:
    from imu_sim_ros.report import Section

EXAMPLES: Final = """
report results
report flight.mcap -o flight.html
report flight.mcap track.csv other.tum -o compared.html --title "Two filters, one flight"
report monday tuesday -o both.html --metric final_position_error_m
"""
_POSES: Final = (".txt", ".tum", ".csv")


def parser() -> argparse.ArgumentParser:
    """Return the command's arguments."""
    result = common.Parser(prog="report", description=__doc__, examples=EXAMPLES)
    result.add_argument(
        "inputs",
        metavar="INPUT",
        nargs="+",
        type=Path,
        help="folder of a campaign, bag, EuRoC folder; a file of poses (TUM, EuRoC) after a bag "
        "is an estimate of its motion",
    )
    result.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="the page; default: report.html in the first campaign, else NAME.html",
    )
    result.add_argument("--title", help="the page's title")
    result.add_argument(
        "--metric", default="", metavar="NAME", help="metric of a campaign that is shown first"
    )
    result.add_argument("--truth-topic", metavar="TOPIC", help="where a bag has several")
    add_skip_bad_rows(result)
    add_force(result)
    common.add_output_arguments(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return common.main(parser, run, argv)


def run(arguments: argparse.Namespace) -> None:
    """Read the inputs and write the page."""
    from imu_sim_ros.report import html

    missing = [f"{path}: no such file or folder" for path in arguments.inputs if not path.exists()]
    if missing:
        raise InputError(missing)
    path = arguments.output or _default_output(arguments.inputs)
    written = outputs(_files(arguments))
    written.add(path, endings=(".html", ".htm"))
    with written:
        titles, sections = _sections(arguments)
        title = arguments.title or "; ".join(titles)
        page = html(title, [_made_by(arguments)], sections)
        written.where(path).write_text(page, encoding="utf-8")
    if arguments.json:
        common.print_json({"output": str(path), "bytes": len(page.encode()), "title": title})
    elif not arguments.quiet:
        print(f"{path}: {len(page.encode()) / 1e6:.2f} MB; open it in a browser")


def _files(arguments: argparse.Namespace) -> argparse.Namespace:
    """Return the arguments with a campaign's files for its folder: the page may lie among them."""
    from imu_sim_ros.report import is_campaign

    inputs: list[Path] = []
    for path in arguments.inputs:
        kept = (
            [file for file in path.iterdir() if file.suffix != ".html"]
            if is_campaign(path)
            else [path]
        )
        inputs += kept
    return argparse.Namespace(**{**vars(arguments), "inputs": inputs})


def _default_output(inputs: Sequence[Path]) -> Path:
    from imu_sim_ros.report import is_campaign

    first = inputs[0]
    return first / "report.html" if is_campaign(first) else first.with_name(f"{first.stem}.html")


def _made_by(arguments: argparse.Namespace) -> str:
    """Return the line below the title: version and command."""
    from imu_sim_ros import __version__

    words = ["report", *map(str, arguments.inputs)]
    for name in ("metric", "truth_topic", "title"):
        value = getattr(arguments, name)
        words += [f"--{name.replace('_', '-')}", value] if value else []
    return f"Made by imu_sim_ros {__version__}: {shlex.join(words)}"


def _sections(arguments: argparse.Namespace) -> tuple[list[str], list["Section"]]:
    """Return the titles of the inputs and all sections."""
    from imu_sim_ros.report import campaign_sections, is_campaign

    titles: list[str] = []
    sections: list[Section] = []
    inputs = list(arguments.inputs)
    while inputs:
        path = inputs.pop(0)
        if is_campaign(path):
            title, made = campaign_sections(path, arguments.metric)
            several = len(arguments.inputs) > 1
            made = [s._replace(title=f"{path.name}: {s.title}") for s in made] if several else made
        else:
            estimates = []
            while inputs and _is_poses(inputs[0]):
                estimates.append(inputs.pop(0))
            title, made = path.name, _bag(arguments, path, estimates)
        titles.append(title)
        sections += made
    return titles, sections


def _is_poses(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in _POSES


def _bag(arguments: argparse.Namespace, path: Path, files: Sequence[Path]) -> list["Section"]:
    """Return the sections of a bag: its streams, its truth and the estimates of it."""
    from imu_sim_ros.report import Estimate, bag_sections

    reader = PoseReader(arguments, "report")

    def read(source: Path, topic: str | None, name: str) -> Estimate:
        track = read_track(source, topic, True, reader)
        return Estimate(name, track.poses, track.pose_covariance)

    truth, estimates = None, []
    named = truth_topic(path, arguments.truth_topic)
    if is_text(path):
        truth = read(path, None, "truth") if has_truth(path) else None
    else:
        for topic in odometry_topics(path):
            if named is not None and topic.strip("/") == named.strip("/"):
                truth = read(path, topic, f"truth ({topic})")
            else:
                estimates.append(read(path, topic, topic))
        if arguments.truth_topic and truth is None:
            raise InputError(f"{path}: --truth-topic {arguments.truth_topic}: no such Odometry")
    estimates += [read(file, None, file.name) for file in files]
    return bag_sections(path, truth, estimates)


if __name__ == "__main__":
    sys.exit(main())
