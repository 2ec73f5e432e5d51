# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write the kinds of findings as Markdown.

``python docs/contributing/write_findings.py > docs/reference/findings.md``
"""

from collections.abc import Iterator

from imu_sim_ros.recordings.findings.catalogue import GROUPS

_INTRODUCTION = """\
# Findings

This page lists the kinds of findings that [inspect](../how_to/inspect.md) reports; `make reference`
writes it. With an error, results are wrong; with a warning, they are worse than they could be; a
note is good to know.
"""


def reference() -> str:
    """Return the whole page."""
    return "\n".join(_lines())


def _lines() -> Iterator[str]:
    yield _INTRODUCTION
    for title, checks in GROUPS.items():
        yield f"## {title}\n"
        yield "| kind | severity | fault | effect | remedy |"
        yield "|---|---|---|---|---|"
        for check in checks:
            cells = (check.meaning, check.effect, check.remedy)
            yield f"| `{check.kind}` | {check.severity} | {' | '.join(cells)} |"
        yield ""


if __name__ == "__main__":
    print(reference(), end="")
