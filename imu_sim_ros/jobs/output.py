# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Outputs of every ``save``: refused if something exists, renamed when they are complete."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, TypeGuard

from imu_sim_ros import arguments
from imu_sim_ros.signatures import Text

SkipBadRows = Annotated[
    bool,
    "--skip-bad-rows",
    Text("skip and count bad rows of text and bad messages of bags (poses, readings)"),
]
"""Whether bad rows and messages are left out and counted, or errors."""


def checked_output(path: str | Path, force: bool) -> Path:
    """Return the path of an output.

    :raises ConfigurationError: for arguments of ``save`` that are no path and no switch.
    """
    arguments.switch("force", force)
    return arguments.path("path", path, "the path of an output")


@contextmanager
def saved(path: str | Path, force: bool, inputs: Iterable[object] = ()) -> Iterator[Path]:
    """Yield the path for writing an output, which is renamed into place at the end of the block.

    Parents are created. After an error, an existing output is unchanged.

    :param force: replace what exists.
    :param inputs: possible names of input files, which are never overwritten.
    :raises InputError: for a path that cannot be used or exists.
    """
    from imu_sim_ros.bags.outputs import Outputs

    path = checked_output(path, force)
    outputs = Outputs([word for word in inputs if is_file(word)], force)
    staged = outputs.add(path)
    with outputs:
        yield staged


def is_file(word: object) -> TypeGuard[str | Path]:
    """Return whether a value is the name of a file."""
    try:
        return isinstance(word, str | Path) and bool(str(word)) and Path(word).is_file()
    except (OSError, ValueError):  # no name of a file
        return False


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
