# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about topics and arguments: several frames, exchanged trajectories, motion at rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.records import States
from imu_sim_ros.core.rotation import conjugate, log, multiply
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.recordings.findings.finding import Evidence, check

if TYPE_CHECKING:
    from typing_extensions import Self


class TopicFrames(NamedTuple):
    """The frames of the readings on one topic."""

    source: str
    """Name of the file and topic."""
    frames: Mapping[str, int]
    """Number of messages of each frame."""


class TrajectoryUse(NamedTuple):
    """A trajectory in its place in a comparison."""

    source: str
    """Name of the trajectory."""
    role: Literal["", "truth", "estimate"]
    """Truth of a simulation or estimate of it; empty: unknown."""
    place: Literal["truth", "estimate"]
    """Argument that it was given as."""


class TruthPairs(NamedTuple):
    """An estimate next to its truth, before any alignment."""

    source: str
    """Name of the estimate."""
    estimate: States
    """(n,) poses of the estimate."""
    nearest: States
    """(n,) poses of the truth with the nearest stamps."""
    interpolated: States
    """(n,) poses of the truth at the times of the estimate."""

    @classmethod
    def of(cls, source: str, estimate: States, truth: States, interpolated: States) -> Self:
        """Return the pairs of an estimate whose times the truth covers."""
        return cls(source, estimate, truth.rows(_nearest(truth.t_ns, estimate.t_ns)), interpolated)

    def equal(self, truth: States) -> bool:
        """Return True if the estimate is a truth of the same rows, but for rounding."""
        moved = float(np.ptp(truth.position, axis=0).max())
        rounding = _rounding(self.estimate.position)
        off = np.abs(self.estimate.position - truth.position) > rounding
        largest_angle = _ROUNDED_ANGLE
        if moved < max(_LEAST_MOTION, _ROUNDINGS * float(rounding.max())):
            if float(_angles(truth.q_wb[:1], truth.q_wb).max()) < _LEAST_TURN:
                return False
            largest_angle = _EXACT_ANGLE
        turned = _angles(self.estimate.q_wb, truth.q_wb) > largest_angle
        return float(np.mean(off.any(axis=1) | turned)) <= _OTHERS


class RestRecord(NamedTuple):
    """A record of an IMU that is analysed as one at rest."""

    motions: tuple[str, ...]
    """Motions in it, each with its size and time."""


@check(
    "error",
    "readings of several IMUs look like those of one that jumps",
    "{frame} chooses one",
)
def frames_mixed(topic: TopicFrames) -> Iterator[Evidence]:
    """Find readings of several frames on one topic."""
    if len(topic.frames) > 1:
        frames = ", ".join(f"{name} ({count:,})" for name, count in topic.frames.items())
        yield Evidence(f"has readings of several frames: {frames}")


_LEAST_POSES: Final = 10
"""Smallest number of poses that are compared."""
_OTHERS: Final = 0.01
"""Largest share of poses that differ from the truth, such as those at its ends."""
_LEAST_MOTION: Final = 1e-3
"""Smallest extent of a motion in which positions are told from each other [m]."""
_ROUNDINGS: Final = 100.0
"""Smallest extent of such a motion, as a multiple of the rounding error."""
_LEAST_TURN: Final = 0.1
"""Smallest rotation that is compared if the body stays in its place [rad]."""
_ROUNDED_ANGLE: Final = 2.5e-3
"""Largest angle by rounding of quaternions to three decimals [rad]: 2 sqrt(4) 0.5e-3, and more."""
_EXACT_ANGLE: Final = 1e-6
"""Largest angle between attitudes that alone show that poses are equal [rad]."""
_DECIMALS: Final = (3, 13)
"""Fewest decimals of rounded readings, and the number from which on they are not rounded."""
_DIGITS: Final = (5, 13)
"""Numbers of decimals and of digits that text may have; fewer hide what estimates differ by."""
_ORDER: Final = "the estimate comes first, the truth second"


@check("error", "errors have the wrong sign, and the estimate's gaps count", _ORDER)
def truth_as_estimate(use: TrajectoryUse) -> Iterator[Evidence]:
    """Find the truth of a simulation in the place of an estimate."""
    if use.place == "estimate" and use.role == "truth":
        yield Evidence("is the truth of a simulation")


@check("error", "errors have the wrong sign, and the estimate's gaps count", _ORDER)
def estimate_as_truth(use: TrajectoryUse) -> Iterator[Evidence]:
    """Find an estimate in the place of the truth."""
    if use.place == "truth" and use.role == "estimate":
        yield Evidence("is an estimate")


@check(
    "error",
    "errors are 0, and say nothing about an estimator",
    "name the estimator's own output as the estimate",
)
def estimate_equals_truth(pairs: TruthPairs) -> Iterator[Evidence]:
    """Find an estimate that is its truth, also a rounded one."""
    count = len(pairs.estimate)
    if count >= _LEAST_POSES and any(map(pairs.equal, (pairs.nearest, pairs.interpolated))):
        yield Evidence(f"its {count:,} poses are those of the truth, but for rounding")


def _nearest(t_ns: Times, at_ns: Times) -> NDArray[np.intp]:
    """Return the rows of the stamps (m,) that are nearest to times (n,)."""
    following = np.clip(np.searchsorted(t_ns, at_ns), 1, max(len(t_ns) - 1, 1))
    preceding = following - 1
    following = np.minimum(following, len(t_ns) - 1)
    return np.where(at_ns - t_ns[preceding] <= t_ns[following] - at_ns, preceding, following)


def _rounding(values: Array) -> Array:
    """Return the largest rounding error of each number: of decimals, digits or 32-bit numbers."""
    size = np.abs(values)
    rounding = 1e-10 * np.maximum(size, 1.0)
    if np.array_equal(values.astype(np.float32), values):
        rounding = np.maximum(rounding, 2.0**-24 * size)
    tolerance = 1e-13 * np.maximum(size, 1.0)
    for decimals in range(*_DECIMALS):
        if (np.abs(np.round(values, decimals) - values) <= tolerance).all():
            rounding = np.maximum(rounding, 0.5000001 * 10.0**-decimals)
            break
    exponent = np.floor(np.log10(np.where(size > 0.0, size, 1.0)))
    for digits in range(*_DIGITS):
        unit = 10.0 ** (exponent - digits + 1)
        if (np.abs(np.round(values / unit) * unit - values) <= tolerance).all():
            rounding = np.maximum(rounding, 0.5000001 * unit)
            break
    return rounding


def _angles(a: Array, b: Array) -> Array:
    """Return the angles (n,) between attitudes [rad]."""
    return np.linalg.norm(log(multiply(conjugate(a), b)), axis=1)


@check("error", "noise and drift cannot be told from motion", "record the IMU at rest")
def motion_at_rest(record: RestRecord) -> Iterator[Evidence]:
    """Find motion in a record that has to be one at rest."""
    for motion in record.motions:
        yield Evidence(f"not at rest: {motion}")


REST: Final = (motion_at_rest,)
"""Checks of a record that has to be one at rest."""
FRAMES: Final = (frames_mixed,)
"""Checks of the frames on a topic."""
USES: Final = (truth_as_estimate, estimate_as_truth)
"""Checks of the place of a trajectory."""
PAIRS: Final = (estimate_equals_truth,)
"""Checks of an estimate next to its truth."""
