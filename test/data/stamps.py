# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of recordings: rounded, late, in batches or lost, computed from a known clock."""

import numpy as np

T0_NS = 1_700_000_000_000_000_000


def exact(count, rate, skew=0.0):
    """Return the times of ``count`` samples at ``rate`` [Hz], rounded to nanoseconds.

    :param skew: relative error of the clock.
    """
    times = np.round(np.arange(count) * (1e9 / rate * (1.0 + skew)))
    return T0_NS + times.astype(np.int64)


def rounded(t_ns, unit_ns=1_000_000):
    """Return stamps cut to whole units; a unit that is no whole number is that of another clock."""
    if isinstance(unit_ns, int):
        return t_ns // unit_ns * unit_ns
    since = np.floor((t_ns - T0_NS) / unit_ns) * unit_ns
    return T0_NS + np.round(since).astype(np.int64)


def jittered(t_ns, deviation, seed=1):
    """Return stamps with normal errors of a deviation [intervals], limited to 0.45 intervals."""
    interval = float(t_ns[-1] - t_ns[0]) / (len(t_ns) - 1)
    late = np.random.default_rng(seed).standard_normal(len(t_ns)) * deviation
    return t_ns + np.round(np.clip(late, -0.45, 0.45) * interval).astype(np.int64)


def batches(t_ns, size, apart_ns=0):
    """Return stamps of readings that are delivered ``size`` at a time, ``apart_ns`` apart."""
    k = np.arange(len(t_ns))
    return t_ns[k // size * size] + k % size * apart_ns


def polled(t_ns, rate):
    """Return the stamps of a host that fetches what has been sampled ``rate`` times a second."""
    period = round(1e9 / rate)
    return -(-t_ns // period) * period


def kept(count, share, seed=2):
    """Return the rows that remain after the random loss of a share; both ends remain."""
    lost = np.random.default_rng(seed).random(count) < share
    lost[[0, -1]] = False
    return np.flatnonzero(~lost)


def repeated(count, share, seed=3):
    """Return rows of which a share comes twice, and the mask of the second ones."""
    twice = np.random.default_rng(seed).random(count) < share
    rows = np.repeat(np.arange(count), 1 + twice)
    return rows, np.diff(rows, prepend=-1) == 0
