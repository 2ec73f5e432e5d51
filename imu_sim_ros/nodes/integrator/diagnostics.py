# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What /diagnostics reports about the integrator, once per second."""

import dataclasses
import math
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType

_PERIOD = 1.0


class IntegratorDiagnostics:
    """Publishes counts and, where it is compared with the truth, the error."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._before = (0, 0, 0)
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 1)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(_PERIOD, self._publish, clock=steady)

    def _publish(self) -> None:
        array = DiagnosticArray(status=[self._status()])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)

    def _status(self) -> DiagnosticStatus:
        odometer = self._node.odometer
        totals = odometer.totals
        counts = dataclasses.asdict(totals.steps)
        irregular = sum(counts.values())
        new, new_irregular = totals.readings - self._before[0], irregular - self._before[1]
        refused = totals.refused - self._before[2]
        self._before = (totals.readings, irregular, totals.refused)
        if refused:
            level, message = DiagnosticStatus.WARN, f"{refused} messages refused"
        elif not new:
            level, message = DiagnosticStatus.STALE, "no readings arrive"
        elif odometer.waiting:
            level, message = DiagnosticStatus.WARN, "waiting for the initial state"
        elif new_irregular:
            level, message = DiagnosticStatus.WARN, f"{new_irregular} irregular readings"
        else:
            level, message = DiagnosticStatus.OK, "integrating"
        values = {
            "readings": totals.readings,
            "readings per second": f"{new / _PERIOD:.1f}",
            "refused messages": totals.refused,
            "starts": totals.starts,
            "imu.preset": self._node.parameters.imu.preset,
            **{name.replace("_", " "): count for name, count in counts.items()},
            **self._errors(),
        }
        return DiagnosticStatus(
            level=level,
            name=f"{self._node.get_name()}: dead reckoning",
            message=message,
            hardware_id="imu",
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )

    def _errors(self) -> dict[str, str]:
        comparison = self._node.comparison
        if comparison is None or comparison.last is None:
            return {}
        return {
            "position error [m]": f"{math.hypot(*comparison.last.position):.6f}",
            "rms position error [m]": f"{comparison.rms_position:.6f}",
            "attitude error [rad]": f"{math.hypot(*comparison.last.attitude):.8f}",
        }
