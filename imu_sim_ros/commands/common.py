# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What commands have in common: bad rows of inputs, outputs and ``--force``."""

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from imu_sim_ros import signals
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.inputs.rows import Skipped
from imu_sim_ros.poses import PoseSequence

PICTURES: Final = (".png", ".svg", ".pdf")
"""Allowed endings of the name of a picture."""
_WRITTEN: Final = frozenset({"output", "save", "plot"})


SKIP_BAD_ROWS: Final = {
    "--skip-bad-rows": "skip and count bad rows of text and bad messages of bags (poses, readings)",
}
FORCE: Final = {"--force": "overwrite existing output"}
DISCARD_PARTIAL: Final = {
    "--discard-partial": "leave nothing when interrupted (default: keep the complete part as "
    "NAME.partial.EXT)",
}


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


def skipped_rows(arguments: argparse.Namespace, name: str, path: str | Path) -> Skipped | None:
    """Return what reports how many rows or messages were skipped; None: they are errors."""

    def say(count: int) -> None:
        print(f"{name}: {path}: {count} bad rows skipped", file=sys.stderr)

    return say if arguments.skip_bad_rows else None


class PoseReader:
    """Reads poses as the arguments say, and reports how many rows were skipped."""

    def __init__(self, arguments: argparse.Namespace, name: str) -> None:
        self._skip, self._name = arguments.skip_bad_rows, name

    def __call__(
        self, path: str | Path, topic: str | None = None, covariance: bool = False
    ) -> PoseSequence:
        """Return the poses of a text file or a topic, on request with the file's covariances."""
        from imu_sim_ros.bags.read import read_poses  # readers of every container

        poses = read_poses(path, topic, self._skip, covariance)
        if poses.skipped:
            print(f"{self._name}: {path}: {poses.skipped} bad rows skipped", file=sys.stderr)
        return poses
