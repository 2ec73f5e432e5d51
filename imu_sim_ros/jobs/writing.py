# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What jobs that write share: arguments, their checks, outputs, and what the jobs say."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, TypeGuard

from imu_sim_ros import arguments
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
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.rows import BadRows, Skipped, Warned
from imu_sim_ros.progress import watcher
from imu_sim_ros.signatures import Heading, Text, assignment

_OUTPUT_PATH: Final = "the path of an output"
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
PARAMETERS: Final = Heading("parameters (later ones win)")
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
    Text("ROS 2 parameter file, or kalibr's, OpenVINS' or EuRoC's of an IMU; repeatable"),
    PARAMETERS,
]
Parameters = Annotated[
    Any,
    "--set KEY=VALUE",
    assignment,
    Text("set one parameter, e.g. imu.gyroscope_bias=[0.01,0,0]; repeatable"),
    PARAMETERS,
]
SkipBadRows = Annotated[
    bool,
    "--skip-bad-rows",
    Text("skip and count bad rows of text and bad messages of bags (poses, readings)"),
]
"""Whether bad rows and messages are left out and counted, or errors."""


@dataclass(frozen=True)
class Form:
    """What kind of file or folder is written."""

    dataset: str | None = None
    """``euroc``, ``csv``, ``tum``, ...; None: a bag."""
    bag: BagOptions = AS_NAMED
    topics: Sequence[str] = ()
    """Those that are written; empty: the usual ones."""
    renamed: Mapping[str, str] = field(default_factory=dict)
    """Names in the bag by the topics' own."""


def checked_form(
    formats: Collection[str],
    output: str | Path,
    format: str | None,
    given: BagOptions,
    topics: str | Sequence[str],
    rename: Mapping[str, str] | None,
) -> tuple[Path, Form]:
    """Return the path and the form of an output that a caller's arguments describe.

    :param formats: the datasets that can be written.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a form that the output's name, or an option, contradicts.
    """
    words = (("format", format, formats), ("storage", given.storage, STORAGES))
    for name, value, known in (*words, ("compression", given.compression, COMPRESSED)):
        if value is not None:
            arguments.one_of(name, value, known)
    length, most = given.split_duration, given.split_size
    bag = given._replace(
        split_duration=arguments.number(
            "split_duration", length, "seconds, from 0 to 1e9", 0.0, 1e9
        ),
        split_size=arguments.whole("split_size", most, "bytes, 0 or more", 0, 1 << 62),
    )
    written, renamed = arguments.words("topics", topics), renamed_topics(rename)
    path = arguments.path("path", output, _OUTPUT_PATH)
    if not path.name:  # the files next to it are named after it
        raise InputError(f"{str(path)!r}: is not a file name")
    dataset = format or DATASET_SUFFIXES.get(path.suffix.lower())
    if dataset is None:
        check_writer(path, given.storage, given.compression)
        return path, Form(None, bag, written, renamed)
    unfit = [
        f"--{name.replace('_', '-')}: does not apply to {dataset}"
        for name, value in bag._asdict().items()
        if value
    ]
    if unfit:
        raise InputError(unfit)
    return path, Form(dataset, bag, written, renamed)


def renamed_topics(given: Mapping[str, str] | None) -> Mapping[str, str]:
    """Return names in a bag by the topics' own, the argument ``rename``."""
    if given is None:
        return {}
    allowed = "names of topics by names of topics"
    if not isinstance(given, Mapping):
        arguments.refuse("rename", given, allowed, wrong_type=True)
    return {
        arguments.text("rename", a, allowed): arguments.text("rename", b, allowed)
        for a, b in given.items()
    }


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


def outputs(force: bool, discard_partial: bool, inputs: Iterable[object]) -> Outputs:
    """Return what will receive the outputs of a job.

    :param inputs: paths of what is read, and words that may be names of files.
    :raises ConfigurationError: for arguments that are no switch.
    """
    arguments.switch("discard_partial", discard_partial)
    arguments.switch("force", force)
    read = [one for one in inputs if isinstance(one, Path) or is_file(one)]
    return Outputs(read, force, discard_partial)


@contextmanager
def saved(path: str | Path, force: bool, inputs: Iterable[object] = ()) -> Iterator[Path]:
    """Yield the path for writing an output, which is renamed into place at the end of the block.

    Parents are created. After an error, an existing output is unchanged. Every ``save`` writes so.

    :param force: replace what exists.
    :param inputs: possible names of input files, which are never overwritten.
    :raises ConfigurationError: for arguments of ``save`` that are no path and no switch.
    :raises InputError: for a path that cannot be used or exists.
    """
    arguments.switch("force", force)
    written = Outputs([word for word in inputs if is_file(word)], force)
    target = written.add(arguments.path("path", path, _OUTPUT_PATH))
    with written.staged():
        yield target.path


def is_file(word: object) -> TypeGuard[str | Path]:
    """Return whether a value is the name of a file."""
    try:
        return isinstance(word, str | Path) and bool(str(word)) and Path(word).is_file()
    except (OSError, ValueError):  # no name of a file
        return False


def counts(messages: Mapping[str, int]) -> str:
    """Return numbers of messages by topic in words."""
    return ", ".join(f"{count:,} {name}" for name, count in messages.items())


def time_and_speed(count: int, wall_s: float, what: str) -> str:
    """Return ``2.50 s (80 k messages/s)``."""
    speed = count / wall_s
    shown = f"{speed / 1e3:,.0f} k" if speed >= 1e4 else f"{speed:,.0f}"
    return f"{wall_s:.2f} s ({shown} {what}/s)"
