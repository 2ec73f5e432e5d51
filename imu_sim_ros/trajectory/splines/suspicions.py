# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with recorded poses, as text, by the lines of their file."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.trajectory.motion import Array
from imu_sim_ros.trajectory.splines.repair import Findings

_SHOWN: Final = 5
_LARGEST_ACCELERATION: Final = 160.0
"""[m/s^2] 16 g, the widest range of consumer sensors; vehicles and people stay below."""
_LARGEST_RATE: Final = 35.0
"""[rad/s] 2000 deg/s, the widest range of consumer sensors."""
_OPTION: Final = "--robust (trajectory.robust)"


def suspicions(
    findings: Findings, file: str, poses: PoseSequence, t: Array, robust: bool
) -> list[str]:
    """Return a line for each kind of problem.

    :param t: (n,) times of the poses [s].
    :param robust: whether it was repaired; else the option that repairs it is named.
    """
    return list(_lines(findings, file, poses, t, robust))


def _lines(
    findings: Findings, file: str, poses: PoseSequence, t: Array, robust: bool
) -> Iterator[str]:
    def place(row: int) -> str:
        name = f"pose {row + 1}" if poses.lines is None else f"line {poses.lines[row]}"
        return f"{name} ({t[row]:.3f} s)"

    def remedy(done: str, would: str) -> str:
        return f"; {done}" if robust else f"; {_OPTION} {would}"

    count = len(findings.single)
    if count:
        found = [
            f"{place(int(row))} by {distance:.3g} m and {np.degrees(angle):.3g} deg"
            for row, distance, angle in zip(
                findings.single, findings.distance, findings.angle, strict=True
            )
        ]
        poses_lie, it = ("1 pose lies", "it") if count == 1 else (f"{count} poses lie", "them")
        yield (
            f"{file}: {poses_lie} off the motion of the neighbours: "
            f"{_largest(found, findings.distance)}" + remedy("left out", f"leaves {it} out")
        )
    if findings.jumps:
        sizes = [float(np.linalg.norm(jump.shift)) for jump in findings.jumps]
        found = [
            f"{place(jump.row)} by {size:.3g} m and {np.degrees(np.linalg.norm(jump.turn)):.3g} deg"
            for jump, size in zip(findings.jumps, sizes, strict=True)
        ]
        yield (
            f"{file}: the motion jumps at {_largest(found, sizes)}"
            + remedy("all later poses were moved to continue the motion", "joins the pieces")
        )
    if findings.scatter:
        yield (
            f"{file}: the stamps scatter by {findings.scatter * 1e3:.3g} ms about an even interval "
            f"of {findings.interval * 1e3:.4g} ms, on which the motion is smoother: they appear to "
            "be times of arrival" + remedy("even times were used", "uses even times")
        )


def _largest(found: Sequence[str], sizes: Sequence[float] | Array) -> str:
    """Return the largest few of what was found, in the file's order."""
    shown = sorted(np.argsort(-np.asarray(sizes), kind="stable")[:_SHOWN])
    more = len(found) - _SHOWN
    rest = f" and {more} smaller {'one' if more == 1 else 'ones'}" if more > 0 else ""
    return ", ".join(found[k] for k in shown) + rest


def beyond_any_body(
    file: str, acceleration: float, acceleration_at: float, rate: float, rate_at: float
) -> list[str]:
    """Return a line for each peak of a spline that no body carrying an IMU could reach.

    :param acceleration: [m/s^2], at acceleration_at [s].
    :param rate: [rad/s], at rate_at [s].
    """
    return [
        f"{file}: {value:.4g} {unit} at {at:.3f} s is more than a body carrying an IMU reaches "
        f"({limit:g} {unit}): the poses are not a plausible motion there"
        for value, at, limit, unit in (
            (acceleration, acceleration_at, _LARGEST_ACCELERATION, "m/s^2"),
            (rate, rate_at, _LARGEST_RATE, "rad/s"),
        )
        if value > limit
    ]
