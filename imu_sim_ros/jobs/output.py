# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Outputs of every ``save``: refused if something exists, renamed when they are complete."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, TypeGuard

from imu_sim_ros import arguments

SkipBadRows = Annotated[bool, "--skip-bad-rows"]
"""Whether bad rows and messages are left out and counted, or errors."""


def checked_place(path: str | Path, force: bool) -> Path:
    """Return the path of an output.

    :raises ConfigurationError: for arguments of ``save`` that are no path and no switch.
    """
    arguments.switch("force", force)
    return arguments.path("path", path, "the path of an output")


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

    def of_bags_only(self) -> dict[str, object]:
        """Return what applies to bags only, by name."""
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
    from imu_sim_ros.bags.write import COMPRESSED, STORAGES

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


@contextmanager
def _no_progress(_total: int) -> Iterator[Callable[[float], None]]:
    """Yield what receives progress that nobody watches."""
    yield lambda _count: None


@dataclass(frozen=True)
class Watcher:
    """Receivers of warnings and progress; by default there are none."""

    warn: Callable[[str], None] = lambda line: None
    note: Callable[[str], None] = lambda line: None
    progress: Callable[[int], AbstractContextManager[Callable[[float], None]]] = _no_progress
    """Called with the number of samples or messages; its block receives how many more have been
    written."""


@contextmanager
def saved(path: str | Path, force: bool, inputs: Iterable[object] = ()) -> Iterator[Path]:
    """Yield the path for writing an output, which is renamed into place at the end of the block.

    Parents are created. After an error, an existing output is unchanged.

    :param force: replace what exists.
    :param inputs: possible names of input files, which are never overwritten.
    :raises InputError: for a path that cannot be used or exists.
    """
    from imu_sim_ros.bags.outputs import Outputs

    path = checked_place(path, force)
    outputs = Outputs([word for word in inputs if is_file(word)], force)
    place = outputs.add(path)
    with outputs:
        yield place


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
