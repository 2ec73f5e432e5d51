# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments for the outputs of a command: ``-o``, ``--plot``, ``--force``."""

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from imu_sim_ros import signals
from imu_sim_ros.bags.outputs import Outputs

PICTURES: Final = (".png", ".svg", ".pdf")
"""Allowed endings of the name of a picture."""
_WRITTEN: Final = frozenset({"output", "save", "plot"})


def add_force(parser: Any, *, parts: bool = False) -> None:
    """Add ``--force``.

    :param parts: add ``--discard-partial`` as well, for commands that may be stopped half-way.
    """
    parser.add_argument("--force", action="store_true", help="overwrite existing output")
    if parts:
        parser.add_argument(
            "--discard-partial",
            action="store_true",
            help="leave nothing when interrupted (default: keep the complete part as "
            "NAME.partial.EXT)",
        )


def outputs(arguments: argparse.Namespace, inputs: Iterable[object] = ()) -> Outputs:
    """Return the outputs of a command, kept from everything that its arguments name.

    :param inputs: further inputs: values of parameters that may be names of files.
    """
    return Outputs(
        [*_files_in(list(inputs)), *_named_files(arguments)],
        force=arguments.force,
        discard_partial=getattr(arguments, "discard_partial", False),
        undisturbed=signals.collected,
    )


def output_and_plot(arguments: argparse.Namespace) -> Outputs:
    """Return the outputs ``--output`` and ``--plot``, those of them that are given."""
    written = outputs(arguments)
    if arguments.output is not None:
        written.add(arguments.output)
    if arguments.plot is not None:
        written.add(arguments.plot, endings=PICTURES)
    return written


def _named_files(arguments: argparse.Namespace) -> Iterator[Path]:
    """Yield every argument that is the name of something that exists, but outputs and words."""
    no_inputs = _WRITTEN | getattr(arguments, "words", frozenset())
    for name, value in vars(arguments).items():
        if name not in no_inputs:
            yield from _files_in(value)


def _files_in(value: object) -> Iterator[Path]:
    if isinstance(value, list | tuple):
        for entry in value:
            yield from _files_in(entry)
    elif isinstance(value, str | Path) and str(value):
        try:
            if Path(value).exists():
                yield Path(value)
        except (OSError, ValueError):  # no name of a file
            return
