# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings of two triads with different stamps, at the times of one of them."""

from typing import NamedTuple

import numpy as np

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.timebase import seconds_since
from imu_sim_ros.core.types import Array, Integers, Mask, Times
from imu_sim_ros.recordings.clock import estimate_clock, repeats


class Paired(NamedTuple):
    """m readings of both triads."""

    rows: Integers
    """(m,) readings of the triad that gives the times."""
    values: Array
    """(m, 3) interpolated readings of the companion."""
    notes: tuple[str, ...]
    """Lines about the loss of bandwidth, and about readings that are left out."""


def pair(
    t_ns: Times,
    triad_values: Array,
    companion_ns: Times,
    values: Array,
    names: tuple[str, str],
) -> Paired:
    """Return the readings of a triad that lie between two of a companion, which is interpolated.

    Times before and after the readings of the companion, and in its gaps, are left out.

    :param t_ns: (n,) stamps of the triad that gives the times.
    :param triad_values: (n, 3) its readings; the same stamp and values are one message twice.
    :param companion_ns: (m,) stamps of the companion, which increase.
    :param values: (m, 3) readings of the companion.
    :param names: names of triad and companion, for the notes.
    :raises InputError: if the stamps do not increase, or have no time in common.
    """
    triad, companion = _clock_times(t_ns, triad_values), _clock_times(companion_ns, values)
    knots_ns, times_ns = companion.t_ns, triad.t_ns
    if np.any(np.diff(knots_ns) <= 0):
        raise InputError("the stamps do not increase: not merged")
    following = np.clip(np.searchsorted(knots_ns, times_ns), 0, len(knots_ns) - 1)
    within = (times_ns >= knots_ns[0]) & (times_ns <= knots_ns[-1])
    if not within.any():
        raise InputError("no time in common")
    lost = companion.lost[following] & (knots_ns[following] != times_ns)
    start_ns = int(knots_ns[0])
    seconds = seconds_since(times_ns[within & ~lost], start_ns)
    knots = seconds_since(knots_ns, start_ns)
    columns = [np.interp(seconds, knots, axis) for axis in values[companion.rows].T]
    notes = []
    if companion.interval_ns:
        # Midway between two samples the response is cos(pi f T), the worst case of interpolation.
        notes.append(
            f"the {names[1]} is interpolated to the times of the {names[0]}: at "
            f"{0.25e9 / companion.interval_ns:.3g} Hz up to {1.0 - np.cos(np.pi / 4.0):.0%} of a "
            "motion is lost, and white noise is up to a factor of 1/sqrt(2) smaller"
        )
    for mask, place in ((~within, "outside the time"), (within & lost, "in gaps")):
        if mask.any():
            notes.append(
                f"{np.count_nonzero(mask)} readings of the {names[0]} {place} of the {names[1]} "
                "are left out"
            )
    return Paired(triad.rows[within & ~lost], np.column_stack(columns), tuple(notes))


class _Timed(NamedTuple):
    """Times of the m readings of a triad that are used."""

    rows: Integers
    """(m,) rows of the readings."""
    t_ns: Times
    """(m,) times by the clock behind the stamps [ns]."""
    lost: Mask
    """(m,) True if readings are missing before this one."""
    interval_ns: float
    """Time between two samples [ns]; 0: a single reading."""


def _clock_times(t_ns: Times, values: Array) -> _Timed:
    """Return the times of readings (n, 3) by the clock behind their stamps (n,) [ns]."""
    if len(t_ns) < 2:
        return _Timed(np.arange(len(t_ns)), t_ns, np.zeros(len(t_ns), np.bool_), 0.0)
    clock = estimate_clock(t_ns, repeats(values))
    lost = clock.missing > 0
    lost[[piece.start for piece in clock.pieces]] = True
    return _Timed(clock.rows, clock.times_ns(), lost, clock.interval_ns)
