# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The error of dead-reckoned states against true ones, matched by their stamps."""

import math
from collections.abc import Iterator
from typing import NamedTuple, TypeVar

from imu_sim_ros.nodes.topics import Truth
from imu_sim_ros.rotation.scalars import Q4, V3, conjugate, multiply

_KEPT = 20000
_Item = TypeVar("_Item")


class Estimate(NamedTuple):
    """A dead-reckoned state."""

    t_ns: int
    position: V3
    """[m]"""
    q_wb: Q4
    """(w, x, y, z)"""


class ErrorAt(NamedTuple):
    """Estimate minus truth."""

    t_ns: int
    position: V3
    """in the world [m]"""
    attitude: V3
    """the rotation vector from the true to the estimated attitude, in the body [rad]"""


class TruthComparison:
    """Keeps estimates and truths until both of one stamp have arrived."""

    def __init__(self) -> None:
        self.last: ErrorAt | None = None
        self.count = 0
        self._sum_of_squares = 0.0
        self._estimates: dict[int, Estimate] = {}
        self._truths: dict[int, Truth] = {}

    @property
    def rms_position(self) -> float:
        """RMS position error so far [m]."""
        return math.sqrt(self._sum_of_squares / self.count) if self.count else 0.0

    def add_estimate(self, estimate: Estimate) -> Iterator[ErrorAt]:
        """Take an estimate; yields its error where its truth is known already."""
        truth = self._truths.pop(estimate.t_ns, None)
        if truth is None:
            _keep(self._estimates, estimate.t_ns, estimate)
        else:
            yield self._compare(estimate, truth)

    def add_truth(self, truth: Truth) -> Iterator[ErrorAt]:
        """Take a truth; yields the error of its estimate where that is known already."""
        estimate = self._estimates.pop(truth.t_ns, None)
        if estimate is None:
            _keep(self._truths, truth.t_ns, truth)
        else:
            yield self._compare(estimate, truth)

    def _compare(self, estimate: Estimate, truth: Truth) -> ErrorAt:
        x, y, z = (a - b for a, b in zip(estimate.position, truth.position, strict=True))
        error = ErrorAt(
            estimate.t_ns,
            (x, y, z),
            _rotation_vector(multiply(conjugate(truth.q_wb), estimate.q_wb)),
        )
        self.last = error
        self.count += 1
        self._sum_of_squares += x * x + y * y + z * z
        return error


def _keep(waiting: dict[int, _Item], t_ns: int, item: _Item) -> None:
    """Store an item; the oldest is dropped where there are too many."""
    waiting[t_ns] = item
    if len(waiting) > _KEPT:
        del waiting[next(iter(waiting))]


def _rotation_vector(q: Q4) -> V3:
    """Return the shorter rotation of a unit quaternion (Sola eq. 105) in plain floats."""
    w, x, y, z = q if q[0] >= 0 else (-q[0], -q[1], -q[2], -q[3])
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    return (scale * x, scale * y, scale * z)
