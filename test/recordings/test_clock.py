# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clock behind stamps: rate, rounding, batches, losses, pieces."""

import numpy as np
import pytest
from stamps import T0_NS, batches, exact, jittered, kept, polled, repeated, rounded

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.recordings.clock import Losses, estimate_clock, find_pattern

RATES = (50, 60.3, 142.8, 200, 333.3, 400.1, 499.9, 501, 666.7, 833, 990, 999)
RATES += (1000, 1001, 1100, 1333, 1500, 1666, 1900, 1999, 2000)
CLOCKS = (1, 3, 50, 119.9, 200, 333.3, 999, 1000, 1666, 4000, 8000)
TICKS = (976_562.5, 1_000_020.0, 100_000, 30_517.578125, 10_000)


def kinds(clock):
    return [trait.kind for trait in clock.traits]


@pytest.mark.parametrize("rate", RATES)
def test_whole_milliseconds_have_the_rate_of_the_samples_and_no_losses(rate):
    for half in (0, 500_000):
        clock = estimate_clock(rounded(exact(26000, rate) + half))
        assert clock.rate == pytest.approx(rate, rel=2e-4)
        assert clock.lost == 0
        assert len(clock.traits) == len(clock.pieces) == 1
        assert (np.diff(clock.times_ns()) > 0).all()


@pytest.mark.parametrize("rate", set(RATES) - {990, 999, 1001, 1999})
def test_losses_among_whole_milliseconds_are_counted(rate):
    """Next to 1000 and 2000 Hz the wraps of rounding and random losses look alike."""
    t_ns = exact(26000, rate)
    rows = kept(len(t_ns), 0.01)
    clock = estimate_clock(rounded(t_ns[rows]))
    assert clock.rate == pytest.approx(rate, rel=1e-3)
    assert clock.lost == pytest.approx(26000 - len(rows), rel=0.02)
    single_loss = estimate_clock(rounded(np.delete(t_ns, 13000)))
    assert single_loss.rate == pytest.approx(rate, rel=1e-3)
    assert single_loss.lost == 1
    burst = estimate_clock(rounded(np.delete(t_ns, slice(5000, 5020))))
    assert burst.lost == 20


@pytest.mark.parametrize("rate", [200, 400.1, 800])
@pytest.mark.parametrize("unit", TICKS)
def test_any_unit_is_found(rate, unit):
    t_ns = exact(26000, rate)
    clock = estimate_clock(rounded(t_ns, unit))
    assert clock.rate == pytest.approx(rate, rel=1e-4)
    assert clock.lost == 0
    rows = kept(len(t_ns), 0.01)
    assert estimate_clock(rounded(t_ns[rows], unit)).lost == pytest.approx(
        26000 - len(rows), rel=0.02
    )


@pytest.mark.parametrize("rate", CLOCKS)
@pytest.mark.parametrize("skew", [0.0, 80e-6])
def test_an_exact_clock_is_exact_and_its_losses_are_counted(rate, skew):
    t_ns = exact(20000, rate, skew)
    clock = estimate_clock(t_ns)
    assert kinds(clock) == ["exact"]
    assert clock.rate == pytest.approx(rate / (1.0 + skew), rel=1e-7)
    rows = kept(len(t_ns), 0.01)
    lossy = estimate_clock(t_ns[rows])
    assert kinds(lossy) == ["exact", "loss"]
    assert lossy.lost == 20000 - len(rows)
    np.testing.assert_array_equal(np.cumsum(lossy.missing) + np.arange(len(rows)), rows)


@pytest.mark.parametrize("rate", CLOCKS)
@pytest.mark.parametrize("deviation", [0.02, 0.1, 0.2])
def test_a_jittered_clock_has_jitter_and_nothing_else(rate, deviation):
    t_ns = jittered(exact(20000, rate), deviation)
    clock = estimate_clock(t_ns)
    assert kinds(clock) == ["jitter"]
    # The deviation of 20000 normal numbers is known to 0.5 %; a fifth is cut at 0.45 intervals.
    assert clock.jitter_ns == pytest.approx(deviation * 1e9 / rate, rel=0.04)
    rows = kept(len(t_ns), 0.01)
    assert estimate_clock(t_ns[rows]).lost == pytest.approx(20000 - len(rows), rel=0.02)


@pytest.mark.parametrize("rate", [100, 400, 1600])
@pytest.mark.parametrize("size", [2, 8, 20])
def test_batches_and_bunches_have_the_rate_of_their_readings(rate, size):
    t_ns = exact(24000, rate)
    for apart_ns, kind in ((0, "batches"), (50_000 if rate < 1000 else 5_000, "bunches")):
        clock = estimate_clock(batches(t_ns, size, apart_ns))
        assert kinds(clock) == [kind]
        assert clock.rate == pytest.approx(rate, rel=1e-6)
        np.testing.assert_allclose(clock.times_ns(), t_ns, atol=2)
    rows = kept(len(t_ns), 0.01)
    lossy = estimate_clock(batches(t_ns, size)[rows])
    assert lossy.rate == pytest.approx(rate, rel=1e-3)
    assert lossy.lost == pytest.approx(24000 - len(rows), rel=0.05)


@pytest.mark.parametrize("rate", [200, 400, 1000])
def test_a_polled_sensor_has_batches_of_unequal_sizes(rate):
    clock = estimate_clock(polled(exact(24000, rate), 61.7))
    assert clock.rate == pytest.approx(rate, rel=1e-3)
    assert clock.lost == 0
    assert (np.diff(clock.times_ns()) > 0).all()


def test_repeated_messages_are_duplicates_with_and_without_their_values():
    rows, twice = repeated(20000, 0.1)
    for t_ns in (exact(20000, 200), jittered(exact(20000, 200), 0.1)):
        for equal in (None, twice):
            clock = estimate_clock(t_ns[rows], equal)
            assert kinds(clock)[1:] == ["duplicate"]
            assert clock.traits[1].number == np.count_nonzero(twice)
            np.testing.assert_array_equal(t_ns[rows][clock.rows], t_ns)


def test_equal_readings_in_batches_are_not_duplicates_where_all_readings_are_equal():
    clock = estimate_clock(batches(exact(4000, 400), 8), np.ones(4000, dtype=bool))
    assert kinds(clock) == ["batches"]
    assert clock.rate == pytest.approx(400)


@pytest.mark.parametrize("stray", [0, -(10**9), 2**62, T0_NS + 10**15])
@pytest.mark.parametrize("row", [0, 1, 999, 1998, 1999])
def test_a_stray_stamp_is_left_out(stray, row):
    t_ns = exact(2000, 200)
    t_ns[row] = stray
    clock = estimate_clock(t_ns)
    assert "stray" in kinds(clock) or row == 1
    assert clock.rate == pytest.approx(200)
    assert row == 1 or len(clock.pieces) == 1


def test_a_pause_is_no_loss_and_does_not_change_the_rate():
    for t_ns in (exact(24000, 200), rounded(exact(24000, 333.3)), batches(exact(24000, 400), 8)):
        rate = estimate_clock(t_ns).rate
        t_ns[12000:] += 3600 * 10**9
        clock = estimate_clock(t_ns)
        assert clock.rate == pytest.approx(rate, rel=1e-4)
        assert kinds(clock)[1:] == ["pause"]
        assert clock.lost == 0
        assert [piece.start for piece in clock.pieces] == [0, 12000]


@pytest.mark.parametrize("begin", [0, T0_NS, T0_NS - 10**12])
def test_a_reset_begins_another_piece(begin):
    t_ns = exact(12000, 200)
    clock = estimate_clock(np.concatenate([t_ns[:8000], t_ns - T0_NS + begin]))
    assert kinds(clock) == ["exact", "reset"]
    assert [piece.start for piece in clock.pieces] == [0, 8000]
    assert clock.lost == 0


def test_time_since_boot_that_turns_into_utc_is_another_clock():
    t_ns = exact(12000, 200)
    t_ns[:8000] -= T0_NS
    clock = estimate_clock(t_ns)
    assert kinds(clock) == ["exact", "clock_change"]
    assert clock.rate == pytest.approx(200)


def test_late_readings_take_their_place():
    t_ns = exact(2000, 200)
    swapped = np.arange(2000)
    swapped[[100, 101, 500, 501]] = [101, 100, 501, 500]
    clock = estimate_clock(t_ns[swapped])
    assert kinds(clock) == ["exact", "late"]
    np.testing.assert_array_equal(clock.stamps_ns, t_ns)


@pytest.mark.parametrize(
    ("divisor", "unit"), [(10**3, "in us: 200 Hz"), (10**6, "in ms: 200 Hz"), (5 * 10**6, "row")]
)
def test_numbers_in_other_units_are_named(divisor, unit):
    clock = estimate_clock(exact(20000, 200) // divisor)
    assert unit in clock.trait("unit").text


@pytest.mark.parametrize("t_ns", [[], [5], [0, 0, 0]])
def test_stamps_without_a_rate_are_refused(t_ns):
    with pytest.raises(InputError, match="no rate"):
        estimate_clock(np.array(t_ns, dtype=np.int64))


@pytest.mark.parametrize(
    "t_ns",
    [
        exact(30000, 200)[kept(30000, 0.01)],
        rounded(exact(30000, 800))[kept(30000, 0.01)],
        rounded(exact(30000, 1500)),
        batches(exact(30000, 400), 8)[kept(30000, 0.01)],
        jittered(exact(30000, 200), 0.1)[kept(30000, 0.01)],
    ],
)
def test_losses_do_not_depend_on_the_blocks(t_ns):
    pattern = find_pattern(t_ns)
    whole = Losses(pattern).count(t_ns).sum()
    blocks = Losses(pattern)
    parts = [blocks.count(part).sum() for part in np.array_split(t_ns, 37)]
    assert sum(parts) == pytest.approx(whole, rel=0.02)
