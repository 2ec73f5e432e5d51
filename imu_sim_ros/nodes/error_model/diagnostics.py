# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Report of the error model on /diagnostics."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Final

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from imu_sim_ros.core.types import field_values
from imu_sim_ros.nodes.diagnostics import PERIOD, diagnostics
from imu_sim_ros.nodes.publishing import Counter
from imu_sim_ros.simulation.given_sensor import Counts

_IRREGULAR: Final = ("missing", "pauses", "restarts", "repeated", "backward")


class ErrorModelReport:
    """Diagnostics of an error model since the last message."""

    def __init__(self, name: str, hardware: str) -> None:
        self._name, self._hardware = name, hardware
        self._before = Counts()
        self._refused = 0

    def message(
        self,
        stamp: Time,
        counts: Counts,
        refused: int,
        strays: int,
        remarks: Sequence[str],
        counters: Sequence[Counter],
        drawn: Mapping[str, object],
    ) -> DiagnosticArray:
        """Return the message.

        :param refused: number of messages so far that were no readings.
        :param strays: number of messages so far that were left out for their stray stamps.
        :param remarks: lines about what contradicts the declaration of the input.
        :param drawn: seed, and the constants drawn from it.
        """
        previous, self._before = self._before, dataclasses.replace(counts)
        new_refused, self._refused = refused - self._refused, refused
        new_readings = counts.readings - previous.readings
        totals, previous_totals = field_values(counts), field_values(previous)
        irregular = [name for name in _IRREGULAR if totals[name] > previous_totals[name]]
        if new_refused:
            level, text = DiagnosticStatus.WARN, f"{new_refused} messages refused"
        elif not new_readings:
            level, text = DiagnosticStatus.STALE, "no readings arrive"
        elif irregular:
            level, text = DiagnosticStatus.WARN, f"readings: {', '.join(irregular)}"
        elif remarks:
            level, text = DiagnosticStatus.WARN, remarks[0]
        else:
            level, text = DiagnosticStatus.OK, "running"
        values = {
            "readings per second": f"{new_readings / PERIOD:.1f}",
            "refused messages": refused,
            "stray stamps": strays,
            **dataclasses.asdict(counts),
            **{f"{counter.topic} published": counter.count for counter in counters},
            **drawn,
        }
        return diagnostics(stamp, level, self._name, text, self._hardware, values)
