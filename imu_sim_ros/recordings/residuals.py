# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Distance of each recorded pose from a smooth motion through its neighbours alone."""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import Array, Integers

REACH: Final = 3
"""Neighbours on each side."""
_POWERS: Final = np.arange(4)
_LONG_STEP: Final = 5.0
"""Longest step in typical steps; across a longer one neighbours carry no information."""
_RIDGE: Final = 1e-6
"""Weight of a ridge that keeps the normal matrix invertible."""
_PART: Final = 16384
"""Poses examined together; each needs half a kilobyte meanwhile."""
_BLOCK: Final = 100
"""Poses over which the typical residual is determined."""
_MEDIAN_OF_NORM: Final = 1.5382
"""Median of the length of a vector of three standard normal numbers."""
_SMALLEST: Final = 1e-3
"""Smallest deviation of attitudes: digits of a file, and bends of a motion [rad]."""
_FINE: Final = 5e-5
"""Smallest deviation of positions, of poses at high rates [m]."""
_COARSE: Final = 5e-4
"""Smallest deviation of positions, of poses at low rates or of whole millimetres [m]."""
_BEND: Final = 2.0
"""Deviation of a position between poses over the interval squared [m/s^2]: a motion bends less over
a short time. At 200 Hz ten deviations are half a millimetre, and a jump of 1 mm shows (a pose next
to it is off by half of it), which changes the spline's velocity by 0.025 m/s."""


class Residuals(NamedTuple):
    """Residuals of n poses, in units of the typical deviation around them."""

    ratio: Array
    """(n, 2) residuals of position and attitude over the usual deviations."""
    usual: Array
    """(n, 2) usual deviations of position [m] and attitude [rad] around each pose."""
    median: float
    """Median distance of the positions [m]."""

    @property
    def largest(self) -> Array:
        """(n,) the larger one of both residuals of each pose."""
        return np.asarray(self.ratio.max(axis=1))


def smallest_distance(t: Array, position: Array) -> float:
    """Return the deviation [m] below which nothing stands out of poses (n, 3) at times (n,).

    Half a digit if the file has whole millimetres.
    """
    step = float(np.median(np.diff(t)))
    if np.allclose(position, np.round(position, 3), rtol=0.0, atol=1e-7):
        return _COARSE
    return float(np.clip(_BEND * step**2, _FINE, _COARSE))


def residuals(t: Array, position: Array, q_wb: Array, smallest: float = _COARSE) -> Residuals:
    """Return the distance of each pose from a cubic through its six neighbours.

    Least squares without the pose itself, over ``sqrt(1 + leverage)``, so that a pose at an end is
    judged like any other (an externally studentised residual; Cook and Weisberg 1982, section 2.2),
    and then over the typical one of some hundred poses around it.

    :param t: (n,) times [s], increasing; n >= 8.
    :param position: (n, 3) positions [m].
    :param q_wb: (n, 4) attitudes without jumps of sign.
    :param smallest: least deviation of the positions that is assumed [m].
    """
    n, step = len(t), float(np.median(np.diff(t)))
    parts = [
        _lengths(t, position, q_wb, np.arange(begin, min(begin + _PART, n)), step)
        for begin in range(0, n, _PART)
    ]
    lengths = [np.concatenate(part) for part in zip(*parts, strict=True)]
    limits = (smallest, _SMALLEST)
    usual = np.column_stack(
        [_usual(length, limit) for length, limit in zip(lengths, limits, strict=True)]
    )
    return Residuals(np.column_stack(lengths) / usual, usual, float(np.median(lengths[0])))


def _lengths(
    t: Array, position: Array, q_wb: Array, poses: Integers, step: float
) -> tuple[Array, Array]:
    """Return the studentised distances and angles (k,) of some rows."""
    rows = np.clip(poses, REACH, len(t) - 1 - REACH)[:, None] + np.arange(-REACH, REACH + 1)
    weight = (rows != poses[:, None]).astype(np.float64)
    since = t[rows] - t[poses, None]
    span = np.max(np.abs(since), axis=1, keepdims=True)
    powers = (since / span)[..., None] ** _POWERS
    weighted = powers * weight[..., None]
    normal = np.swapaxes(weighted, 1, 2) @ powers
    # Stamps that nearly coincide do not determine a cubic; so little pulls it flat otherwise.
    inverse = np.linalg.inv(normal + _RIDGE * np.eye(len(_POWERS)))
    predict = (weighted @ inverse[:, :, :1])[..., 0]  # (n, 7): the value at the pose's own time
    size = np.sqrt(1.0 + inverse[:, 0, 0])
    apart = np.max(np.diff(t[rows], axis=1), axis=1) > _LONG_STEP * step
    # Over a few poses the four numbers of a quaternion are as smooth as the angles; twice their
    # distance is the angle.
    moved = np.linalg.norm(_prediction_errors(predict, rows, since, position, poses), axis=1) / size
    turned = (
        2.0 * np.linalg.norm(_prediction_errors(predict, rows, since, q_wb, poses), axis=1) / size
    )
    return np.where(apart, 0.0, moved), np.where(apart, 0.0, turned)


def _prediction_errors(
    predict: Array, rows: Integers, since: Array, values: Array, poses: Integers
) -> Array:
    """Return the predictions of poses by their neighbours minus the poses (n, a).

    All are relative to a line through the pose itself, so that distance from the origin and speed
    have no effect, which the ridge would take for a deviation.
    """
    slope = (values[rows[:, -1]] - values[rows[:, 0]]) / (since[:, -1] - since[:, 0])[:, None]
    result = np.zeros((len(poses), values.shape[1]))
    for k in range(rows.shape[1]):
        line = values[poses] + slope * since[:, k, None]
        result += predict[:, k, None] * (values[rows[:, k]] - line)
    return result


def _usual(lengths: Array, limit: float) -> Array:
    """Return the typical deviation (n,) around each pose, from medians of blocks and neighbours."""
    blocks = [lengths[k : k + _BLOCK] for k in range(0, len(lengths), _BLOCK)]
    medians = np.array([np.median(block) for block in blocks]) / _MEDIAN_OF_NORM
    padded = np.pad(medians, 1, mode="edge")
    wide = np.max([padded[:-2], medians, padded[2:]], axis=0)
    return np.maximum(np.repeat(wide, _BLOCK)[: len(lengths)], limit)
