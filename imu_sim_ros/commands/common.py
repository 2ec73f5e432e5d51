# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What commands have in common: outputs and ``--force``."""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from imu_sim_ros import signals
from imu_sim_ros.bags.outputs import Outputs

PICTURES: Final = (".png", ".svg", ".pdf")
"""Allowed endings of the name of a picture."""
_WRITTEN: Final = frozenset({"output", "save", "plot"})


FORCE: Final = {"--force": "overwrite existing output"}


def outputs(arguments: argparse.Namespace) -> Outputs:
    """Return the outputs of a command, kept from everything that its arguments name."""
    return Outputs(_named_files(arguments), force=arguments.force, undisturbed=signals.collected)


def output_and_plot(arguments: argparse.Namespace) -> Outputs:
    """Return the outputs ``--output`` and ``--plot``, those of them that are given."""
    written = outputs(arguments)
    if arguments.output is not None:
        written.add(arguments.output)
    if arguments.plot is not None:
        written.add(arguments.plot, endings=PICTURES)
    return written


def save_plot(arguments: argparse.Namespace, written: Outputs, draw: Callable[[], Any]) -> None:
    """Write the picture that ``--plot`` names, if it does.

    :param draw: returns the figure.
    """
    if arguments.plot is not None:
        from imu_sim_ros.plots import style  # 0.5 s of matplotlib

        style.save(draw(), written.where(arguments.plot))


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
