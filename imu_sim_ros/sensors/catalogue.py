# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors that come with the package, as the header of each file describes them."""

import re
from collections.abc import Iterator
from textwrap import wrap
from typing import Final, NamedTuple

from imu_sim_ros.parameters import files

_GRADE: Final = re.compile(r"^# Grade: (?P<grade>.+?)\. Price class: (?P<price>.+)\.$")
_SOURCE: Final = re.compile(r"^# (?P<source>\[\d\] .+)$")

_INDENT: Final = "#     "
_WIDTH: Final = 100


class CatalogueEntry(NamedTuple):
    """One file in config/imus."""

    name: str
    """What ``--imu`` takes."""
    title: str
    """Maker, type and ranges."""
    grade: str
    """consumer, industrial, tactical, navigation, ..."""
    price: str
    """Order of magnitude of a unit's price."""
    sources: tuple[str, ...]
    """Each source, with its number in the file."""


def catalogue() -> Iterator[CatalogueEntry]:
    """Return all sensors that come with the package, by name."""
    for name in files.names("imus"):
        lines = files.find("imus", name).read_text(encoding="utf-8").splitlines()
        head = [line for line in lines if line.startswith("#")]
        grade = next((m for m in map(_GRADE.match, head) if m), None)
        title = head[0].lstrip("# ").rstrip(".") if head else ""
        yield CatalogueEntry(
            name,
            title,
            grade["grade"] if grade else "",
            grade["price"] if grade else "",
            tuple(_sources(head)),
        )


def _sources(head: list[str]) -> Iterator[str]:
    """Yield the sources in a file's header, each joined into one line."""
    words: list[str] = []
    for line in [*head, ""]:
        begin, goes_on = _SOURCE.match(line), line.startswith(_INDENT) and words
        if words and not goes_on:
            yield " ".join(words)
            words = []
        if begin or goes_on:
            words.append(begin["source"] if begin else line.removeprefix(_INDENT))


def table() -> str:
    """Return the sensors as text: name, grade, price class; then title and sources."""
    lines = []
    for entry in catalogue():
        lines.append(f"{entry.name:12} {entry.grade}; {entry.price}")
        for text in (entry.title, *entry.sources):
            later = " " * (17 if text.startswith("[") else 13)
            lines += wrap(
                text,
                _WIDTH,
                initial_indent=" " * 13,
                subsequent_indent=later,
                break_on_hyphens=False,
            )
    return "\n".join(lines)
