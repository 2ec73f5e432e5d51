# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Refusals of bad files."""

from collections.abc import Callable, Sequence
from pathlib import Path

from imu_sim_ros.core.errors import InputError


def problems_of(reader: Callable[[Path], object], path: Path) -> Sequence[str]:
    """Return the lines with which a reader refuses a file; none if it reads it.

    Any other exception than the package's error of the input passes.
    """
    try:
        reader(path)
    except InputError as error:
        return error.problems
    return ()
