# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""JSON of results and files; only this module writes it. JSON has neither NaN nor infinity.

A leaf.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any


def json_text(
    value: object,
    number: Callable[[float], object] = float,
    indent: int | None = None,
    separators: tuple[str, str] | None = None,
) -> str:
    """Return a value as JSON; a number that is not finite becomes null.

    :param value: plain types, arrays, paths, and containers of them; keys become strings.
    :param number: shortens finite numbers.
    :param indent: spaces before the entries of a level; None: all in one line.
    :param separators: between entries, and behind keys; None: those of ``json.dumps``.
    :raises TypeError: for anything else.
    """
    import json  # most runs print none

    return json.dumps(
        plain_types(value, number), allow_nan=False, indent=indent, separators=separators
    )


def plain_types(value: object, number: Callable[[float], object] = float) -> Any:
    """Return a value in plain types; arguments as for :func:`json_text`."""
    if isinstance(value, str | bool | int) or value is None:
        return value
    if isinstance(value, float):
        return number(value) if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): plain_types(entry, number) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain_types(entry, number) for entry in value]
    if hasattr(value, "tolist"):
        return plain_types(value.tolist(), number)
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no JSON form")
