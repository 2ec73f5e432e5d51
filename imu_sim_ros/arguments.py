# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of what a caller of the Python interface gives: name, value, and what is allowed."""

import math
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.errors import ArgumentTypeError, ConfigurationError

_LONGEST = 60


def refuse(name: str, value: object, allowed: str, wrong_type: bool = False) -> NoReturn:
    """Raise for an argument.

    :param allowed: what it must be.
    :raises ConfigurationError: always; an ArgumentTypeError for a wrong type.
    """
    words = " ".join(repr(value).split())
    shown = words if len(words) <= _LONGEST else f"{words[: _LONGEST - 3]}..."
    kind = ArgumentTypeError if wrong_type else ConfigurationError
    raise kind(f"{name} = {shown}: must be {allowed}")


def number(
    name: str, value: Any, allowed: str, low: float = -math.inf, above: bool = False
) -> float:
    """Return a finite number of at least ``low``, or above it.

    :raises ConfigurationError: for another value.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        refuse(name, value, allowed, wrong_type=True)
    if not (math.isfinite(value) and (value > low if above else value >= low)):
        refuse(name, value, allowed)
    return float(value)


def whole(name: str, value: Any, allowed: str, low: int, high: int) -> int:
    """Return an integer in a range.

    :raises ConfigurationError: for another value.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        refuse(name, value, allowed, wrong_type=True)
    if not low <= value <= high:
        refuse(name, value, allowed)
    return int(value)


def array(name: str, value: Any, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return finite numbers of a shape; None stands for any length.

    :raises ConfigurationError: for anything else.
    """
    words = ", ".join("n" if length is None else str(length) for length in shape)
    allowed = f"finite numbers of the shape ({words}{',' if len(shape) == 1 else ''})"
    try:
        found = np.asarray(value)
    except (ValueError, TypeError):
        refuse(name, value, allowed, wrong_type=True)
    if found.dtype.kind not in "iuf":
        refuse(name, value, allowed, wrong_type=True)
    fits = found.ndim == len(shape) and all(
        want in (None, have) for want, have in zip(shape, found.shape, strict=True)
    )
    if not fits:
        refuse(name, value, f"{allowed}, not {found.shape}")
    result: NDArray[np.float64] = found.astype(np.float64)
    if not np.isfinite(result).all():
        refuse(name, value, allowed)
    return result


def stamps(name: str, value: Any, increasing: bool = False) -> NDArray[np.int64]:
    """Return stamps [ns], (n,) integers.

    :param increasing: they must increase strictly.
    :raises ConfigurationError: for anything else.
    """
    allowed = "whole nanoseconds, an array of integers (n,)"
    try:
        found = np.asarray(value)
    except (ValueError, TypeError):
        refuse(name, value, allowed, wrong_type=True)
    if found.dtype.kind not in "iu":
        refuse(name, value, allowed, wrong_type=True)
    if found.ndim != 1:
        refuse(name, value, allowed)
    if increasing and (found[1:] <= found[:-1]).any():
        refuse(name, value, "strictly increasing")
    return found.astype(np.int64)
