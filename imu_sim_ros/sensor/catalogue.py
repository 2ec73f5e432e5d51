# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors that come with the package: what the head of each file says of it."""

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

from imu_sim_ros.config import files

_GRADE: Final = re.compile(r"^# Grade: (?P<grade>.+?)\. Price class: (?P<price>.+)\.$")
_SOURCE: Final = re.compile(r"^# (?P<source>\[\d\] .+)$")


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
    """First line of each source, with its number in the file."""


def catalogue() -> Iterator[CatalogueEntry]:
    """Return all sensors that come with the package, by name."""
    for name in files.names("imus"):
        lines = files.find("imus", name).read_text(encoding="utf-8").splitlines()
        head = [line for line in lines if line.startswith("#")]
        grade = next((m for m in map(_GRADE.match, head) if m), None)
        sources = tuple(m["source"] for m in map(_SOURCE.match, head) if m)
        title = head[0].lstrip("# ").rstrip(".") if head else ""
        yield CatalogueEntry(
            name, title, grade["grade"] if grade else "", grade["price"] if grade else "", sources
        )


def table() -> str:
    """Return the sensors as text, two lines each: name, grade, price class; title and sources."""
    lines = []
    for entry in catalogue():
        lines.append(f"{entry.name:12} {entry.grade}; {entry.price}")
        lines += [f"{'':12} {line}" for line in (entry.title, *entry.sources)]
    return "\n".join(lines)
