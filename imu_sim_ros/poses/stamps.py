# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of text as exact nanoseconds: a float of 1.6e9 s is only good to 240 ns."""

from decimal import Decimal, InvalidOperation
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.timebase import NANOSECONDS_PER_SECOND

STAMP_BYTES: Final = 48
"""A stamp of text is shorter."""
_LAST_SECOND: Final = 9_223_372_035  # what int64 nanoseconds hold
_SECOND_DIGITS: Final = 10
_FRACTION_DIGITS: Final = 9
_WHOLE_DIGITS: Final = 18  # of nanoseconds; one more may not fit
_ZERO, _POINT = ord("0"), ord(".")


def nanoseconds(stamps: NDArray[np.bytes_], whole: bool) -> NDArray[np.int64]:
    """Return stamps (n,) of text in nanoseconds.

    :param stamps: (n,) of ``S48``.
    :param whole: they are whole nanoseconds; else seconds.
    :raises ValueError, OverflowError: for a stamp that is not a number, or does not fit.
    """
    letters = np.ascontiguousarray(stamps).view(np.uint8).reshape(len(stamps), -1)
    letters = letters[:, : int(np.char.str_len(stamps).max(initial=1))]
    digit = (letters >= _ZERO) & (letters <= _ZERO + 9)
    point = letters == _POINT
    fraction = digit & (np.cumsum(point, axis=1) > 0)
    digits, decimals = digit.sum(axis=1), fraction.sum(axis=1)
    # Plain: digits, at most one point among them, and nothing else.
    plain = (digit | point | (letters == 0)).all(axis=1) & (point.sum(axis=1) <= 1)
    if whole:
        plain &= (digits > 0) & (digits <= _WHOLE_DIGITS) & ~point.any(axis=1)
    else:
        plain &= (digits > decimals) & (digits - decimals <= _SECOND_DIGITS)
        plain &= decimals <= _FRACTION_DIGITS
    result = _joined_digits(letters, digit)
    if not whole:
        seconds = result // 10**decimals
        if np.any(plain & (seconds > _LAST_SECOND)):
            raise OverflowError(f"a stamp above {_LAST_SECOND} s")
        result *= 10 ** (_FRACTION_DIGITS - np.minimum(decimals, _FRACTION_DIGITS))
    for k in np.flatnonzero(~plain):
        result[k] = nanosecond(stamps[k].decode("latin-1"), whole)
    return result


def nanosecond(stamp: str, whole: bool) -> int:
    """Return one stamp in nanoseconds; it may have an exponent, or many digits.

    :raises ValueError, OverflowError: for a stamp that is not a number, or does not fit.
    """
    if len(stamp) >= STAMP_BYTES or "_" in stamp or not stamp.isascii():
        raise ValueError(stamp)  # Python's own 1_000 and digits of other scripts are none here
    if whole:
        result = int(stamp)
    else:
        try:
            seconds = Decimal(stamp)
        except InvalidOperation:
            raise ValueError(stamp) from None
        if seconds.adjusted() >= _SECOND_DIGITS:  # 1e999999999 would fill the memory
            raise OverflowError(stamp)
        result = round(seconds * NANOSECONDS_PER_SECOND)
    if abs(result) > _LAST_SECOND * NANOSECONDS_PER_SECOND:
        raise OverflowError(stamp)
    return result


def _joined_digits(letters: NDArray[np.uint8], digit: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the digits of each row (n, letters) as one number (n,); too many wrap around."""
    result = np.zeros(len(letters), dtype=np.int64)
    for column in range(letters.shape[1]):
        here = digit[:, column]
        value = letters[:, column].astype(np.int64) - _ZERO
        result = np.where(here, result * 10 + value, result)
    return result
