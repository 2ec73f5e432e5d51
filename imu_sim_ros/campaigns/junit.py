# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A campaign's judgement as JUnit XML, which continuous integration shows.

A test case is a requirement of a group, a comparison with the baseline, and the runs of a group,
with the reasons of failures as output. A case fails if it fails the gate; if no run is done, the
runs of every group are an error.
"""

import re
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from imu_sim_ros.campaigns.effects import WORSE
from imu_sim_ros.campaigns.results import write_atomically
from imu_sim_ros.campaigns.verdict import Judgement
from imu_sim_ros.core.errors import system_error

_FORBIDDEN: Final = re.compile("[^\\t\\n\\r\\x20-\\ud7ff\\ue000-\\ufffd\\U00010000-\\U0010ffff]")
"""Characters that XML 1.0 (section 2.2) excludes."""


def write_junit(path: Path, name: str, judgement: Judgement) -> None:
    """Write a judgement.

    :param name: name of the campaign.
    :raises ImuSimError: if the file cannot be written.
    """
    root = ElementTree.Element("testsuites", name=_text(name))
    suite = _Suite(root, "requirements")
    for check in judgement.requirements:
        case = suite.case(f"{check.requirement} ({check.cell}; {check.estimator})")
        if not check.met:
            suite.fail(case, "failure", f"{check.requirement}: {check.comment}")
    suite = _Suite(root, "baseline")
    for effect in judgement.baseline or []:
        case = suite.case(f"{judgement.metric} ({effect.a})")
        line = effect.line(judgement.metric)
        if effect.verdict == WORSE:
            suite.fail(case, "failure", line)
        elif effect.non_inferior is False:
            prefix = f"not proven to be less than {judgement.non_inferiority} worse"
            suite.fail(case, "failure", f"{prefix}: {line}")
        else:
            suite.output(case, f"{effect.verdict}: {line}")
    for line in (*judgement.unmatched, *judgement.unproven, *judgement.copies):
        suite.fail(suite.case(line), "failure", line)
    suite = _Suite(root, "runs")
    for standing in judgement.standings:
        cell, estimator = standing.cell, standing.estimator
        case = suite.case(f"{standing.done} of {standing.runs} done ({cell}; {estimator})")
        reasons = [
            f"{failure.runs} x {failure.reason} (seeds {', '.join(map(str, failure.seeds))})"
            for failure in judgement.failures
            if (failure.cell, failure.estimator) == (cell, estimator)
        ]
        if not judgement.done:
            suite.fail(case, "error", "no run is done")
        if reasons:
            suite.output(case, "\n".join(reasons))
    tree = ElementTree.ElementTree(root)
    ElementTree.indent(tree)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(path) as part:
            tree.write(part, encoding="utf-8", xml_declaration=True)
    except OSError as error:
        raise system_error(path, error) from None


class _Suite:
    """A test suite, and its counts."""

    def __init__(self, root: ElementTree.Element, name: str) -> None:
        self._name = name
        counts = dict.fromkeys(("tests", "failures", "errors"), "0")
        self._element = ElementTree.SubElement(root, "testsuite", {"name": name, **counts})

    def _count(self, name: str) -> None:
        """Increase a counter of the suite by one."""
        self._element.set(name, str(int(self._element.get(name, "0")) + 1))

    def case(self, name: str) -> ElementTree.Element:
        """Add a test case."""
        self._count("tests")
        classname = f"campaign.{self._name}"
        return ElementTree.SubElement(
            self._element, "testcase", classname=classname, name=_text(name)
        )

    def fail(self, case: ElementTree.Element, kind: str, message: str) -> None:
        """Make a case a ``failure`` or an ``error``."""
        self._count(f"{kind}s")
        ElementTree.SubElement(case, kind, message=_text(message))

    def output(self, case: ElementTree.Element, text: str) -> None:
        """Add the output of a case."""
        ElementTree.SubElement(case, "system-out").text = _text(text)


def _text(text: str) -> str:
    """Return a text without the characters that XML forbids."""
    return _FORBIDDEN.sub("?", text)
