# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers as decimal text, whole tables at a time.

Python needs 0.5 us and more for each float. Here 17 significant digits, which tell every float64
from its neighbours, are computed for all numbers of a table at once: the number times a power of
ten in double-double arithmetic (T. J. Dekker 1971), rounded to an integer of 17 digits. Where 15
digits say the same, 15 are written. Unused places are zero bytes, and are dropped at the end.
"""

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Bytes = NDArray[np.uint8]

_DIGITS: Final = 17
_LARGEST_EXPONENT: Final = 280  # beyond, the products leave the range of float64
_EXACT_POWER: Final = 22  # 10^22 is the largest power of ten that a float64 holds exactly
_PREFIXED: Final = 4  # down to 10^-4 written as 0.0001, below as 1e-5
_POINTS: Final = 5  # up to 10^4 written as 12345.6, above as 1.23456e5
_SPLITTER: Final = 134217729.0  # 2^27 + 1 halves the digits of a float64
_ZERO: Final = ord("0")


def table(columns: Sequence[Bytes], separator: str = ",") -> bytes:
    """Return the lines of a table whose cells are rows (n, width) of bytes."""
    count = len(columns[0])
    parts: list[Bytes] = []
    for k, cells in enumerate(columns):
        mark = "\n" if k == len(columns) - 1 else separator
        parts += [cells, np.full((count, 1), ord(mark), np.uint8)]
    text = np.concatenate(parts, axis=1).reshape(-1)
    written: bytes = text[text != 0].tobytes()
    return written


def integers(values: Integers) -> Bytes:
    """Return non-negative integers as text (n, 19), without leading zeros."""
    text = padded(values, 19)
    significant = np.logical_or.accumulate(text != _ZERO, axis=1)
    significant[:, -1] = True
    text[~significant] = 0
    return text


def padded(values: Integers, width: int) -> Bytes:
    """Return non-negative integers as text (n, width) with leading zeros."""
    groups = -(-width // 4)
    text = np.empty((len(values), groups, 4), np.uint8)
    quads = _quads()
    rest = values
    for k in reversed(range(groups)):
        rest, group = np.divmod(rest, 10_000)
        text[:, k] = quads[group]
    return text.reshape(len(values), -1)[:, groups * 4 - width :]


def floats(values: Array) -> list[Bytes]:
    """Return the columns of a table (n, m) as text that reads back as the same float64."""
    x = np.asarray(values, dtype=np.float64)
    flat = np.ascontiguousarray(x.T).reshape(-1)
    text = _floats(flat)
    return list(text.reshape(x.shape[1], x.shape[0], -1))


def _floats(x: Array) -> Bytes:
    size = np.abs(x)
    ordinary = np.isfinite(x) & ((size == 0) | ((size > 1e-270) & (size < 1e270)))
    digits, exponent = _significant(np.where(ordinary & (size > 0), size, 1.0))
    digits = np.where(size == 0, 0, digits)
    prefixes, points, exponents = _marks()
    place = exponent + _LARGEST_EXPONENT
    mantissa = padded(digits, _DIGITS)
    _drop_trailing_zeros(mantissa, digits, exponent)
    parts = [
        np.where(np.signbit(x), np.uint8(ord("-")), np.uint8(0))[:, None],
        prefixes[place],
    ]
    for k in range(_POINTS):
        parts += [mantissa[:, k : k + 1], points[place, k : k + 1]]
    parts += [mantissa[:, _POINTS:], exponents[place]]
    text = np.concatenate(parts, axis=1)
    for k in np.flatnonzero(~ordinary).tolist():
        text[k] = 0
        words = repr(float(x[k])).encode()
        text[k, : len(words)] = np.frombuffer(words, np.uint8)
    return text


def _significant(x: Array) -> tuple[Integers, Integers]:
    """Return 17 digits as an integer, and the exponent of the first one, of numbers above 0."""
    high, low = _powers()
    exponent = np.floor(np.log10(x)).astype(np.int64)
    # The logarithm may be off by a rounding next to a power of ten.
    exponent += x >= high[_LARGEST_EXPONENT + 20 + exponent + 1]
    exponent -= x < high[_LARGEST_EXPONENT + 20 + exponent]
    power = _LARGEST_EXPONENT + 20 + _DIGITS - 1 - exponent
    product = x * high[power]
    error = _product_error(x, high[power], product) + x * low[power]
    digits = product.astype(np.int64) + np.rint(error).astype(np.int64)
    over = digits >= 10**_DIGITS
    digits = np.where(over, (digits + 5) // 10, digits)
    exponent = exponent + over
    short = (digits + 50) // 100
    # 15 digits and a power up to 10^22 are exact, and so is what IEEE makes of them.
    shift = _DIGITS - 3 - exponent
    scale = high[_LARGEST_EXPONENT + 20 + np.abs(shift)]
    value = np.where(shift >= 0, short / scale, short * scale)
    equal = (np.abs(shift) <= _EXACT_POWER) & (value == x)
    return np.where(equal, short * 100, digits), exponent


def _product_error(a: Array, b: Array, product: Array) -> Array:
    """Return what rounding took from ``product = a * b`` (Dekker 1971)."""
    a_high, a_low = _halves(a)
    b_high, b_low = _halves(b)
    result: Array = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
    return result


def _halves(a: Array) -> tuple[Array, Array]:
    spread = _SPLITTER * a
    high = spread - (spread - a)
    return high, a - high


def _drop_trailing_zeros(mantissa: Bytes, digits: Integers, exponent: Integers) -> None:
    """Drop zeros after the last digit that counts, but none before the decimal point."""
    rows = np.flatnonzero(digits % 10 == 0)
    if not len(rows):
        return
    part = mantissa[rows]
    kept = np.logical_or.accumulate((part != _ZERO)[:, ::-1], axis=1)[:, ::-1]
    whole = np.where(exponent[rows] < _POINTS, np.maximum(exponent[rows], 0), 0)
    # One digit stays after a point as well: 1.0, not 1.
    pointed = (exponent[rows] >= 0) | (exponent[rows] < -_PREFIXED)
    kept |= np.arange(_DIGITS) <= np.where(pointed, whole + 1, 0)[:, None]
    part[~kept] = 0
    mantissa[rows] = part


@cache
def _quads() -> Bytes:
    """Return the texts 0000 to 9999."""
    return np.frombuffer("".join(f"{k:04d}" for k in range(10_000)).encode(), np.uint8).reshape(
        -1, 4
    )


@cache
def _powers() -> tuple[Array, Array]:
    """Return powers of ten from 10^-300 on, each as the sum of two float64."""
    largest = _LARGEST_EXPONENT + 20
    exact = [Fraction(10) ** k for k in range(-largest, largest + 1)]
    high = [float(power) for power in exact]
    low = [float(power - Fraction(h)) for power, h in zip(exact, high, strict=True)]
    return np.array(high), np.array(low)


@cache
def _marks() -> tuple[Bytes, Bytes, Bytes]:
    """Return by exponent: what stands before the digits, the point after each, and the end."""
    count = 2 * _LARGEST_EXPONENT + 1
    prefixes = np.zeros((count, _PREFIXED + 1), np.uint8)
    points = np.zeros((count, _POINTS), np.uint8)
    ends = np.zeros((count, 5), np.uint8)
    for row, exponent in enumerate(range(-_LARGEST_EXPONENT, _LARGEST_EXPONENT + 1)):
        if -_PREFIXED <= exponent < 0:
            words = b"0." + b"0" * (-exponent - 1)
            prefixes[row, : len(words)] = list(words)
            continue
        plain = 0 <= exponent < _POINTS
        points[row, exponent if plain else 0] = ord(".")
        if not plain:
            words = f"e{exponent}".encode()
            ends[row, : len(words)] = list(words)
    return prefixes, points, ends


def decimal(value: float) -> str:
    """Return a number as YAML 1.1 takes it for one: 5e-05 is a text there, 5.0e-05 is not."""
    words = f"{value:.12g}"
    mantissa, e, exponent = words.partition("e")
    return words if "." in mantissa or not e else f"{mantissa}.0e{exponent}"
