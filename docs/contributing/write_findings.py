# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write the kinds of findings as Markdown.

``python docs/contributing/write_findings.py > docs/reference/findings.md``
"""

from collections.abc import Iterator

from imu_sim_ros.core.spelling import spell_arguments, use_spelling
from imu_sim_ros.recordings.findings.catalogue import GROUPS, KINDS
from imu_sim_ros.recordings.findings.policy import JOBS

_INTRODUCTION = """\
# Findings

This page lists the kinds of findings that [inspect](../how_to/inspect.md) reports; `make reference`
writes it. With an error, results are wrong; with a warning, they are worse than they could be; a
note is good to know.
"""


def reference() -> str:
    """Return the whole page."""
    with use_spelling("program"):
        return "\n".join(_lines())


def _lines() -> Iterator[str]:
    yield _INTRODUCTION
    for title, checks in GROUPS.items():
        yield f"## {title}\n"
        yield "| kind | severity | fault | effect | remedy |"
        yield "|---|---|---|---|---|"
        for check in checks:
            cells = (check.meaning, check.effect, spell_arguments(check.remedy))
            yield f"| `{check.kind}` | {check.severity} | {' | '.join(cells)} |"
        yield ""
    yield "## Jobs\n"
    yield (
        "`inspect` and `report` tell all of them. The other jobs refuse them (exit status 2), "
        "correct and tell them, or only tell them;\nan empty cell means that the finding does not "
        "matter to the result.\n"
    )
    yield f"| kind | {' | '.join(f'`{name}`' for name in JOBS)} |"
    yield "|---|" + "---|" * len(JOBS)
    for kind in KINDS:
        actions = [policy.action(kind) for policy in JOBS.values()]
        if any(actions):
            yield f"| `{kind}` | {' | '.join(actions)} |"


if __name__ == "__main__":
    print(reference(), end="")
