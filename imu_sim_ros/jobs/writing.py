# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the jobs that write bags and datasets share: arguments, checks, and what they say."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final

from imu_sim_ros import arguments
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.bags.writer import COMPRESSED, COMPRESSIONS, STORAGES
from imu_sim_ros.inputs.rows import BadRows, Skipped, Warned
from imu_sim_ros.jobs.output import checked_output, is_file, renamed_topics
from imu_sim_ros.progress import watcher
from imu_sim_ros.signatures import Heading, Text, assignment

_LONGEST_SIZE: Final = 20
_SIZE_UNITS: Final = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9}


def size(words: str) -> int:
    """Return the bytes of ``500M``, ``2G`` or a plain number.

    :raises ValueError: for anything else.
    """
    match = re.fullmatch(r"(\d+\.?\d*)\s*([kmg]?)b?", words.strip().lower())
    if match is None or len(words) > _LONGEST_SIZE:
        raise ValueError(f"{words[:40]!r} is not a size such as 500M or 2G")
    return round(float(match[1]) * _SIZE_UNITS[match[2]])


def renaming(words: str) -> tuple[str, str]:
    """Return both names of ``old=new``.

    :raises ValueError: for anything else.
    """
    old, equals, new = words.partition("=")
    if not equals or not re.fullmatch(r"/?[A-Za-z_~][\w/]*", new.strip()):
        raise ValueError(f"{words!r} is not of the form imu/data_raw=/imu0")
    return old.strip().lstrip("/"), new.strip()


OUTPUT: Final = Heading("output")
_PARAMETERS: Final = Heading("parameters (later ones win)")
_COMPRESSION: Final = "; ".join(f"{one}: {', '.join(names)}" for one, names in COMPRESSIONS.items())

Output = Annotated[
    str | Path,
    "-o --output PATH",
    Text(
        "NAME.bag: ROS 1; NAME.mcap: one MCAP file; NAME.csv, NAME.tum: text; "
        "another name: a rosbag2 folder"
    ),
    OUTPUT,
]
Format = Annotated[str | None, Text("write a dataset instead of a bag"), OUTPUT]
"""With the words that a job knows."""
Storage = Annotated[str | None, STORAGES, Text("bag storage (default: mcap)"), OUTPUT]
Compression = Annotated[
    str | None,
    sorted(COMPRESSED),
    Text(f"compression of chunks (default: none). {_COMPRESSION}"),
    OUTPUT,
]
SplitDuration = Annotated[
    float, "TIME", Text("start a new file after TIME; default: all in one"), OUTPUT
]
SplitSize = Annotated[
    int, "SIZE", size, Text("start a new file after SIZE (500M, 2G); default: all in one"), OUTPUT
]
Rename = Annotated[
    Mapping[str, str] | None,
    "--topic NAME=NEW",
    renaming,
    Text("rename a topic in the bag, e.g. imu/data_raw=/imu0; repeatable"),
    OUTPUT,
]
Force = Annotated[bool, "--force", Text("overwrite existing output"), OUTPUT]
DiscardPartial = Annotated[
    bool,
    "--discard-partial",
    Text(
        "leave nothing when interrupted (default: keep the complete part as NAME.partial.EXT)",
    ),
    OUTPUT,
]
ParameterFiles = Annotated[
    str | Path | Sequence[str | Path] | None,
    "--params-file FILE",
    str,
    Text("ROS 2 parameter file or kalibr imu.yaml; repeatable"),
    _PARAMETERS,
]
Parameters = Annotated[
    Any,
    "--set KEY=VALUE",
    assignment,
    Text("set one parameter, e.g. imu.gyroscope_bias=[0.01,0,0]; repeatable"),
    _PARAMETERS,
]


@dataclass(frozen=True)
class Form:
    """What kind of file or folder is written."""

    dataset: str | None = None
    """``euroc``, ``csv``, ``tum``, ...; None: a bag."""
    storage: str | None = None
    compression: str | None = None
    split_duration: float = 0.0
    """[s] of one file; 0: all."""
    split_size: int = 0
    """[bytes] of one file; 0: all."""
    topics: Sequence[str] = ()
    """Those that are written; empty: the usual ones."""
    renamed: Mapping[str, str] = field(default_factory=dict)
    """Names in the bag by the topics' own."""

    def of_bag(self) -> dict[str, Any]:
        """Return what applies to bags only: arguments of ``open_writer``."""
        names = ("storage", "compression", "split_duration", "split_size")
        return {name: getattr(self, name) for name in names}


def checked_form(
    formats: Collection[str],
    format: str | None,
    storage: str | None,
    compression: str | None,
    split_duration: float,
    split_size: int,
    topics: str | Sequence[str],
    rename: Mapping[str, str] | None,
) -> Form:
    """Return the form that a caller's arguments describe.

    :param formats: the datasets that can be written.
    :raises ConfigurationError: for an invalid one.
    """

    def known(name: str, value: str | None, words: Collection[str]) -> str | None:
        return None if value is None else arguments.one_of(name, value, words)

    return Form(
        known("format", format, formats),
        known("storage", storage, STORAGES),
        known("compression", compression, COMPRESSED),
        arguments.number("split_duration", split_duration, "seconds, from 0 to 1e9", 0.0, 1e9),
        arguments.whole("split_size", split_size, "bytes, 0 or more", 0, 1 << 62),
        arguments.words("topics", topics),
        renamed_topics(rename),
    )


def parameter_files(given: object) -> list[Path]:
    """Return the files of the argument ``params_file``.

    :raises ConfigurationError: for anything but paths.
    """
    several = [] if given is None else [given] if isinstance(given, str | Path) else given
    if not isinstance(several, list | tuple):
        arguments.refuse("params_file", given, "paths of files", wrong_type=True)
    return [arguments.path("params_file", one) for one in several]


class Journal:
    """What a job says: told at once to whoever follows it, and kept for its result."""

    def __init__(self, source: object = None, skip_bad_rows: bool = False) -> None:
        """Begin.

        :param source: what bad rows are of.
        :param skip_bad_rows: leave them out.
        """
        self.lines: list[str] = []
        """Warnings and remarks."""
        self.notes: list[str] = []
        self._source, self._skips = source, skip_bad_rows
        self._watcher = watcher()

    @property
    def skipped(self) -> Skipped | None:
        """What receives how many bad rows are skipped; None: they are errors, or passed on."""
        if not self._skips:
            return None
        return lambda count: self.remark(f"{self._source}: {count} bad rows skipped")

    @property
    def passed_on(self) -> Warned | None:
        """What receives messages that pass although not finite or not possible."""
        return None if self._skips else self._pass_on

    def _pass_on(self, bad: BadRows) -> None:
        self.warn(
            f"{bad.source}: {bad.rows} of {bad.rows + bad.good} messages are not finite or not "
            f"possible, the first is {bad.first}; they are passed on, --skip-bad-rows leaves "
            "them out"
        )

    def warn(self, line: str) -> None:
        """Say what is allowed but may be unintended."""
        self._watcher.warn(line)
        self.lines.append(line)

    def remark(self, line: str) -> None:
        """Say what is left out, or was found on the way."""
        self._watcher.remark(line)
        self.lines.append(line)

    def note(self, line: str) -> None:
        """Say what was chosen."""
        self._watcher.note(line)
        self.notes.append(line)


def outputs(
    path: str | Path, force: bool, discard_partial: bool, inputs: Iterable[object]
) -> tuple[Path, Outputs]:
    """Return the path of an output, and what will receive it.

    :param inputs: paths of what is read, and words that may be names of files.
    :raises ConfigurationError: for arguments that are no path and no switch.
    """
    arguments.switch("discard_partial", discard_partial)
    target = checked_output(path, force)
    read = [one for one in inputs if isinstance(one, Path) or is_file(one)]
    return target, Outputs(read, force, discard_partial, watcher().undisturbed)


def counts(messages: Mapping[str, int]) -> str:
    """Return numbers of messages by topic in words."""
    return ", ".join(f"{count:,} {name}" for name, count in messages.items())


def time_and_speed(count: int, wall_s: float, what: str) -> str:
    """Return ``2.50 s (80 k messages/s)``."""
    speed = count / wall_s
    shown = f"{speed / 1e3:,.0f} k" if speed >= 1e4 else f"{speed:,.0f}"
    return f"{wall_s:.2f} s ({shown} {what}/s)"
