# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps, latency, losses and duplicates against their definitions and probabilities."""

import numpy as np
import pytest

from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

N = 100_000


def read_samples(count: int = N, rate: float = 200.0, **values: object) -> Samples:
    imu = {f"imu.{name}": value for name, value in values.items()}
    base = {"imu.preset": "perfect", "trajectory.type": "static", "rate": rate}
    return Body(load_simulation({**base, **imu})).next(count)["imu"]


def test_offset_skew_and_drift() -> None:
    hour = 3600 * 10**9
    block = read_samples(
        7201, rate=2.0, stamp_offset=-0.25, clock_skew_ppm=30.0, clock_drift_ppm_per_hour=6.0
    )
    error = block.t_ns - block.true_t_ns
    assert error[0] == -250_000_000
    # After one hour: 30 ppm, and half of the 6 ppm that the skew has grown by.
    assert error[-1] == -250_000_000 + round(hour * 33e-6)
    middle = round(hour / 2 * (30e-6 + 0.5 * 3e-6))
    assert error[3600] == -250_000_000 + middle
    assert np.array_equal(block.release_t_ns, block.true_t_ns)


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_jitter_of_stamps_is_normal_with_the_parameters_deviation(rate: float) -> None:
    """Normal with the given deviation; that of the estimate is sigma / sqrt(2 n)."""
    sigma = 0.05 / rate
    block = read_samples(rate=rate, jitter=sigma)
    error = (block.t_ns - block.true_t_ns) * 1e-9
    assert error.std() / sigma == pytest.approx(1.0, abs=5.0 / np.sqrt(2 * N))
    assert abs(error.mean()) < 5.0 * sigma / np.sqrt(N)
    assert (np.diff(block.true_t_ns) == round(1e9 / rate)).all()


@pytest.mark.parametrize("share", [0.15, 0.2, 0.25])
def test_jitter_has_the_stated_deviation_after_the_cut_off(share: float) -> None:
    """Uncorrected, the cut-off at 0.45 would leave 0.94 of a deviation of 0.25.

    The numbers' kurtosis is below the normal one, so that sigma / sqrt(2 n) bounds the error.
    """
    block = read_samples(jitter=share * 0.005)
    error = (block.t_ns - block.true_t_ns) * 1e-9
    assert error.std() / (share * 0.005) == pytest.approx(1.0, abs=4.0 / np.sqrt(2 * N))
    assert np.abs(error).max() <= 0.45 * 0.005 + 1e-9


def test_the_largest_jitter_does_not_reorder() -> None:
    block = read_samples(jitter=0.25 * 0.005)
    assert (np.diff(block.t_ns) > 0).all()
    assert np.abs(block.t_ns - block.true_t_ns).max() == round(0.45 * 5_000_000)


def test_latency_is_constant_plus_exponential_and_keeps_the_order() -> None:
    block = read_samples(rate=1.0, latency=0.02, latency_jitter=0.01)  # too slow to queue up
    latency = (block.release_t_ns - block.true_t_ns) * 1e-9
    assert latency.min() >= 0.02
    # Mean and deviation of the exponential are equal; the deviation of the mean is that / sqrt(n).
    assert latency.mean() - 0.02 == pytest.approx(0.01, abs=5.0 * 0.01 / np.sqrt(N))
    assert np.array_equal(block.t_ns, block.true_t_ns)
    fast = read_samples(rate=1000.0, latency=0.02, latency_jitter=0.01)
    assert (np.diff(fast.release_t_ns) >= 0).all()
    assert (fast.release_t_ns - fast.true_t_ns >= 20_000_000).all()


def test_dropouts_have_the_parameters_probability_and_are_independent() -> None:
    p = 0.1
    block = read_samples(dropout_probability=p)
    lost = N - len(block.delivered)
    assert lost / N == pytest.approx(p, abs=5.0 * np.sqrt(p * (1 - p) / N))
    assert (np.diff(block.delivered) > 0).all()
    # A loss does not make the next one likelier: p^2 pairs.
    gone = ~np.isin(np.arange(N), block.delivered)
    pairs = np.mean(gone[1:] & gone[:-1])
    assert pairs == pytest.approx(p * p, abs=5.0 * np.sqrt(2 * p * p / N))
    assert len(read_samples(100, dropout_probability=1.0).delivered) == 0


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_bursts_begin_as_a_poisson_process_with_exponential_durations(rate: float) -> None:
    """Starts are a Poisson process, durations exponential: on average as if queueing for ever.

    A sample is free when none of the j-th intervals before it started a burst that lasts longer
    than j intervals: prod_j (1 - p exp(-j dt / mean)), with p = 1 - exp(-rate dt).
    """
    per_second, mean = 0.5, 0.2
    block = read_samples(rate=rate, dropout_burst_rate=per_second, dropout_burst_duration=mean)
    dt = 1.0 / rate
    p = -np.expm1(-per_second * dt)
    free = np.prod(1.0 - p * np.exp(-np.arange(10_000) * dt / mean))
    lost = np.ones(N, dtype=bool)
    lost[block.delivered] = False
    starts = np.count_nonzero(np.diff(lost.astype(int)) == 1)
    # About so many bursts of relative deviation 1 each, which overlap now and then.
    tolerance = 5.0 * np.sqrt(2.0 / (N * dt * per_second))
    assert lost.mean() / (1.0 - free) == pytest.approx(1.0, abs=tolerance)
    # A visible burst begins where a free sample is followed by a start.
    assert starts / (N * free * p) == pytest.approx(1.0, abs=tolerance)


def test_duplicates_stand_twice_and_in_order() -> None:
    p = 0.2
    block = read_samples(duplicate_probability=p)
    rows, counts = np.unique(block.delivered, return_counts=True)
    assert np.array_equal(rows, np.arange(N))
    assert set(counts.tolist()) == {1, 2}
    assert np.mean(counts == 2) == pytest.approx(p, abs=5.0 * np.sqrt(p * (1 - p) / N))
    assert (np.diff(block.delivered) >= 0).all()


def test_losses_do_not_shift_duplicates() -> None:
    only = read_samples(duplicate_probability=0.2).delivered
    both = read_samples(duplicate_probability=0.2, dropout_probability=0.3).delivered
    assert np.array_equal(both, only[np.isin(only, both)])


def test_timing_never_touches_the_truth() -> None:
    plain = read_samples(1000)
    timed = read_samples(
        1000,
        stamp_offset=0.1,
        clock_skew_ppm=100.0,
        jitter=1e-3,
        latency=0.1,
        latency_jitter=0.1,
        dropout_probability=0.5,
        duplicate_probability=0.5,
    )
    assert np.array_equal(plain.true_t_ns, timed.true_t_ns)
    assert np.array_equal(plain.accel, timed.accel)
    assert len(timed.accel) == 1000
