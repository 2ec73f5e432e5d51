# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What of a twin's numbers can be believed, and what contradicts itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.twin import PRIOR, Fit, model
from imu_sim_ros.calibration.twin.pose_noise import PoseNoise

Array = NDArray[np.float64]

MATRIX: Final = tuple(row + column for row in "xyz" for column in "xyz")
_OF: Final = (
    ("stamp_offset", ("",)),
    ("clock_skew_ppm", ("",)),
    ("mounting", tuple("xyz")),
    ("gyroscope_scale_misalignment", MATRIX),
    ("accelerometer_scale_misalignment", ("xx", "xy", "xz", "yy", "yz", "zz")),
    ("gyroscope_g_sensitivity", MATRIX),
    ("lever_arm", tuple("xyz")),
    ("gyroscope_bias", tuple("xyz")),
    ("accelerometer_bias", tuple("xyz")),
    ("truth_curvature", ("",)),
    ("truth_turn", tuple("xyz")),
)
NAMES: Final = tuple(f"{name} {part}".strip() for name, parts in _OF for part in parts)
"""Of the 42 parameters, in their order."""
_UNDETERMINED: Final = 0.7
"""Standard error over the prior's above which a motion says nothing of a parameter."""
_NOT_GIVEN: Final = 5.0
"""Standard errors by which the poses' noise may move a number that is given."""
_SAID: Final = 2.0
_DISAGREE: Final = 3.0
"""Standard errors, RMS of four quarters of the recording: by chance once in a million numbers, as
the chi-square of four degrees of freedom is 36."""
_SURE: Final = 5.0
"""Standard errors."""
_TILT: Final = 0.02
"""[rad] of a truth that is levelled."""
_SCALE: Final = 0.05
"""Error of scale, and misalignment, that no calibrated sensor and few others have."""
_BIAS: Final = (0.35, 0.5)
"""[rad/s], [m/s^2] that few sensors have: 20 deg/s and 50 mg."""


class Trust(NamedTuple):
    """What can be believed."""

    fit: Fit
    """With standard errors no smaller than the recording itself shows."""
    given: NDArray[np.bool_]
    """(42,) whether a number is given."""
    undetermined: tuple[str, ...]
    """Numbers that this motion does not determine."""
    warnings: tuple[str, ...]


def judged(found: Fit, disagreement: Array, noise: PoseNoise) -> Trust:
    """Return what can be believed of a fit.

    :param disagreement: (42,) of fits to parts of the recording, in standard errors.
    """
    sigma = found.sigma
    disagree = disagreement > _DISAGREE
    larger = np.where(disagree, disagreement, 1.0)
    wider = found._replace(covariance=found.covariance * np.outer(larger, larger))
    given = found.hanging <= _NOT_GIVEN
    weak = sigma > _UNDETERMINED * PRIOR
    undetermined = tuple(
        NAMES[k] for k in range(model.GYROSCOPE.start, model.BIAS.start) if weak[k]
    )
    warnings = [*_of_noise(found, given, noise), *_of_quarters(disagree, larger)]
    warnings += _contradictions(wider)
    return Trust(wider, given, undetermined, tuple(warnings))


def _of_noise(found: Fit, given: NDArray[np.bool_], noise: PoseNoise) -> Iterator[str]:
    angle, distance = 1e3 * noise.deviation
    poses = f"noise of the poses, {distance:.2g} mm and {angle:.2g} mrad"
    hidden = [NAMES[k] for k in np.flatnonzero(~given)]
    if hidden:
        yield f"not given, since they hang on the {poses}: {', '.join(hidden)}"
    moved = given & (found.hanging > _SAID)
    if moved.any():
        sizes = [f"{NAMES[k]} by {found.hanging[k]:.1f}" for k in np.flatnonzero(moved)]
        yield f"corrected for the {poses}, in standard errors: {', '.join(sizes)}"


def _of_quarters(disagree: NDArray[np.bool_], larger: Array) -> Iterator[str]:
    if disagree.any():
        sizes = [f"{NAMES[k]} ({larger[k]:.0f} times)" for k in np.flatnonzero(disagree)]
        yield (
            "quarters of the recording contradict each other, so the sensor or its truth changes; "
            f"standard errors are enlarged to these differences: {', '.join(sizes)}"
        )


def _contradictions(found: Fit) -> Iterator[str]:
    """Return lines for what is not a sensor's."""
    errors, sigma = found.errors, found.sigma
    tilt, unsure = errors.world[:2], sigma[model.WORLD][:2]
    angle = float(np.linalg.norm(tilt))
    if angle > _TILT and np.any(np.abs(tilt) > _SURE * unsure):
        yield (
            f"the truth's attitudes are turned by {np.degrees(angle):.2g} degrees against gravity: "
            "accelerometer biases and scales with another truth would be others"
        )
    deviation = errors.deviation()
    for part, limit in (
        (model.GYROSCOPE, _SCALE),
        (model.ACCELEROMETER, _SCALE),
        (slice(model.BIAS.start, model.BIAS.start + 3), _BIAS[0]),
        (slice(model.BIAS.start + 3, model.BIAS.stop), _BIAS[1]),
    ):
        for k in range(part.start, part.stop):
            beyond = abs(deviation[k]) - limit
            if beyond > 0.0 and abs(deviation[k]) > _SURE * sigma[k]:
                yield (
                    f"{NAMES[k]} is {deviation[k]:+.3g} from a perfect sensor's, more than a "
                    f"sensor has ({limit:g}): the truth, its frame or the gravity contradicts the "
                    "readings"
                )
