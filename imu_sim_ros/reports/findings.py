# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings of recordings on a page, worst first."""

from collections.abc import Iterable

from imu_sim_ros.recordings.findings.finding import Finding
from imu_sim_ros.reports.page import Item, Section, table

_COLUMNS = ["severity", "kind", "source", "place", "evidence", "effect", "what to do"]


def findings_section(findings: Iterable[Finding], title: str = "Findings") -> Section:
    """Return the section of a page with findings in their order; without any it says so."""
    rows = [
        [
            *(finding.severity, finding.kind, finding.source, finding.place()),
            *(finding.evidence, finding.effect, finding.remedy),
        ]
        for finding in findings
    ]
    nothing: Item = {"kind": "text", "text": "No findings."}
    item = table("findings", _COLUMNS, rows, search=False) if rows else nothing
    return Section(title, [item], "Findings")
