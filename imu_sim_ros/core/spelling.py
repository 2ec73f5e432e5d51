# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments in lines for a user, as this user writes them.

A job is called from Python, from a program and from a node. The checks of a job know an argument by
its name; a line names it as a keyword (``max_gap=0.5``), as an option (``--max-gap 0.5s``) or as a
parameter (``max_gap``), as the door that called the job asks for.
"""

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final, Literal

Door = Literal["python", "program", "node"]


@dataclass(frozen=True)
class _Spelling:
    """The way in which a door's users write arguments."""

    door: Door = "python"
    options: Mapping[str, str] = field(default_factory=dict)
    """Options of the running program by the names of the job's arguments."""
    typed: Collection[str] = ()
    """Names of the arguments that are options on the present command line."""


_current: list[_Spelling] = [_Spelling()]
_PROGRAMS: Final = {"convert": "convert_bag"}
"""Programs with another name than the function of their job."""
_MENTION: Final = re.compile(r"\{(\w+)(?: ([^}]+))?\}")


@contextmanager
def use_spelling(
    door: Door, options: Mapping[str, str] | None = None, typed: Collection[str] = ()
) -> Iterator[None]:
    """Spell names of arguments as the users of a door type them: command, Python or node.

    :param options: options of the program by the names of the job's arguments.
    :param typed: names of the arguments whose values come from the command line.
    """
    _current.append(_Spelling(door, options or {}, typed))
    try:
        yield
    finally:
        _current.pop()


def argument(
    name: str, value: str | float | Mapping[str, str] | None = None, unit: str = ""
) -> str:
    """Return an argument that a line recommends.

    :param name: name of the job's argument.
    :param value: recommended value; None: the value is left to the user, True: a switch is set. A
        mapping has one entry, which a program takes as ``NAME=VALUE``.
    :param unit: unit that a program takes behind the number; Python and nodes take SI units.
    """
    spelling = _current[-1]
    number = f"{value:.6g}" if isinstance(value, float) else str(value)
    if isinstance(value, Mapping):
        number = ",".join(f"{key}={entry}" for key, entry in value.items())
    if spelling.door == "program":
        option = spelling.options.get(name, f"--{name.replace('_', '-')}")
        return option if value is None or value is True else f"{option} {number}{unit}"
    if value is None:
        return name if spelling.door == "node" else f"{name}=..."
    if spelling.door == "node":
        return f"{name}:={str(value).lower() if value is True else number}"
    return f"{name}={number}" if isinstance(value, float) else f"{name}={value!r}"


def job_argument(job: str, name: str) -> str:
    """Return a job with a switch that a line recommends.

    Python: ``convert(..., recover=True)``; elsewhere: ``convert_bag --recover``.

    :param job: name of the job's function.
    :param name: name of the switch.
    """
    if _current[-1].door == "python":
        return f"{job}(..., {name}=True)"
    return f"{_PROGRAMS.get(job, job)} --{name.replace('_', '-')}"


def argument_prefix(name: str, value: str = "") -> str:
    """Return an argument that a line is about, as the beginning of the line.

    :param name: name of the job's argument.
    :param value: value, shortened for a line; empty: the line is about the argument itself.
    """
    spelling = _current[-1]
    if name in spelling.typed:
        return f"{spelling.options[name]} {value}".rstrip()
    return f"{name} = {value}" if value else name


def spell_arguments(template: str) -> str:
    """Return a text in which ``{name}`` and ``{name value}`` are recommended arguments."""
    return _MENTION.sub(
        lambda mention: argument(mention[1], True if mention[2] == "true" else mention[2]), template
    )
