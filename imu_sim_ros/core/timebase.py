# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Times as int64 nanoseconds: those of samples, and values interpolated to others.

The time of a sample is computed from its index, never by accumulation.
"""

import math
import re
from fractions import Fraction
from functools import lru_cache
from typing import Final

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.types import Array, Integers

NANOSECONDS_PER_SECOND: Final = 1_000_000_000
"""Nanoseconds per second."""
_RATE_DENOMINATOR: Final = 1_000_000
"""Largest denominator of a rate as a fraction."""
LOWEST_RATE: Final = 1.0 / _RATE_DENOMINATOR
"""Lowest rate that this denominator can state [Hz]."""


def sample_times_ns(first: int, count: int, rate: float, t0_ns: int = 0) -> Integers:
    """Return the times of samples ``first .. first + count - 1``.

    ``t_k = t0 + round(k * 1e9 / rate)`` in exact integer arithmetic, halves to even as Python's
    ``round``, so that sample k has the same time in whatever block it is produced and no error
    grows with k. The rate is taken as a fraction with a denominator of at most 10^6.

    :param first: index of the first sample, >= 0.
    :param count: number of samples, >= 0.
    :param rate: samples per second [Hz], > 0.
    :param t0_ns: time of sample 0 [ns].
    :returns: (count,) times [ns].
    """
    numerator, denominator = _period(rate)
    j = np.arange(count, dtype=np.int64)
    if denominator == 1:
        return t0_ns + first * numerator + numerator * j
    # t_k = floor((2 k A + B) / 2B) for a period of A / B; only the offset of the block is large,
    # and Python's integers carry that.
    whole, part = divmod(numerator, denominator)
    half = 2 * denominator
    start, remainder = divmod(2 * first * numerator + denominator, half)
    quotient, rest = np.divmod(remainder + 2 * part * j, half)
    times = start + whole * j + quotient
    ties_to_even = (rest == 0) & (times % 2 != 0)
    return t0_ns + times - ties_to_even


@lru_cache(maxsize=64)
def _period(rate: float) -> tuple[int, int]:
    """Return numerator and denominator of the time between two samples [ns]."""
    period = Fraction(NANOSECONDS_PER_SECOND) / exact_rate(rate)
    return period.numerator, period.denominator


def sample_count(duration: float, rate: float) -> int:
    """Return how many samples fall into ``[0, duration)``: 20 s at 200 Hz are 4000, not 4001.

    :param duration: seconds, >= 0.
    :param rate: samples per second [Hz], > 0.
    """
    # The product of two decimal numbers such as 0.1 s and 30 Hz may miss an integer by rounding.
    samples = exact_fraction(duration) * exact_rate(rate)
    return math.ceil(samples)


@lru_cache(maxsize=64)
def exact_rate(rate: float) -> Fraction:
    """Return a rate as the fraction that was meant: 333.3 is 3333/10.

    :raises ConfigurationError: for a rate that is not finite, and for one below 1e-6 Hz.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise ConfigurationError(f"rate = {rate}: must be a finite number above 0 Hz")
    fraction = Fraction(repr(float(rate))).limit_denominator(_RATE_DENOMINATOR)
    if not fraction:
        raise ConfigurationError(f"rate = {rate:g}: must be at least {LOWEST_RATE:g} Hz")
    return fraction


def seconds_since(t_ns: Integers, t0_ns: int) -> Array:
    """Return times as float seconds after ``t0_ns``; the difference is taken in integers."""
    return (t_ns - t0_ns).astype(np.float64) * 1e-9


def interpolate_columns(t_ns: Integers, at_ns: Integers, values: Array) -> Array:
    """Return columns (m, k) of values at other times; beyond the ends they are constant.

    :param t_ns: (n,) times of the values [ns], in any order.
    :param at_ns: (m,) other times [ns].
    :param values: (n, k) values, between which the columns are linear.
    """
    order = np.argsort(t_ns, kind="stable")
    start_ns = int(t_ns[order[0]])
    abscissae = (t_ns[order] - start_ns).astype(np.float64)
    times = (at_ns - start_ns).astype(np.float64)
    return np.column_stack([np.interp(times, abscissae, column) for column in values[order].T])


@lru_cache(maxsize=64)
def exact_fraction(seconds: float) -> Fraction:
    """Return a duration as the decimal fraction that was meant: 0.1 is 1/10 [s]."""
    return Fraction(repr(float(seconds)))


def to_nanoseconds(seconds: float) -> int:
    """Return a duration in whole nanoseconds, the nearest one."""
    return round(exact_fraction(seconds) * NANOSECONDS_PER_SECOND)


_LONGEST_DURATION: Final = 40
"""Longest text of a duration [characters]."""
_SECONDS: Final = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}


def parse_duration(text: str) -> float:
    """Return the seconds of ``20s``, ``10min``, ``4h``, ``2d`` or a plain number.

    :raises ValueError: for anything else.
    """
    match = re.fullmatch(r"(\d+\.?\d*|\.\d+)\s*(s|min|h|d|)", text.strip())
    if match is None or len(text) > _LONGEST_DURATION:
        raise ValueError(f"{text[:40]!r} is not a duration such as 20s, 10min or 4h")
    return float(match[1]) * _SECONDS[match[2]]


_EQUAL_NS: Final = 2
"""Differences of steps up to which they are equal, but for rounding to nanoseconds."""


def describe_span(t_ns: Integers) -> str:
    """Return how many rows there are and for how long, with the rate if their steps are equal.

    The rate of other stamps is that of the clock behind them, which ``inspect`` tells.
    """
    n = len(t_ns)
    if n < 2:
        return f"{n} row{'s' if n != 1 else ''}"
    seconds, steps = float(t_ns[-1] - t_ns[0]) * 1e-9, np.diff(t_ns)
    if steps.min() > 0 and np.ptp(steps) <= _EQUAL_NS:
        return f"{n} at {(n - 1) / seconds:.4g} Hz, {seconds:.6g} s"
    return f"{n} in {seconds:.6g} s"
