# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the commands that write bags and datasets share: their arguments."""

import argparse
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from imu_sim_ros import program
from imu_sim_ros.bags.text import writer as text_writer
from imu_sim_ros.bags.write import COMPRESSIONS, STORAGES, dataset_form
from imu_sim_ros.commands.common import DISCARD_PARTIAL, FORCE, skipped_rows
from imu_sim_ros.jobs.output import Form

if TYPE_CHECKING:
    from imu_sim_ros.inputs.rows import BadRows
    from imu_sim_ros.jobs.convert import ConversionWatcher

_LONGEST_SIZE: Final = 20
_SIZE_UNITS: Final = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9}


INPUT: Final = {
    "input": {
        "type": Path,
        "help": "ROS 1 bag, .mcap, rosbag2 folder, EuRoC folder or CSV file",
    }
}


def add_arguments(group: Any, formats: Sequence[str] = text_writer.FORMATS) -> None:
    """Add what chooses the output's place, form and names to a parser or a group of it.

    :param formats: of datasets.
    """
    compressions = "; ".join(f"{one}: {', '.join(names)}" for one, names in COMPRESSIONS.items())
    options = {
        "-o --output PATH": {
            "required": True,
            "help": "NAME.bag: ROS 1; NAME.mcap: one MCAP file; NAME.csv, NAME.tum: text; "
            "another name: a rosbag2 folder",
        },
        "--format": {"choices": formats, "help": "write a dataset instead of a bag"},
        "--storage": {"choices": STORAGES, "help": "bag storage (default: mcap)"},
        "--compression": {
            "choices": sorted({name for names in COMPRESSIONS.values() for name in names}),
            "help": f"compression of chunks (default: none). {compressions}",
        },
        "--split-duration TIME": {"default": 0.0, "help": "start a new file after TIME"},
        "--split-size SIZE": {
            "type": size,
            "default": 0,
            "help": "start a new file after SIZE (500M, 2G)",
        },
        "--topic NAME=NEW": {
            "type": renaming,
            "action": "append",
            "default": [],
            "help": "rename a topic in the bag, e.g. imu/data_raw=/imu0; repeatable",
        },
    }
    program.add_options(group, {**options, **FORCE, **DISCARD_PARTIAL})


def form(arguments: argparse.Namespace) -> str | None:
    """Return the form of the dataset that the arguments ask for; None: a bag.

    :raises InputError: for arguments that do not fit that form.
    """
    names = ("storage", "compression", "split_duration", "split_size")
    of_bags = {f"--{name.replace('_', '-')}": getattr(arguments, name) for name in names}
    return dataset_form(arguments.output, arguments.format, of_bags)


def whole_form(arguments: argparse.Namespace) -> Form:
    """Return all that the arguments say of the output's form.

    :raises InputError: for arguments that do not fit that form.
    """
    return Form(
        form(arguments),
        arguments.storage,
        arguments.compression,
        arguments.split_duration,
        arguments.split_size,
        names(arguments.topics),
        dict(arguments.topic),
    )


def names(words: str) -> list[str]:
    """Return the names in ``NAME,...``."""
    return [name for name in words.split(",") if name]


def watcher(arguments: argparse.Namespace, name: str, warning: str) -> "ConversionWatcher":
    """Return who prints what happens during a conversion, and its progress.

    :param name: of the program.
    :param warning: what its warnings begin with.
    """
    from imu_sim_ros.jobs.convert import ConversionWatcher, passed_on  # generate converts nothing

    def warned(bad: "BadRows") -> None:
        words = f"{passed_on(bad)}; they are passed on, --skip-bad-rows leaves them out"
        print(f"{name}: warning: {words}", file=sys.stderr)

    skipped = skipped_rows(arguments, name, arguments.input)
    quiet = arguments.quiet or arguments.json
    return ConversionWatcher(
        lambda line: print(f"{warning}{line}", file=sys.stderr),
        progress=lambda total: program.progress(f"writing {arguments.output}", total, quiet),
        skipped=skipped,
        warned=None if skipped else warned,
    )


def counts(messages: Mapping[str, int]) -> str:
    """Return numbers of messages by topic in words."""
    return ", ".join(f"{count:,} {name}" for name, count in messages.items())


def time_and_speed(count: int, wall_s: float, what: str) -> str:
    """Return ``2.50 s (80 k messages/s)``."""
    speed = count / wall_s
    shown = f"{speed / 1e3:,.0f} k" if speed >= 1e4 else f"{speed:,.0f}"
    return f"{wall_s:.2f} s ({shown} {what}/s)"


def size(words: str) -> int:
    """Return the bytes of ``500M``, ``2G`` or a plain number."""
    match = re.fullmatch(r"(\d+\.?\d*)\s*([kmg]?)b?", words.strip().lower())
    if match is None or len(words) > _LONGEST_SIZE:
        raise argparse.ArgumentTypeError(f"{words[:40]!r} is not a size such as 500M or 2G")
    return round(float(match[1]) * _SIZE_UNITS[match[2]])


def renaming(words: str) -> tuple[str, str]:
    """Return both names of ``old=new``."""
    old, equals, new = words.partition("=")
    if not equals or not re.fullmatch(r"/?[A-Za-z_~][\w/]*", new.strip()):
        raise argparse.ArgumentTypeError(f"{words!r} is not of the form imu/data_raw=/imu0")
    return old.strip().lstrip("/"), new.strip()
