# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of arguments of the Python interface: name, value, and what is allowed."""

import functools
import math
import os
import sys
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Final, NoReturn, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core.errors import ArgumentTypeError, ConfigurationError
from imu_sim_ros.core.names import printable_text, short_repr, suggestion
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import AnyArray, Array, Integers

_P = ParamSpec("_P")
_R = TypeVar("_R")
BAG_OR_FILE: Final = "the path of a bag, a folder or a file"
_LONGEST_PATH: Final = 4095
"""Longest path in Linux [bytes]."""
_LONGEST_NAME: Final = 255
"""Longest name of a file in Linux; the longest path is above [bytes]."""


def refuse(name: str, value: object, allowed: str, wrong_type: bool = False) -> NoReturn:
    """Raise for an argument.

    :param allowed: description of allowed values.
    :raises ConfigurationError: always; an ArgumentTypeError for a wrong type.
    """
    kind = ArgumentTypeError if wrong_type else ConfigurationError
    raise kind(f"{argument_prefix(name, short_repr(value))}: must be {allowed}")


def suggest_keywords(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return a function that names the nearest of its arguments for an unknown keyword.

    :param function: function without a ``**`` argument.
    """
    code = function.__code__
    parameters = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]

    @functools.wraps(function)
    def checked(*args: _P.args, **keywords: _P.kwargs) -> _R:
        wrong = [name for name in keywords if name not in parameters]
        if wrong:
            raise ArgumentTypeError(
                [f"{name}: unknown argument; {suggestion(name, parameters)}" for name in wrong]
            )
        return function(*args, **keywords)

    return checked


def path(name: str, value: object, allowed: str = "the path of a file") -> Path:
    """Return a path that a system can have.

    :raises ConfigurationError: for anything else.
    """
    if not isinstance(value, str | os.PathLike) or isinstance(os.fspath(value), bytes):
        refuse(name, value, allowed, wrong_type=True)
    encoded = os.fsencode(value)
    longest = max(map(len, encoded.split(b"/")))
    if not encoded or b"\0" in encoded or longest > _LONGEST_NAME or len(encoded) > _LONGEST_PATH:
        refuse(name, value, allowed)
    return Path(value)


def text(name: str, value: object, allowed: str, empty: bool = False) -> str:
    """Return a string that is not empty.

    :param empty: True: the string may be empty.
    :raises ConfigurationError: for anything else.
    """
    if not isinstance(value, str):
        refuse(name, value, allowed, wrong_type=True)
    if not (value or empty) or "\0" in value or len(value) > _LONGEST_NAME:
        refuse(name, value, allowed)
    return value


def choice(name: str, value: object, choices: Collection[str]) -> str:
    """Return a word that is one of the choices.

    :raises ConfigurationError: for anything else, with the nearest right one.
    """
    if not isinstance(value, str):
        refuse(name, value, f"one of {', '.join(choices)}", wrong_type=True)
    if value not in choices:
        raise ConfigurationError(
            f"{argument_prefix(name, short_repr(value))}: {suggestion(value, choices)}"
        )
    return value


def string_list(name: str, value: object) -> tuple[str, ...]:
    """Return a list of strings, from a list or a single string.

    :raises ConfigurationError: for anything else.
    """
    texts = (value,) if isinstance(value, str) else value
    if not isinstance(texts, Collection) or isinstance(texts, bytes | Mapping | np.ndarray):
        refuse(name, value, "names", wrong_type=True)
    return tuple(text(name, word, "names") for word in texts)


def topic(name: str, value: object, of_a_file: bool = True) -> str | None:
    """Return the topic of a bag, or None.

    :param of_a_file: True if the topics are those of a file.
    :raises ConfigurationError: for anything else.
    """
    if value is None:
        return None
    topic_name = text(name, value, "the name of a topic, or None")
    if not of_a_file:
        refuse(name, value, "omitted: only a file has topics")
    return topic_name


def boolean(name: str, value: object) -> bool:
    """Return True or False.

    :raises ConfigurationError: for anything else.
    """
    if not isinstance(value, bool | np.bool_):
        refuse(name, value, "True or False", wrong_type=True)
    return bool(value)


def number(
    name: str,
    value: object,
    allowed: str,
    low: float = -math.inf,
    high: float = sys.float_info.max,
    exclusive: bool = False,
) -> float:
    """Return a finite number from ``low`` to ``high``.

    :param exclusive: True: the number must be above ``low``, not equal to it.
    :raises ConfigurationError: for another value.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        refuse(name, value, allowed, wrong_type=True)
    if not ((value > low if exclusive else value >= low) and value <= high):
        refuse(name, value, allowed)
    return float(value)


def integer(name: str, value: object, allowed: str, low: int, high: int) -> int:
    """Return an integer in a range.

    :raises ConfigurationError: for another value.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        refuse(name, value, allowed, wrong_type=True)
    if not low <= value <= high:
        refuse(name, value, allowed)
    return int(value)


LARGEST_BLOCK: Final = 1 << 24
"""Samples; 6 GB of an IMU's."""


def block_size(name: str, value: object) -> int:
    """Return how many samples, or frames, a block has.

    :raises ConfigurationError: for anything but an integer from 1 to ``LARGEST_BLOCK``.
    """
    return integer(name, value, f"an integer from 1 to {LARGEST_BLOCK}", 1, LARGEST_BLOCK)


def array(name: str, value: object, shape: tuple[int | None, ...], finite: bool = True) -> Array:
    """Return finite numbers of a shape, in which None allows any length.

    :param finite: False if a gate finds values that are not finite later.
    :raises ConfigurationError: for anything else.
    """
    values = value if type(value) is np.ndarray else _plain(name, value, _allowed_shapes(shape))
    if values.dtype is not _FLOAT64:
        if values.dtype.kind not in "iuf":
            refuse(name, value, _allowed_shapes(shape), wrong_type=True)
        values = values.astype(np.float64, copy=False)
    have = values.shape
    if have != shape and not (
        len(have) == len(shape)
        and all(expected in (None, length) for expected, length in zip(shape, have, strict=True))
    ):
        refuse(name, value, f"{_allowed_shapes(shape)}, not {have}")
    result: Array = values
    if finite and not np.isfinite(result).all():
        refuse(name, value, _allowed_shapes(shape))
    return result


def vectors(name: str, value: ArrayLike, length: int) -> Array:
    """Return vectors (n, length) of any numbers; one (length,) is a row.

    :raises ConfigurationError: for anything else.
    """
    several = (None, length)
    rows = value if type(value) is np.ndarray else _plain(name, value, _allowed_shapes(several))
    if rows.ndim == 1:
        return array(name, rows if rows.shape == (length,) else value, (length,), False)[None]
    return array(name, value, several, finite=False)


def float_triple(value: object) -> tuple[float, float, float] | None:
    """Return three numbers that are an array (3,), a list or a tuple of floats; else None."""
    if isinstance(value, np.ndarray):
        value = value.tolist() if value.dtype == _FLOAT64 and value.shape == (3,) else ()
    if isinstance(value, list | tuple) and len(value) == 3:
        x, y, z = value
        if type(x) is type(y) is type(z) is float:
            return x, y, z
    return None


_FLOAT64: Final = np.dtype(np.float64)


def _allowed_shapes(shape: tuple[int | None, ...]) -> str:
    """Return which arrays of a shape are allowed, as text."""
    sizes = ", ".join("n" if length is None else str(length) for length in shape)
    return f"finite numbers of the shape ({sizes}{',' if len(shape) == 1 else ''})"


def _plain(name: str, value: object, allowed: str) -> AnyArray:
    """Return an array or array-like as a plain array; masked values are missing, and refused."""
    if type(value) is np.ndarray:  # for it alone, NumPy's masked arrays need not be loaded
        return value
    if isinstance(value, np.ma.MaskedArray) and (masked := np.count_nonzero(value.mask)):
        raise ConfigurationError(
            f"{argument_prefix(name)}: {masked} of {value.size} values are masked: leave these "
            "rows out"
        )
    try:
        if hasattr(value, "__dlpack__") and not hasattr(value, "__array__"):
            return np.from_dlpack(value)
        return np.asarray(value)
    except (ValueError, TypeError):
        refuse(name, value, allowed, wrong_type=True)
    except (RuntimeError, BufferError) as error:  # on a device, or with a gradient
        raise ArgumentTypeError(
            f"{argument_prefix(name)}: cannot be taken as a NumPy array: {error}"
        ) from None


def stamps(name: str, value: object) -> Integers:
    """Return stamps [ns], (n,) integers.

    :raises ConfigurationError: for anything else.
    """
    allowed = "whole nanoseconds, an array of integers (n,)"
    t_ns = _plain(name, value, allowed)
    if t_ns.dtype.kind not in "iu":
        refuse(name, value, allowed, wrong_type=True)
    if t_ns.ndim != 1:
        refuse(name, value, allowed)
    if t_ns.dtype.kind == "u" and (t_ns > np.iinfo(np.int64).max).any():
        refuse(name, value, allowed)
    return t_ns.astype(np.int64, copy=False)


def name_of(path: Path) -> str:
    """Return the name of a file or folder for titles, that of ``.`` too."""
    return printable_text(path.name or path.resolve().name or str(path))
