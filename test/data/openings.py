# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Counts of the openings of files in this process."""

import os
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

_counts: dict[Path, Counter[Path]] = {}
"""Counts that are kept now, by each of their files."""


@contextmanager
def count_openings(path: Path) -> Iterator[Counter[Path]]:
    """Yield the number of openings of a file, or of each file that a folder has at the start.

    :param path: absolute path.
    """
    _install()
    counts = Counter({file: 0 for file in (path, *path.rglob("*")) if file.is_file()})
    _counts.update(dict.fromkeys(counts, counts))
    try:
        yield counts
    finally:
        for file in counts:
            del _counts[file]


@cache
def _install() -> None:
    """Install the audit hook, which stays to the end of the process."""
    sys.addaudithook(_note)


def _note(event: str, arguments: tuple[object, ...]) -> None:
    """Count an opening."""
    if _counts and event == "open" and isinstance(arguments[0], str | os.PathLike):
        path = Path(os.path.abspath(arguments[0]))
        if path in _counts:
            _counts[path][path] += 1
