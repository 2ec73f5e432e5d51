# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments of the jobs that write, their checks, their outputs, and the journal of a job."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, TypeGuard

from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.bags.text.writer import DATASET_SUFFIXES
from imu_sim_ros.bags.writer import (
    AS_NAMED,
    COMPRESSED,
    COMPRESSIONS,
    STORAGES,
    BagOptions,
    check_writer,
)
from imu_sim_ros.core import arguments
from imu_sim_ros.core.bad_rows import BadRows, Skipped, Warned
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.terminal.progress import current_watcher
from imu_sim_ros.terminal.signatures import Heading, Text, parse_assignment

_OUTPUT_PATH: Final = "the path of an output"
_LONGEST_SIZE: Final = 20
"""Longest text of a size [characters]."""
_SIZE_UNITS: Final = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9}


def size(text: str) -> int:
    """Return the bytes of ``500M``, ``2G`` or a plain number.

    :raises ValueError: for anything else.
    """
    match = re.fullmatch(r"(\d+\.?\d*)\s*([kmg]?)b?", text.strip().lower())
    if match is None or len(text) > _LONGEST_SIZE:
        raise ValueError(f"{text[:40]!r} is not a size such as 500M or 2G")
    return round(float(match[1]) * _SIZE_UNITS[match[2]])


def parse_renaming(text: str) -> tuple[str, str]:
    """Return both names of ``old=new``.

    :raises ValueError: for anything else.
    """
    topic, equals, renamed = text.partition("=")
    if not equals or not re.fullmatch(r"/?[A-Za-z_~][\w/]*", renamed.strip()):
        raise ValueError(f"{text!r} is not of the form imu/data_raw=/imu0")
    return topic.strip().lstrip("/"), renamed.strip()


OUTPUT: Final = Heading("output")
PARAMETERS: Final = Heading("parameters (later ones override)")
_COMPRESSION: Final = "; ".join(
    f"{storage}: {', '.join(names)}" for storage, names in COMPRESSIONS.items()
)

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
"""Format of a dataset, for jobs that state its words in their own annotation."""
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
    parse_renaming,
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
    Text("ROS 2 parameter file, or kalibr's, OpenVINS' or EuRoC's of an IMU; repeatable"),
    PARAMETERS,
]
Parameters = Annotated[
    Any,
    "--set KEY=VALUE",
    parse_assignment,
    Text("set one parameter, e.g. imu.gyroscope_bias=[0.01,0,0]; repeatable"),
    PARAMETERS,
]
SkipBadRows = Annotated[
    bool,
    "--skip-bad-rows",
    Text("skip and count bad rows of text and bad messages of bags (poses, readings)"),
]
"""True: bad rows and messages are skipped and counted; False: they are errors."""


@dataclass(frozen=True)
class Form:
    """Kind of the file or folder that is written."""

    dataset: str | None = None
    """``euroc``, ``csv``, ``tum``, ...; None: a bag."""
    bag: BagOptions = AS_NAMED
    topics: Sequence[str] = ()
    """Names of the topics that are written; empty: the default ones."""
    renamed: Mapping[str, str] = field(default_factory=dict)
    """Names in the bag by the topics' own."""


def form_of_output(
    formats: Collection[str],
    output: str | Path,
    format: str | None,
    options: BagOptions,
    topics: str | Sequence[str],
    rename: Mapping[str, str] | None,
) -> tuple[Path, Form]:
    """Return the path and the form of an output that a caller's arguments describe.

    :param formats: the datasets that can be written.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a form that the output's name, or an option, contradicts.
    """
    limited = (("format", format, formats), ("storage", options.storage, STORAGES))
    for name, value, allowed in (*limited, ("compression", options.compression, COMPRESSED)):
        if value is not None:
            arguments.choice(name, value, allowed)
    length, size_limit = options.split_duration, options.split_size
    bag = options._replace(
        split_duration=arguments.number(
            "split_duration", length, "seconds, from 0 to 1e9", 0.0, 1e9
        ),
        split_size=arguments.integer("split_size", size_limit, "bytes, 0 or more", 0, 1 << 62),
    )
    written, renamed = arguments.string_list("topics", topics), new_topic_names(rename)
    path = arguments.path("path", output, _OUTPUT_PATH)
    if not path.name:  # the files next to it are named after it
        raise InputError(f"{str(path)!r}: is not a file name")
    dataset = format or DATASET_SUFFIXES.get(path.suffix.lower())
    if dataset is None:
        check_writer(path, options.storage, options.compression)
        return path, Form(None, bag, written, renamed)
    unfit = [
        f"--{name.replace('_', '-')}: does not apply to {dataset}"
        for name, value in bag._asdict().items()
        if value
    ]
    if unfit:
        raise InputError(unfit)
    return path, Form(dataset, bag, written, renamed)


def new_topic_names(names: Mapping[str, str] | None) -> Mapping[str, str]:
    """Return names in a bag by the topics' own, the argument ``rename``."""
    if names is None:
        return {}
    allowed = "names of topics by names of topics"
    if not isinstance(names, Mapping):
        arguments.refuse("rename", names, allowed, wrong_type=True)
    return {
        arguments.text("rename", a, allowed): arguments.text("rename", b, allowed)
        for a, b in names.items()
    }


def parameter_files(files: object) -> list[Path]:
    """Return the files of the argument ``params_file``.

    :raises ConfigurationError: for anything but paths.
    """
    several = [] if files is None else [files] if isinstance(files, str | Path) else files
    if not isinstance(several, list | tuple):
        arguments.refuse("params_file", files, "paths of files", wrong_type=True)
    return [arguments.path("params_file", path) for path in several]


class Journal:
    """Warnings, remarks and notes of a job, printed at once and kept for its result."""

    def __init__(self, source: object = None, skip_bad_rows: bool = False) -> None:
        """Initialise an empty journal.

        :param source: file in which bad rows are counted.
        :param skip_bad_rows: skip bad rows.
        """
        self.lines: list[str] = []
        """Warnings and remarks."""
        self.notes: list[str] = []
        self._source, self._skips = source, skip_bad_rows
        self._watcher = current_watcher()

    @property
    def skipped(self) -> Skipped | None:
        """Callback with the number of skipped rows; None: bad rows are errors, or passed on."""
        if not self._skips:
            return None
        return lambda count: self.remark(f"{self._source}: {count} bad rows skipped")

    @property
    def passed_on(self) -> Warned | None:
        """Callback with the messages that are passed on although not finite or not possible."""
        return None if self._skips else self._pass_on

    def _pass_on(self, bad: BadRows) -> None:
        """Warn of bad messages that are copied nevertheless."""
        self.warn(
            f"{bad.source}: {bad.rows} of {bad.rows + bad.good} messages are not finite or not "
            f"possible, the first is {bad.first}; they are passed on, "
            f"{argument('skip_bad_rows', True)} leaves them out"
        )

    def warn(self, line: str) -> None:
        """Report a setting that is allowed but may be unintended."""
        self._watcher.warn(line)
        self.lines.append(line)

    def remark(self, line: str) -> None:
        """Report data that are skipped, or a property of the input."""
        self._watcher.remark(line)
        self.lines.append(line)

    def note(self, line: str) -> None:
        """Report a choice of the job."""
        self._watcher.note(line)
        self.notes.append(line)


def outputs(force: bool, discard_partial: bool, inputs: Iterable[object]) -> Outputs:
    """Return the staging of a job's outputs.

    :param inputs: paths of inputs, and strings that may be names of files.
    :raises ConfigurationError: for arguments that are no switch.
    """
    arguments.boolean("discard_partial", discard_partial)
    arguments.boolean("force", force)
    input_files = [name for name in inputs if isinstance(name, Path) or is_file(name)]
    return Outputs(input_files, force, discard_partial)


@contextmanager
def save_output(path: str | Path, force: bool, inputs: Iterable[object] = ()) -> Iterator[Path]:
    """Yield the path for writing an output, which is renamed into place at the end of the block.

    Parents are created. After an error, an existing output is unchanged. Every ``save`` writes so.

    :param force: replace what exists.
    :param inputs: possible names of input files, which are never overwritten.
    :raises ConfigurationError: for arguments of ``save`` that are no path and no switch.
    :raises InputError: for a path that cannot be used or exists.
    """
    arguments.boolean("force", force)
    written = Outputs([word for word in inputs if is_file(word)], force)
    target = written.add(arguments.path("path", path, _OUTPUT_PATH))
    with written.stage():
        yield target.path


def is_file(path: object) -> TypeGuard[str | Path]:
    """Return whether a value is the name of a file."""
    try:
        return isinstance(path, str | Path) and bool(str(path)) and Path(path).is_file()
    except (OSError, ValueError):  # no name of a file
        return False


def counts_text(messages: Mapping[str, int]) -> str:
    """Return the numbers of messages by topic as text."""
    return ", ".join(f"{count:,} {name}" for name, count in messages.items())


def time_and_speed(count: int, wall_s: float, what: str) -> str:
    """Return ``2.50 s (80 k messages/s)``."""
    speed = count / wall_s
    shown = f"{speed / 1e3:,.0f} k" if speed >= 1e4 else f"{speed:,.0f}"
    return f"{wall_s:.2f} s ({shown} {what}/s)"
