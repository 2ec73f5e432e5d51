# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses of one body over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.arguments import array, stamps
from imu_sim_ros.inputs import gate

if TYPE_CHECKING:
    from typing_extensions import Self


class _Poses(NamedTuple):
    t_ns: NDArray[np.int64]
    """(n,) stamps [ns], strictly increasing."""
    position: NDArray[np.float64]
    """(n, 3) p_wb [m]."""
    q_wb: NDArray[np.float64]
    """(n, 4) unit quaternions (w, x, y, z)."""
    dropped: int = 0
    """Poses left out because they occurred twice, with the same stamp."""
    skipped: int = 0
    """Bad rows skipped on request."""
    lines: NDArray[np.int64] | None = None
    """(n,) lines of the file that they stand in, from 1; None: they are from no text."""
    covariance: NDArray[np.float64] | None = None
    """(n, 6, 6) of position and of rotation about the world's axes; None: the source has none."""


class PoseSequence(_Poses):
    """Poses of one body over time; they are checked when they are made."""

    __slots__ = ()

    def __new__(
        cls,
        t_ns: ArrayLike,
        position: ArrayLike,
        q_wb: ArrayLike,
        dropped: int = 0,
        skipped: int = 0,
        lines: NDArray[np.int64] | None = None,
        covariance: NDArray[np.float64] | None = None,
    ) -> Self:
        """Check the poses; lists become arrays.

        :raises ConfigurationError: for another type or shape.
        :raises InputError: for a pose that is not possible, or without a unit quaternion.
        """
        times = stamps("t_ns", t_ns)
        p = array("position", position, (len(times), 3), finite=False)
        q = array("q_wb", q_wb, (len(times), 4), finite=False)
        gate.poses(times, p, q).complain("poses")
        return super().__new__(cls, times, p, q, dropped, skipped, lines, covariance)
