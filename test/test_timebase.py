# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sample times: exact, independent of the block, and without drift."""

from fractions import Fraction

import numpy as np
import pytest

from imu_sim_ros.core import timebase
from imu_sim_ros.core.errors import ConfigurationError


@pytest.mark.parametrize("rate", [200.0, 1000.0, 8000.0, 1024.0, 30.0, 333.3, 1000 / 3, 2.5])
@pytest.mark.parametrize("start", [0, 7, 10**10])
def test_times_are_the_rounded_products(rate, start):
    times = timebase.sample_times_ns(start, 500, rate, t0_ns=11)
    exact = timebase.exact_rate(rate)
    assert times.dtype == np.int64
    assert times.tolist() == [11 + round(k * 10**9 / exact) for k in range(start, start + 500)]


def test_blocks_join_without_a_seam():
    whole = timebase.sample_times_ns(0, 1000, 333.3)
    pieces = [timebase.sample_times_ns(k, 7, 333.3) for k in range(0, 994, 7)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole[:994])


def test_a_month_at_200_hz_ends_on_the_nanosecond():
    samples = 30 * 86400 * 200
    start = 1_700_000_000_123_456_789
    last_stamp = timebase.sample_times_ns(samples - 1, 1, 200.0, start)[0]
    assert last_stamp == start + (samples - 1) * 5_000_000


@pytest.mark.parametrize(
    ("duration", "rate", "count"),
    [(20.0, 200.0, 4000), (0.1, 30.0, 3), (1.0, 333.3, 334), (0.0, 200.0, 0), (1e-9, 200.0, 1)],
)
def test_count_is_that_of_the_half_open_interval(duration, rate, count):
    assert timebase.sample_count(duration, rate) == count


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_a_bad_rate_is_named(rate):
    with pytest.raises(ConfigurationError, match="rate = .*above 0 Hz"):
        timebase.sample_times_ns(0, 1, rate)


def test_rates_are_what_people_write():
    assert timebase.exact_rate(333.3) == Fraction(3333, 10)
    assert timebase.to_nanoseconds(1403715524.907143) == 1403715524907143000


def test_differences_keep_their_digits_at_epoch_times():
    start = 1_700_000_000_000_000_000
    seconds = timebase.seconds_since(np.array([start + 1, start + 5_000_000]), start)
    np.testing.assert_array_equal(seconds, [1e-9, 5e-3])
