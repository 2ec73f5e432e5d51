# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The same stamps have the same rate, losses and order live and in a file."""

import numpy as np
import pytest
from stamps import batches, exact, jittered, kept, polled, repeated, rounded

from imu_sim_ros.recordings.clock import estimate_clock
from imu_sim_ros.recordings.live_clock import LiveClock


def swapped(t_ns):
    rows = np.arange(len(t_ns))
    rows[[100, 101]] = [101, 100]
    return t_ns[rows]


def stepped(t_ns, row, step_ns):
    return t_ns + np.where(np.arange(len(t_ns)) >= row, step_ns, 0)


def stray(t_ns):
    t_ns = t_ns.copy()
    t_ns[1000] = 0
    return t_ns


STAMPS = {
    "exact": exact(3000, 200),
    "losses": exact(3000, 200)[kept(3000, 0.02)],
    "rounded": rounded(exact(3000, 400.1)),
    "rounded, near its unit": rounded(exact(3000, 833))[kept(3000, 0.01)],
    "batches": batches(exact(3000, 400), 8),
    "bunches": batches(exact(3000, 400), 8, 50_000),
    "polled": polled(exact(3000, 400), 61.7),
    "jitter": jittered(exact(3000, 200), 0.1),
    "repeated": exact(3000, 200)[repeated(3000, 0.05)[0]],
    "late": swapped(exact(3000, 200)),
    "stray": stray(exact(3000, 200)),
    "pause": stepped(exact(3000, 200), 1500, 3600 * 10**9),
    "reset": stepped(exact(3000, 200), 1500, -(10**12)),
    "utc": stepped(exact(3000, 200), 1500, 3 * 10**17),
}


def live(t_ns, size):
    clock = LiveClock()
    for begin in range(0, len(t_ns), size):
        clock.add(t_ns[begin : begin + size])
    clock.finish()
    return clock


def counts_of_file(t_ns):
    clock = estimate_clock(t_ns)
    numbers = {trait.kind: trait.number for trait in clock.traits}
    out_of_order = sum(numbers.get(kind, 0) for kind in ("late", "stray", "reset"))
    gaps = np.count_nonzero(clock.missing) + numbers.get("pause", 0)
    return (clock.kind, gaps, clock.lost, numbers.get("duplicate", 0), out_of_order), clock.rate


@pytest.mark.parametrize("name", STAMPS)
def test_live_and_in_a_file_stamps_say_the_same(name):
    counts, rate = counts_of_file(STAMPS[name])
    for size in (1, 7, 1000):
        clock = live(STAMPS[name], size)
        assert clock.rate == rate
        assert clock.clock.kind == counts[0]
        assert (clock.gaps, clock.missing, clock.duplicates, clock.out_of_order) == counts[1:]


@pytest.mark.parametrize(
    "name", ["losses", "rounded", "batches", "jitter", "late", "pause", "reset"]
)
def test_more_stamps_than_are_held_say_the_same(name):
    """90,000 stamps, 30 of the short records one after the other, without a step between them."""
    part = STAMPS[name]
    if name in ("pause", "reset", "late", "losses"):
        length = exact(3001, 200)[3000] - exact(1, 200)[0]
        long = np.concatenate([exact(66000, 200), part + 22 * length])
    else:
        whole = {"rounded": rounded(exact(90000, 400.1)), "batches": batches(exact(90000, 400), 8)}
        long = whole.get(name, jittered(exact(90000, 200), 0.1))
    counts, rate = counts_of_file(long)
    clock = live(long, 500)
    assert clock.rate == pytest.approx(rate, rel=1e-6)
    assert (clock.gaps, clock.missing, clock.duplicates, clock.out_of_order) == counts[1:]


def test_the_work_of_a_live_clock_grows_with_the_number_of_stamps():
    """Estimates are made at numbers that grow by a quarter: 35 up to 65,536, none per stamp."""
    clock, estimates, latest = LiveClock(), 0, None
    t_ns = exact(20000, 1000)
    for row in range(len(t_ns)):
        clock.add(t_ns[row : row + 1])
        estimates += clock.clock is not latest
        latest = clock.clock
    assert estimates < np.log(20000 / 32) / np.log(1.25) + 3


def test_messages_with_other_contents_are_no_repetitions():
    """Readings that share a stamp at random: only their contents tell them from repetitions."""
    rows, twice = repeated(3000, 0.05)
    t_ns = exact(3000, 200)[rows]
    for changes, duplicates in ((~twice, np.count_nonzero(twice)), (np.ones(len(rows), bool), 0)):
        clock = LiveClock()
        clock.add(t_ns, changes)
        clock.finish()
        assert clock.duplicates == duplicates
