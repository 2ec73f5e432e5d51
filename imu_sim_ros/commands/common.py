# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Code common to commands: outputs and ``--force``."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from imu_sim_ros.bags.outputs import Outputs

if TYPE_CHECKING:
    from imu_sim_ros.plots.style import Figure

PICTURES: Final = (".png", ".svg", ".pdf")
"""Allowed endings of the name of a picture."""
_WRITTEN: Final = frozenset({"output", "save", "plot"})


FORCE: Final = {"--force": "overwrite existing output"}


def outputs(arguments: argparse.Namespace) -> Outputs:
    """Return the outputs of a command, kept from everything that its arguments name."""
    return Outputs(_existing_files(arguments), force=arguments.force)


@contextmanager
def output_and_plot(arguments: argparse.Namespace) -> Iterator[tuple[Path | None, Path | None]]:
    """Yield the paths for writing ``--output`` and ``--plot``; None: it is not given."""
    written = outputs(arguments)
    output = None if arguments.output is None else written.add(arguments.output).path
    plot = None if arguments.plot is None else written.add(arguments.plot, endings=PICTURES).path
    with written.stage():
        yield output, plot


def save_plot(plot: Path | None, draw: "Callable[[], Figure]") -> None:
    """Write a picture, if the arguments name a path for it.

    :param draw: returns the figure.
    """
    if plot is not None:
        from imu_sim_ros.plots import style  # 0.5 s of matplotlib

        style.save(draw(), plot)


def _existing_files(arguments: argparse.Namespace) -> Iterator[Path]:
    """Yield every argument that is the name of something that exists, but outputs and words."""
    excluded_names = _WRITTEN | vars(arguments).get("words", frozenset())
    for name, value in vars(arguments).items():
        if name not in excluded_names:
            yield from _files_in(value)


def _files_in(value: object) -> Iterator[Path]:
    """Yield the files and folders that exist among the values of an argument."""
    if isinstance(value, list | tuple):
        for entry in value:
            yield from _files_in(entry)
    elif isinstance(value, str | Path) and str(value):
        try:
            if Path(value).exists():
                yield Path(value)
        except (OSError, ValueError):  # no name of a file
            return
