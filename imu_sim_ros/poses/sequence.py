# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses of one body over time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class PoseSequence(NamedTuple):
    """Poses of one body over time."""

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
