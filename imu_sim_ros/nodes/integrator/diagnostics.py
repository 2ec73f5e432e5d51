# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Report of the integrator on /diagnostics, once per second."""

import dataclasses
import math
from collections.abc import Iterator
from typing import TypeVar

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from imu_sim_ros.core.records import LiveState
from imu_sim_ros.navigation.evaluation import attitude_error
from imu_sim_ros.nodes.diagnostics import PERIOD, diagnostics
from imu_sim_ros.nodes.integrator.odometer import LiveIntegrator
from imu_sim_ros.parameters.kinds import Vector

_KEPT = 20000
"""Largest number of truths that wait for an estimate."""
_Item = TypeVar("_Item")


PoseError = tuple[int, Vector, Vector]
"""Stamp [ns] of an estimate, and its errors, estimate minus truth: position in the world [m], and
rotation vector ``Log(q_estimate q_truth^-1)`` about the world's axes [rad]."""


class TruthComparison:
    """Keeps estimates and truths until both of one stamp have arrived."""

    def __init__(self) -> None:
        self.last: PoseError | None = None
        self.count = self.estimates = 0
        self._sum_of_squares = 0.0
        self._estimates: dict[int, LiveState] = {}
        self._truths: dict[int, LiveState] = {}

    @property
    def rms_position(self) -> float:
        """RMS position error so far [m]."""
        return math.sqrt(self._sum_of_squares / self.count) if self.count else 0.0

    def add_estimate(self, estimate: LiveState) -> Iterator[PoseError]:
        """Add an estimate; yield its error if its truth is known already."""
        self.estimates += 1
        truth = self._truths.pop(estimate.t_ns, None)
        if truth is None:
            pose = estimate._replace(covariance=None, twist_covariance=None)
            _keep(self._estimates, estimate.t_ns, pose)
        else:
            yield self._compare(estimate, truth)

    def add_truth(self, truth: LiveState) -> Iterator[PoseError]:
        """Add a true state; yield the error of its estimate if that is known already."""
        estimate = self._estimates.pop(truth.t_ns, None)
        if estimate is None:
            _keep(self._truths, truth.t_ns, truth)
        else:
            yield self._compare(estimate, truth)

    def _compare(self, estimate: LiveState, truth: LiveState) -> PoseError:
        """Return the error of a state: estimate minus truth."""
        px, py, pz = estimate.position
        x, y, z = truth.position
        x, y, z = px - x, py - y, pz - z
        error = estimate.t_ns, (x, y, z), attitude_error(estimate.q_wb, truth.q_wb)
        self.last = error
        self.count += 1
        self._sum_of_squares += x * x + y * y + z * z
        return error


def _keep(waiting: dict[int, _Item], t_ns: int, item: _Item) -> None:
    """Store an item; the oldest is dropped if there are too many."""
    waiting[t_ns] = item
    if len(waiting) > _KEPT:
        del waiting[next(iter(waiting))]


class IntegratorReport:
    """Diagnostics of an integrator since the last message."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._before = (0, 0, 0)
        self._compared = 0

    def message(
        self,
        stamp: Time,
        odometer: LiveIntegrator,
        comparison: TruthComparison | None,
        refused: int,
        strays: int,
    ) -> DiagnosticArray:
        """Return the message, with the error if there is a comparison with the truth.

        :param refused: number of messages, of readings and the truth, that the gate did not pass.
        :param strays: number of readings so far that were left out for their stray stamps.
        """
        totals = odometer.totals
        counts = dataclasses.asdict(totals.steps)
        irregular = sum(counts.values())
        new_readings, new_irregular = totals.readings - self._before[0], irregular - self._before[1]
        new_refused = refused - self._before[2]
        self._before = (totals.readings, irregular, refused)
        compared = 0 if comparison is None else comparison.count
        lacks_truth = comparison is not None and compared == self._compared
        self._compared = compared
        if new_refused:
            level, message = DiagnosticStatus.WARN, f"{new_refused} messages refused"
        elif not new_readings:
            level, message = DiagnosticStatus.STALE, "no readings arrive"
        elif odometer.waiting:
            level, message = DiagnosticStatus.WARN, "waiting for the initial state"
        elif new_irregular:
            level, message = DiagnosticStatus.WARN, f"{new_irregular} irregular readings"
        elif lacks_truth:
            level, message = DiagnosticStatus.WARN, "no truth arrives: errors are not those of now"
        else:
            level, message = DiagnosticStatus.OK, "integrating"
        values: dict[str, object] = {
            "readings": totals.readings,
            "readings per second": f"{new_readings / PERIOD:.1f}",
            "refused messages": refused,
            "starts": totals.starts,
            "imu.preset": odometer.parameters.imu.preset,
            "stray stamps": strays,
            **{name.replace("_", " "): count for name, count in counts.items()},
        }
        if comparison is not None:
            values["estimates with a truth"] = f"{comparison.count} of {comparison.estimates}"
            if comparison.last is not None:
                _, position, attitude = comparison.last
                values |= {
                    "position error [m]": f"{math.hypot(*position):.6f}",
                    "rms position error [m]": f"{comparison.rms_position:.6f}",
                    "attitude error [rad]": f"{math.hypot(*attitude):.8f}",
                }
        return diagnostics(stamp, level, self._name, message, "imu", values)
