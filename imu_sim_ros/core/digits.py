# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers with their uncertainty: two digits of it, and the value to the same place.

Programs, pages and pictures round with these functions; ``reports/assets/base.js`` has
:func:`interval_texts` for what a page computes itself.
"""

import math
from collections.abc import Sequence
from decimal import ROUND_CEILING, ROUND_HALF_UP, Context, Decimal
from typing import Final

_EXACT: Final = Context(prec=800)
"""More digits than any float has."""
_PLAIN: Final = range(-4, 6)
"""Exponents of numbers without a power of ten: 0.00012 to 123456."""
_ROUNDING: Final = 1e-9
"""Width of an interval, relative, that arithmetic alone can cause: the numbers are exact."""
_FINER: Final = 10
"""Largest number of places beyond two digits of the uncertainty."""


def interval_texts(value: float, low: float, high: float) -> tuple[str, str, str]:
    """Return a value and the ends of its interval with two digits of half the interval's width.

    All have the same last place, which is finer if an end that differs would look like the value.
    """
    half = 0.5 * (high - low)
    numbers = (value, low, high)
    largest = max(map(abs, numbers))
    if not (half > _ROUNDING * largest and math.isfinite(largest)):
        return f"{value:.4g}", f"{low:.4g}", f"{high:.4g}"
    place = _place(half)
    texts = _texts(numbers, place)
    for finer in range(place + 1, place + _FINER):
        middle, bottom, top = texts
        if (low == value or bottom != middle) and (high == value or top != middle):
            break
        texts = _texts(numbers, finer)
    middle, bottom, top = texts
    return middle, bottom, top


def deviation_texts(sigma: float, *values: float) -> list[str]:
    """Return a standard deviation with two digits, and values to the same place.

    A deviation of 0 stands for exact numbers: it is empty, and values have six digits.
    """
    if not (sigma > 0.0 and math.isfinite(max(map(abs, (sigma, *values))))):
        return ["", *(f"{value:.6g}" for value in values)]
    return _texts((sigma, *values), _place(sigma))


def plus_minus(value: float, half: float) -> str:
    """Return a value with its uncertainty: ``1.234 ± 0.056``, or ``(1.234 ± 0.056)e-05``.

    :param half: half the width of an interval, or a multiple of a standard deviation.
    """
    if not (half > 0.0 and math.isfinite(max(abs(value), half))):
        return f"{value:.4g}"
    place = _place(half)
    exponent = _exponent((value, half), place)
    texts = [_to_fixed(number, place, exponent) for number in (value, half)]
    text = " \N{PLUS-MINUS SIGN} ".join(texts)
    return f"({text})e{exponent:+03d}" if exponent else text


def upper_bound(high: float) -> str:
    """Return ``< HIGH`` with two digits, rounded up: it stays a bound."""
    if not (high > 0.0 and math.isfinite(high)):
        return f"< {high:g}"
    number = Decimal(f"{high:.12g}")  # 0.0012 stays 0.0012
    bound = float(number.quantize(Decimal(1).scaleb(number.adjusted() - 1), ROUND_CEILING, _EXACT))
    return f"< {_texts((bound,), _place(bound))[0]}"


def _place(uncertainty: float) -> int:
    """Return the decimal place of the second digit of an uncertainty: 2 for 0.056."""
    number = Decimal(uncertainty)
    rounded = number.quantize(Decimal(1).scaleb(number.adjusted() - 1), ROUND_HALF_UP, _EXACT)
    return 1 - rounded.adjusted()


def _texts(numbers: Sequence[float], place: int) -> list[str]:
    """Return numbers rounded to a decimal place, all with the same power of ten."""
    exponent = _exponent(numbers, place)
    power = f"e{exponent:+03d}" if exponent else ""
    return [
        _to_fixed(number, place, exponent) + power if number != 0.0 else "0" for number in numbers
    ]


def _exponent(numbers: Sequence[float], place: int) -> int:
    """Return the power of ten of the largest number; 0 where plain numbers are short."""
    largest = Decimal(max(map(abs, numbers)))
    rounded = largest.quantize(Decimal(1).scaleb(-place), ROUND_HALF_UP, _EXACT)
    exponent = (rounded or largest).adjusted()
    return 0 if exponent in _PLAIN else exponent


def _to_fixed(number: float, place: int, exponent: int) -> str:
    """Return the digits of a number without its power of ten, as JavaScript's toFixed rounds."""
    mantissa = Decimal(number / float(f"1e{exponent}"))
    unit = Decimal(1).scaleb(-(place + exponent))
    rounded = mantissa.quantize(unit, ROUND_HALF_UP, _EXACT)
    return f"{rounded if rounded else abs(rounded):f}"  # no -0.00
