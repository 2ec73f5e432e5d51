# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``report``: write one self-contained HTML page about campaigns or recorded bags."""

import argparse
import shlex
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Final

from imu_sim_ros import program
from imu_sim_ros.bags.outputs import named
from imu_sim_ros.commands.common import COMMON, PoseReader, outputs, skipped_rows
from imu_sim_ros.errors import InputError

EXAMPLES: Final = """
report results
report flight.mcap -o flight.html
report flight.mcap track.csv other.tum -o compared.html --title "Two filters, one flight"
report friday --baseline monday --baseline tuesday
report monday tuesday -o both.html --metric final_position_error_m
"""


_ARGUMENTS: Final = {
    "inputs INPUT": {
        "nargs": "+",
        "type": Path,
        "help": "campaign folder, bag or EuRoC folder; a file of poses (TUM, EuRoC) after a bag "
        "is an estimate of its motion",
    },
    "-o --output FILE": "HTML file to write; default: report.html in the first campaign's folder, "
    "or NAME.html for a bag",
    "--title TITLE": "title of the page",
    "--metric NAME": {"default": "", "help": "metric of a campaign to show first"},
    "--baseline PATH": {
        "action": "append",
        "default": [],
        "help": "folder, results.csv or results.parquet of an earlier campaign; repeatable, "
        "oldest first, to show a trend",
    },
    "--truth-topic TOPIC": "topic of the truth, if a bag has several",
    **COMMON,
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    return program.Parser("report", description=__doc__, examples=EXAMPLES, arguments=_ARGUMENTS)


def run(arguments: argparse.Namespace) -> None:
    """Read the inputs and write the page."""
    from imu_sim_ros.jobs.report import Sources, page

    path = arguments.output or _default_output(arguments.inputs)
    written = outputs(_files(arguments))
    written.add(path, endings=(".html", ".htm"))
    sources = Sources(
        arguments.inputs,
        arguments.metric,
        arguments.baseline,
        arguments.truth_topic,
        PoseReader(arguments, "report"),
        lambda source: skipped_rows(arguments, "report", source),
    )
    with written:
        title, text = page(sources, arguments.title or "", _made_by(arguments))
        written.where(path).write_text(text, encoding="utf-8")
    if arguments.json:
        program.print_json({"output": str(path), "bytes": len(text.encode()), "title": title})
    elif not arguments.quiet:
        print(f"{path}: {len(text.encode()) / 1e6:.2f} MB; open it in a browser")


def _files(arguments: argparse.Namespace) -> argparse.Namespace:
    """Return the arguments with a campaign's files for its folder: the page may lie among them."""
    from imu_sim_ros.reports.of_campaign import is_campaign

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
    from imu_sim_ros.reports.of_campaign import is_campaign

    first = named(inputs[0])
    if is_campaign(first):
        return first / "report.html"
    if not first.name:
        raise InputError(f"{first}: has no name for the page; give one by -o FILE")
    return first.with_name(f"{first.stem}.html")


def _made_by(arguments: argparse.Namespace) -> str:
    """Return the line below the title: version and command."""
    from imu_sim_ros import __version__

    words = ["report", *map(str, arguments.inputs)]
    for name in ("metric", "truth_topic", "title"):
        value = getattr(arguments, name)
        words += [f"--{name.replace('_', '-')}", value] if value else []
    for path in arguments.baseline:
        words += ["--baseline", str(path)]
    return f"imu_sim_ros {__version__}: {shlex.join(words)}"


main = partial(program.main, parser, run)
