# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors that come with the package, and the sensors that can be named."""

import re
from collections.abc import Iterator
from itertools import takewhile
from typing import Final, NamedTuple

from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.sensors import all_sensors

_GRADE: Final = re.compile(r"^# Grade: (?P<grade>.+?)\. Price class: (?P<price>.+)\.$")
_SOURCE: Final = re.compile(r"^# (?P<source>\[\d\] .+)$")

_INDENT: Final = "#     "
_LONG: Final = 90
"""Letters from which a description ends at its first colon."""


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


def sensor_lines() -> list[str]:
    """Return the sensors that can be named, a line each; those of other packages too.

    What cannot be loaded has its reason.
    """
    found, problems = all_sensors()
    return [f"{sensor.name}: {sensor.text or 'no description'}" for sensor in found] + problems


def sensor_table() -> str:
    """Return the sensors as text: topics, then parameters with default and unit."""
    found, problems = all_sensors()
    lines = []
    for sensor in found:
        lines.append(f"{sensor.name:12} {sensor.text}")
        lines += [f"{'':12} {topic.name} ({topic.type})" for topic in sensor.topics]
        for name, known in parameters(sensor.section).items():
            unit = f" [{known.unit}]" if known.unit else ""
            words = f"{sensor.name}.{name} ({known.default}{unit}): {known.text}"
            lines.append(f"{'':12} {words}")
    return "\n".join([*lines, *problems]) or "no sensor is installed"


def table() -> str:
    """Return the sensors as text, a line each: name, grade, price class, title."""
    entries = list(catalogue())
    wide = [max(len(entry[k]) for entry in entries) for k in (0, 2, 3)]
    return "\n".join(
        f"{entry.name:{wide[0]}}  {_short(entry.grade):10}  {entry.price:{wide[2]}}  "
        f"{_short(entry.title)}"
        for entry in entries
    )


def descriptions(folder: str) -> dict[str, str]:
    """Return the first sentence of each file's header, by name.

    :param folder: one of config/: trajectories, cameras, scenes, barometers.
    """
    found = {}
    for name in files.names(folder):
        lines = files.find(folder, name).read_text(encoding="utf-8").splitlines()
        head = list(takewhile(lambda line: line.startswith("#"), lines))
        words = " ".join(line.lstrip("# ") for line in head if not line.startswith("# ["))
        sentence = re.split(r"\.(?= |$)", re.sub(r" \([^)]*\)", "", words), maxsplit=1)[0]
        found[name] = sentence if len(sentence) <= _LONG else re.split("[:;] ", sentence)[0]
    return found


def listing(folder: str) -> str:
    """Return the files of a folder of config/ as text, a line each: name and description."""
    found = descriptions(folder)
    width = max(map(len, found))
    return "\n".join(f"{name:{width}}  {text}" for name, text in found.items())


def _short(words: str) -> str:
    """Return words without what stands in brackets behind them."""
    return words.partition(" (")[0]
