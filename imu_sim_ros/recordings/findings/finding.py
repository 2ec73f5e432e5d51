# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A finding about a recording, and the declaration of a check that makes findings."""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Final, Generic, Literal, NamedTuple, TypeVar

from imu_sim_ros.core.types import JsonObject

RecordT = TypeVar("RecordT")
Severity = Literal["error", "warning", "note"]
SEVERITIES: Final[tuple[Severity, ...]] = ("error", "warning", "note")
"""Worst first: results are wrong; results are worse than they could be; good to know."""


class Evidence(NamedTuple):
    """The numbers behind a finding, and their place."""

    text: str
    """The numbers in words."""
    row: int | None = None
    """Row of the record that shows it first; None: all of them do."""
    number: int | None = None
    """Number of rows that show it; None: all of them."""


@dataclass(frozen=True)
class Finding:
    """A fault of a recording, with its evidence, its effect and its remedy."""

    kind: str
    """Name of the check, for instance ``accelerometer_g``."""
    severity: Severity
    """error: results are wrong; warning: they are worse than they could be; note."""
    source: str
    """Name of the file, topic or sensor; empty: the line before names it."""
    evidence: str
    """The numbers that show it."""
    effect: str
    """Consequence for results."""
    remedy: str
    """Option, parameter or repair that helps."""
    row: int | None = None
    """Row that shows it first, from 0; None: all of them do."""
    number: int | None = None
    """Number of rows that show it; None: all of them."""
    t: float | None = None
    """Time of the row after the first stamp [s]."""
    line: int | None = None
    """Line of the row in its text file, from 1; None: the source is no text."""

    def place(self) -> str:
        """Return where the recording shows it first; empty: everywhere."""
        if self.row is None:
            return ""
        name = f"row {self.row}" if self.line is None else f"line {self.line}"
        return name if self.t is None else f"{name} ({self.t:.3f} s)"

    def statement(self) -> str:
        """Return source, place, evidence and kind as a line."""
        return f"{self._subject()}{self.evidence} [{self.kind}]"

    def sentence(self) -> str:
        """Return source, place, evidence, remedy and kind as a line."""
        return f"{self._subject()}{self.evidence}; {self.remedy} [{self.kind}]"

    def _subject(self) -> str:
        """Source and place, in front of the text."""
        place = f", from {self.place()} on" if self.row else ""
        return f"{self.source}{place}: " if self.source else ""

    def to_dict(self) -> JsonObject:
        """Return the fields by name."""
        return asdict(self)


@dataclass(frozen=True)
class FaultCheck(Generic[RecordT]):
    """A declaration of a fault that recordings can have, and the function that finds it."""

    kind: str
    """Name of the findings that it makes."""
    severity: Severity
    """Severity of these findings."""
    meaning: str
    """The fault in words, a row of the manual."""
    effect: str
    """Consequence for results."""
    remedy: str
    """Option, parameter or repair that helps; ``{name value}`` is an argument of the job."""
    find: Callable[[RecordT], Iterator[Evidence]]
    """Function that looks for it in a record."""


def check(
    severity: Severity, effect: str, remedy: str
) -> Callable[[Callable[[RecordT], Iterator[Evidence]]], FaultCheck[RecordT]]:
    """Return a decorator that declares a function as a check, named after the function.

    The first line of the docstring is its row in the manual.

    :param effect: consequence for results.
    :param remedy: option, parameter or repair that helps.
    """

    def declare(find: Callable[[RecordT], Iterator[Evidence]]) -> FaultCheck[RecordT]:
        text = (find.__doc__ or "").partition("\n")[0].removeprefix("Find ").rstrip(".")
        return FaultCheck(find.__name__, severity, text, effect, remedy, find)

    return declare
