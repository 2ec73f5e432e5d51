# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages on a name that does not exist: the nearest one that does, or all of them."""

import re
from collections.abc import Iterable
from typing import Final

_LONGEST: Final = 100
"""Letters of a name that are compared."""
_SHOWN: Final = 60
"""Letters of a value."""
_MAX_LISTED: Final = 8
"""So many names are listed with the nearest one."""
_LETTERS_LISTED: Final = 400
"""A line that lists names has about so many letters of them at the most."""


def printable_text(text: str) -> str:
    """Return a text that every file can hold: names of files and arguments need not be UTF-8.

    A byte of such a name, which Python has as a surrogate, is shown by its number.
    """
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def ros_name(name: str) -> str:
    """Return a name of a segment as ROS accepts it: letters, digits and underscores."""
    plain = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_") or "segment"
    return plain if plain[0].isalpha() else f"segment_{plain}"


def suggestion(name: object, candidates: Iterable[str], otherwise: str | None = None) -> str:
    """Return the end of a line about a name that does not exist: ``did you mean mpu6000?``.

    :param candidates: the names that exist.
    :param otherwise: said if none of them is near; None: ``must be one of`` all of them.
    """
    candidates = list(candidates)
    nearest_name = nearest(name, candidates)
    fallback = f"must be one of {_list_names(candidates)}" if otherwise is None else otherwise
    if nearest_name is None:
        return fallback
    hint = f"did you mean {nearest_name}?"
    return f"{fallback}; {hint}" if otherwise is None and len(candidates) <= _MAX_LISTED else hint


def _list_names(names: list[str]) -> str:
    """Return the names, the first ones and how many more there are if they do not fit in a line."""
    count = "".join(f"{name}, " for name in names)[:_LETTERS_LISTED].count(", ")
    remainder = f" and {len(names) - count} more" if count < len(names) else ""
    return ", ".join(names[:count]) + remainder


def nearest(name: object, candidates: Iterable[str], similarity: float = 0.6) -> str | None:
    """Return the name most like another one; None: none is.

    :param similarity: least similarity of alike names, 0 to 1 (``difflib.SequenceMatcher.ratio``).
    """
    import difflib  # only a name that does not exist needs it

    lower = {candidate.lower(): candidate for candidate in reversed(list(candidates))}
    matches = difflib.get_close_matches(str(name)[:_LONGEST].lower(), lower, n=1, cutoff=similarity)
    return lower[matches[0]] if matches else None


def short_repr(value: object) -> str:
    """Return a value as messages show it: one line, cut if it is long."""
    text = " ".join(repr(value).split())
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."


def unknown_name_line(
    kind: str, name: object, candidates: Iterable[str], otherwise: str | None = None
) -> str:
    """Return a line on a name: ``unknown IMU 'mpu600'; did you mean mpu6000?``.

    :param kind: what the name should be, as people call it.
    """
    text = str(name)
    shown = text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."
    return f"unknown {kind} {shown!r}; {suggestion(name, candidates, otherwise)}".removesuffix("; ")
