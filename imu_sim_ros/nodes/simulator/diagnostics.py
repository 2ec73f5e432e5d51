# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Report of the simulator on /diagnostics: counts and lateness."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from imu_sim_ros.nodes.diagnostics import diagnostics
from imu_sim_ros.nodes.publishing import Counter

if TYPE_CHECKING:
    from imu_sim_ros.nodes.simulator.apart import RemoteCounter

LATE_US: Final = 500.0
"""A 99th percentile above this is a warning."""


class Histogram:
    """Lateness of a whole run in memory of constant size: logarithmic bins of 2 %."""

    _edges = np.geomspace(1e2, 1e12, 1164)  # [ns]

    def __init__(self) -> None:
        self._counts = np.zeros(len(self._edges) + 1, dtype=np.int64)
        self.maximum_ns = 0

    def add(self, lateness_ns: Sequence[int]) -> None:
        """Count samples."""
        if len(lateness_ns):
            bins = np.searchsorted(self._edges, lateness_ns)
            self._counts += np.bincount(bins, minlength=len(self._counts))
            self.maximum_ns = max(self.maximum_ns, *lateness_ns)

    def quantile_us(self, fraction: float) -> float:
        """Return the lateness that a fraction of the samples do not exceed [us]."""
        index = np.searchsorted(np.cumsum(self._counts), fraction * self._counts.sum())
        return float(self._edges[min(index, len(self._edges) - 1)]) * 1e-3


class StreamReport:
    """Diagnostics of a simulator's stream since the last message."""

    def __init__(self, name: str, hardware: str) -> None:
        self._name, self._hardware = name, hardware
        self._counts: dict[str, int] = {}
        self._late: Mapping[str, int] = {}

    def message(
        self,
        stamp: Time,
        elapsed: float,
        state: str,
        counters: "Sequence[Counter | RemoteCounter]",
        lateness_ns: Sequence[int],
        late: Mapping[str, int],
        drawn: Mapping[str, str],
    ) -> DiagnosticArray:
        """Return the message.

        :param elapsed: seconds since the last message.
        :param state: text: running, paused or waiting.
        :param lateness_ns: lateness of the samples since the last message.
        :param late: numbers of samples caught up and skipped since the start.
        :param drawn: seeds, and the constants drawn from them.
        """
        values: dict[str, str] = {"state": state}
        p99 = 0.0
        if len(lateness_ns):
            p50, p99 = np.percentile(lateness_ns, (50, 99)) * 1e-3
            values["lateness p50 [us]"] = f"{p50:.0f}"
            values["lateness p99 [us]"] = f"{p99:.0f}"
            values["lateness max [us]"] = f"{max(lateness_ns) * 1e-3:.0f}"
        values.update({f"{key} samples": str(value) for key, value in late.items()})
        for counter in counters:
            previous_count = self._counts.get(counter.topic, 0)
            self._counts[counter.topic] = counter.count
            rate = (counter.count - previous_count) / elapsed
            values[f"{counter.topic} rate [Hz]"] = f"{rate:.1f}"
            values[f"{counter.topic} published"] = str(counter.count)
            subscribers = counter.publisher.get_subscription_count()
            values[f"{counter.topic} subscribers"] = str(subscribers)
        level, text = DiagnosticStatus.OK, state
        if any(count > self._late.get(key, 0) for key, count in late.items()):
            level, text = DiagnosticStatus.WARN, "samples were late"
        elif p99 > LATE_US:
            level, text = DiagnosticStatus.WARN, f"99 % of the samples are up to {p99:.0f} us late"
        values |= drawn
        self._late = dict(late)
        return diagnostics(stamp, level, self._name, text, self._hardware, values)
