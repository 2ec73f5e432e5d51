# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about poses that no body moves through: outliers, jumps, times of arrival."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array, Integers
from imu_sim_ros.recordings.findings.finding import Evidence, check
from imu_sim_ros.recordings.findings.states import StateMeasures
from imu_sim_ros.recordings.repair import Disturbances, Jump

_SHOWN: Final = 5
"""Disturbances that are described."""
_LATE: Final = 2.0
"""Intervals of the stamps over which the motion of a held pose is no disturbance."""
_PEAK: Final = 3.0
"""Largest angular rate of a motion over its root mean square."""
_OPTION: Final = "{robust true} (trajectory.robust)"


class DisturbedPoses(NamedTuple):
    """Poses, and their disturbances."""

    states: States
    """Poses as they were recorded."""
    disturbances: Disturbances
    """Rows that no body moves through."""

    def _lag(self) -> tuple[float, float]:
        """Return how far a body moves [m], and turns [rad], while a held pose may be late.

        A pose that is held appears up to an interval of the stamps after its time.
        """
        if not len(self.disturbances.repeated):
            return 0.0, 0.0
        distinct = np.setdiff1d(np.arange(len(self.states)), self.disturbances.repeated)
        measures = StateMeasures(self.states.rows(distinct))
        interval = StateMeasures(self.states).interval
        speed = np.linalg.norm(measures.velocity, axis=1)
        return (
            _LATE * interval * float(np.quantile(speed, 0.99)) if len(speed) else 0.0,
            _LATE * interval * _PEAK * measures.turning,
        )

    def jumps(self) -> list[Jump]:
        """Return the jumps that are not those of held poses at late stamps."""
        distance, angle = self._lag()
        return [
            jump
            for jump in self.disturbances.jumps
            if np.linalg.norm(jump.shift) > distance or np.linalg.norm(jump.turn) > angle
        ]

    def outliers(self) -> tuple[Integers, Array, Array]:
        """Return rows (k,) of outlying poses that are not held ones at late stamps.

        With them come their distances [m] and angles [rad] from the motion of their neighbours.
        """
        single, size, turn = self.disturbances.single, *self.disturbances[1:3]
        distance, angle = self._lag()
        off = (size > distance) | (turn > angle)
        return single[off], size[off], turn[off]

    def place(self, row: int) -> str:
        """Return the name of a row, with its time."""
        lines, t = self.states.lines, self.states.t[row]
        name = f"pose {row + 1}" if lines is None else f"line {lines[row]}"
        return f"{name} ({t:.3f} s)"


@check(
    "warning",
    "accelerations that are computed from them are far too large",
    f"{_OPTION} leaves them out",
)
def poses_outlying(poses: DisturbedPoses) -> Iterator[Evidence]:
    """Find single poses off the motion of their neighbours."""
    rows, distances, angles = poses.outliers()
    count = len(rows)
    if not count:
        return
    places = [
        f"{poses.place(int(row))} by {distance:.3g} m and {np.degrees(angle):.3g} deg"
        for row, distance, angle in zip(rows, distances, angles, strict=True)
    ]
    subject = "1 pose lies" if count == 1 else f"{count} poses lie"
    yield Evidence(
        f"{subject} off the motion of the neighbours: {_largest(places, distances)}",
        int(rows[0]),
        count,
    )


@check(
    "warning",
    "accelerations that are computed from them are far too large",
    f"{_OPTION} joins the pieces",
)
def poses_jump(poses: DisturbedPoses) -> Iterator[Evidence]:
    """Find a motion that continues elsewhere, as after a loop closure or a reset."""
    jumps = poses.jumps()
    if not jumps:
        return
    sizes = [float(np.linalg.norm(jump.shift)) for jump in jumps]
    places = [
        f"{poses.place(jump.row)} by {size:.3g} m and "
        f"{np.degrees(np.linalg.norm(jump.turn)):.3g} deg"
        for jump, size in zip(jumps, sizes, strict=True)
    ]
    text = f"the motion jumps at {_largest(places, sizes)}"
    yield Evidence(text, int(jumps[0].row), len(jumps))


@check(
    "warning",
    "velocities that are computed from them scatter",
    f"{_OPTION} uses even times",
)
def poses_arrival(poses: DisturbedPoses) -> Iterator[Evidence]:
    """Find stamps of poses that are times of arrival."""
    disturbances = poses.disturbances
    if disturbances.scatter and not len(disturbances.repeated):
        yield Evidence(
            f"the stamps scatter by {disturbances.scatter * 1e3:.3g} ms about an even interval of "
            f"{disturbances.interval * 1e3:.4g} ms, on which the motion is smoother: they appear "
            "to be times of arrival"
        )


def _largest(places: Sequence[str], sizes: Sequence[float] | Array) -> str:
    """Return the few largest disturbances, in the order of the file."""
    shown = sorted(np.argsort(-np.asarray(sizes), kind="stable")[:_SHOWN])
    surplus = len(places) - _SHOWN
    rest = f" and {surplus} smaller {'one' if surplus == 1 else 'ones'}" if surplus > 0 else ""
    return ", ".join(places[k] for k in shown) + rest


DISTURBANCES: Final = (poses_jump, poses_outlying, poses_arrival)
"""Checks of poses against a smooth motion."""
