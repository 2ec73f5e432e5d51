# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is the truth's and not the sensor's, found again on another part of a recording."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.twin import clock
from imu_sim_ros.calibration.twin.fit import Fit, Recording, fit
from imu_sim_ros.calibration.twin.model import CURVATURE, OFFSET, SKEW, Truth

Array = NDArray[np.float64]

OF_THE_TRUTH: Final = np.r_[OFFSET, SKEW, CURVATURE]
"""Parameters that may differ from one part of a recording to the next."""
_ALIGNMENTS: Final = 2


def laid_on(recording: Recording, truth: Truth, found: Fit) -> Fit:
    """Return a fit of the truth's clock and smoothing on a recording; all else stays as found.

    :param found: of another recording, or of this one.
    """
    middle = float(recording.stamps[0] + recording.stamps[-1]) / 2.0
    start = found.errors.referred(middle - found.reference)
    result = fit(recording, truth, start, free=OF_THE_TRUTH)
    for _ in range(_ALIGNMENTS):
        stamps, residuals = recording.stamps, result.residuals
        course = clock.wander(stamps, residuals, result.slope, recording.rate, steady=False)
        wander = result.wander + course
        result = fit(recording, truth, result.errors, wander=wander, free=OF_THE_TRUTH)
    return result
