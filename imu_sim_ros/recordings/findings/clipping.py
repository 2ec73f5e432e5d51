# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings at the end of the range that a device counts itself, at a higher rate than it logs."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from imu_sim_ros.core.conventions import Triad
from imu_sim_ros.core.types import Integers, Times
from imu_sim_ros.recordings.findings.finding import Evidence, check


@dataclass(frozen=True)
class ClippingCounts:
    """Counts of clipped readings of one triad over time."""

    source: str
    """Name of the sensor in the log."""
    triad: Triad
    """Triad whose readings are counted."""
    t_ns: Times
    """(n,) stamps."""
    total: Integers
    """(n,) clipped readings of all axes since the start of the device."""


@check(
    "warning",
    "motion beyond the range is missing: integrals, and noise and biases fitted to it, are wrong",
    "choose a larger range of the sensor, or damp its mount",
)
def readings_clipped(counts: ClippingCounts) -> Iterator[Evidence]:
    """Find readings at the end of the range, as the device counts them."""
    steps = np.diff(counts.total)
    rows = np.flatnonzero(steps > 0) + 1
    if len(rows):
        number = int(steps[steps > 0].sum())
        seconds = float(counts.t_ns[rows[0]]) * 1e-9
        text = f"the {counts.triad} clipped {number:,} times, first before {seconds:.3f} s"
        yield Evidence(text, number=number)


CLIPPING: Final = (readings_clipped,)
"""Checks of the counts that devices keep."""
