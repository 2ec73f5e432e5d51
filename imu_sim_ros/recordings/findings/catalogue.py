# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The list of all checks, and the findings of a recording, worst first."""

from collections.abc import Iterable, Iterator
from typing import Any, Final

from imu_sim_ros.recordings.findings.finding import SEVERITIES, FaultCheck, Finding, RecordT
from imu_sim_ros.recordings.findings.measures import ReadingMeasures
from imu_sim_ros.recordings.findings.readings import READINGS
from imu_sim_ros.recordings.findings.stamps import STAMPS
from imu_sim_ros.recordings.findings.states import STATES, StateMeasures
from imu_sim_ros.records import Readings, States, TimeSeries

GROUPS: Final[dict[str, tuple[FaultCheck[Any], ...]]] = {
    "Readings": READINGS,
    "Stamps": STAMPS,
    "Poses": STATES,
}
"""All checks, by the part of a recording that they look at."""
KINDS: Final = {check.kind: check for checks in GROUPS.values() for check in checks}
"""All checks by the kind of their findings."""


def reading_findings(readings: Readings, measures: ReadingMeasures | None = None) -> list[Finding]:
    """Return the findings about readings and their stamps, worst first.

    :param measures: what was measured of these readings; None: it is measured.
    """
    if not len(readings):
        return []
    measures = measures or ReadingMeasures(readings)
    findings = list(_findings(READINGS, measures, readings))
    if measures.clock is not None:
        findings += _findings(STAMPS, measures.clock, readings)
    return by_severity(findings)


def state_findings(states: States) -> list[Finding]:
    """Return the findings about poses and their twist, worst first."""
    if not len(states):
        return []
    return by_severity(_findings(STATES, StateMeasures(states), states))


def by_severity(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings with the worst first."""
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))


def _findings(
    checks: Iterable[FaultCheck[RecordT]], record: RecordT, series: TimeSeries
) -> Iterator[Finding]:
    """Yield the findings of checks.

    :param series: rows whose times and lines are stated.
    """
    for check in checks:
        for evidence in check.find(record):
            row = evidence.row
            placed = row is not None and row < len(series)
            yield Finding(
                check.kind,
                check.severity,
                series.source,
                evidence.text,
                check.effect,
                check.remedy,
                row,
                evidence.number,
                float(series.t_ns[row] - series.t_ns[0]) * 1e-9 if placed else None,
                int(series.lines[row]) if placed and series.lines is not None else None,
            )
