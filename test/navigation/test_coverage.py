# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coverage of the truth's time by an estimate, against sums by hand."""

import numpy as np
import pytest

from imu_sim_ros.navigation.coverage import Coverage, TruthTime, coverage, coverage_line
from imu_sim_ros.recordings.order import POSES_GAP, gap_length

SECOND = 1_000_000_000
TRUTH = np.arange(2001) * SECOND // 100  # 20 s at 100 Hz


def stamps_of_parts(*parts):
    """Return stamps at 20 Hz from one second to another, for each part."""
    steps = [np.arange(round(20 * a), round(20 * b) + 1) for a, b in parts]
    return np.concatenate(steps) * SECOND // 20


@pytest.mark.parametrize(
    ("estimate", "expected"),
    [
        (stamps_of_parts((0.0, 20.0)), (1.0, 20.0, 0.0, 0.0, 20.0)),
        # An estimator that stops after 20 %, or after 1.95 s.
        (stamps_of_parts((0.0, 4.0)), (0.2, 4.0, 0.0, 0.0, 4.0)),
        (stamps_of_parts((0.0, 1.95)), (1.95 / 20.0, 1.95, 0.0, 0.0, 1.95)),
        # Two poses with everything between them missing.
        (np.array([0, 20 * SECOND]), (0.0, 0.0, 0.0, 0.0, 0.0)),
        (np.array([0, SECOND // 20]), (0.05 / 20.0, 0.05, 0.0, 0.0, 0.05)),
        # A gap, and the end of the first part.
        (stamps_of_parts((0.0, 6.0), (9.0, 20.0)), (17.0 / 20.0, 17.0, 0.0, 0.0, 6.0)),
        # The start counts beyond 5 s only.
        (stamps_of_parts((4.0, 20.0)), (1.0, 16.0, 4.0, 4.0, 20.0)),
        (stamps_of_parts((8.0, 20.0)), (12.0 / 15.0, 12.0, 8.0, 5.0, 20.0)),
        # What is estimated before and after the truth is not of its time.
        (stamps_of_parts((-3.0, 23.0)), (1.0, 20.0, 0.0, 0.0, 20.0)),
        (stamps_of_parts((-3.0, -1.0)), (0.0, 0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_estimates_of_20_seconds(estimate, expected):
    share, estimated, *rest = expected
    covered = coverage(estimate, TRUTH)
    assert covered == pytest.approx(Coverage(share, estimated, 20.0, *rest))


def test_the_allowance_is_a_quarter_of_a_short_motion():
    """An estimate of 1 of 2 s: 0.5 s are allowed."""
    truth = np.arange(201) * SECOND // 100
    assert coverage(stamps_of_parts((1.0, 2.0)), truth).share == pytest.approx(1.0 / 1.5)
    assert coverage(stamps_of_parts((1.0, 2.0)), truth, allowance=0.0).share == pytest.approx(0.5)


def test_a_gap_of_the_truth_is_not_of_its_time():
    """Motion capture that loses the body for 4 s says nothing about the estimate there."""
    truth = np.concatenate([TRUTH[:801], TRUTH[1200:]])
    for estimate in (stamps_of_parts((0.0, 20.0)), stamps_of_parts((0.0, 8.0), (12.0, 20.0))):
        covered = coverage(estimate, truth)
        assert (covered.truth_s, covered.estimated_s) == pytest.approx((16.0, 16.0))
    assert coverage(stamps_of_parts((0.0, 16.0)), truth).estimated_s == pytest.approx(12.0)


def test_a_slow_truth_has_no_gaps():
    truth = np.arange(21) * SECOND
    assert coverage(stamps_of_parts((0.0, 10.0)), truth).share == pytest.approx(0.5)


def test_slow_poses_are_gaps_unless_longer_ones_are_allowed():
    estimate = np.arange(21) * SECOND
    assert coverage(estimate, TRUTH, max_gap=0.5).share == 0.0
    assert coverage(estimate, TRUTH, max_gap=1.0).share == 1.0


def test_the_first_pose_that_has_failed_ends_it():
    estimate = stamps_of_parts((0.0, 20.0))
    failed = (estimate >= 7 * SECOND) & (estimate < 8 * SECOND)
    covered = coverage(estimate, TRUTH, failed=failed)
    assert (covered.share, covered.time_to_failure_s) == pytest.approx((1.0, 7.0))
    assert coverage(estimate[:60], TRUTH, failed=failed[:60]).time_to_failure_s == 2.95


@pytest.mark.parametrize("hours", [-1, 1])
def test_an_estimate_of_another_time_covers_nothing_and_fails_at_once(hours):
    covered = coverage(TRUTH + hours * 3_600_000_000_000, TRUTH)
    assert (covered.share, covered.estimated_s, covered.time_to_failure_s) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("rate", "share"), [(0.4, 0.0), (0.5, 1.0), (1.0, 1.0), (10.0, 1.0)])
def test_the_default_gap_suits_the_rate(rate, share):
    """Poses are apart by up to 2 s without a gap; a lost one at 1 Hz is none, two at 2 Hz are."""
    slow = np.arange(0, 20 * 10**9 + 1, round(1e9 / rate))
    assert coverage(slow, TRUTH).share == share
    assert coverage(TRUTH, slow).share == pytest.approx(1.0, abs=0.06)
    assert coverage(slow, TRUTH, max_gap=0.05).share == 0.0
    at_2_hz = np.delete(np.arange(0, 20 * 10**9 + 1, 500_000_000), [10, 11])
    assert coverage(at_2_hz, TRUTH).share == pytest.approx(1.0 - 1.5 / 20.0)
    at_1_hz = np.delete(np.arange(0, 20 * 10**9 + 1, 10**9), 10)
    assert coverage(at_1_hz, TRUTH).share == 1.0


def test_sparse_poses_have_the_option_that_counts_the_time_between_them():
    truth = np.arange(0, 60 * 10**9, 10**7)
    covered = coverage(truth[::250], truth)
    assert (covered.share, covered.sparse_s) == (0.0, 2.5)
    assert "a pose each 2.5 s" in coverage_line(covered.to_dict())
    assert "max_gap=3.8 counts it" in coverage_line(covered.to_dict())
    counted = coverage(truth[::250], truth, max_gap=3.8)
    assert (round(counted.share, 2), counted.sparse_s) == (0.96, 0.0)


@pytest.mark.parametrize("gaps", [[], [700], [1999]])
def test_the_truths_time_at_all_its_stamps_is_that_at_each(gaps):
    truth_ns = TRUTH + sum((np.arange(2001) > gap) * 3 * SECOND for gap in gaps)
    clock = TruthTime(truth_ns, 0.0)
    expected = [int(clock.at(truth_ns[k : k + 1])[0]) for k in range(2001)]
    assert clock.at(truth_ns).tolist() == expected
    assert expected[-1] == (2000 - len(gaps)) * SECOND // 100


@pytest.mark.parametrize(
    ("steps_s", "expected"),
    [
        ([0.01] * 9, POSES_GAP),
        # One long step among short ones: the median decides.
        ([0.01] * 8 + [3.0], POSES_GAP),
        ([0.4] * 9, 1.0),
        ([0.4] * 5 + [0.01] * 4, 1.0),
        ([5.0] * 9, 2.0),
        ([0.0] * 9, POSES_GAP),
    ],
)
def test_a_gap_is_two_and_a_half_usual_steps_within_limits(steps_s, expected):
    t_ns = np.cumsum([0, *(round(1e9 * step) for step in steps_s)])
    assert gap_length(0.0, POSES_GAP, t_ns) == pytest.approx(expected)
