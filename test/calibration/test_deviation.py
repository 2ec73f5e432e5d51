# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Allan deviation against allantools, the published NBS14 values, and itself in pieces."""

import numpy as np
import pytest

from imu_sim_ros.calibration.noise import deviation
from imu_sim_ros.calibration.noise.deviation import (
    DeviationAccumulator,
    cluster_sizes,
    confidence_factors,
)


def nbs14() -> np.ndarray:
    """Return the 1000-point test set of NIST SP 1065, section 12.4."""
    values = [1234567890]
    for _ in range(999):
        values.append(16807 * values[-1] % 2147483647)
    return np.array(values) / 2147483647.0


def accumulate(y: np.ndarray, rate: float, block: int) -> deviation.Deviation:
    accumulator = DeviationAccumulator(rate, y.shape[1])
    for start in range(0, len(y), block):
        accumulator.add(y[start : start + block])
    accumulator.end_piece()
    return accumulator.result()


def test_published_values_of_the_nbs14_set():
    allan = accumulate(nbs14()[:, None], 1.0, 300)
    rows = np.isin(allan.size, [1, 10, 100])
    assert allan.deviation[rows, 0] == pytest.approx([0.2922319, 0.09159953, 0.03241343], rel=2e-7)


@pytest.mark.parametrize("rate", [1.0, 200.0])
def test_agrees_with_allantools(rate):
    allantools = pytest.importorskip("allantools")
    rng = np.random.default_rng(1)
    y = rng.standard_normal((30000, 2)) + np.cumsum(rng.standard_normal((30000, 2)), axis=0) * 0.02
    allan = accumulate(y, rate, 4096)
    assert len(allan.tau) > 55
    for axis in range(2):
        _, expected, _, _ = allantools.oadev(
            y[:, axis], rate=rate, data_type="freq", taus=allan.tau
        )
        assert allan.deviation[:, axis] == pytest.approx(expected, rel=1e-12)


def test_does_not_depend_on_the_blocks_or_on_a_constant():
    y = np.random.default_rng(2).standard_normal((20000, 1))
    whole = accumulate(y, 100.0, 20000)
    for block in (77, 8192):
        assert accumulate(y, 100.0, block).deviation == pytest.approx(whole.deviation, rel=1e-12)
    assert accumulate(y + 9.81, 100.0, 5000).deviation == pytest.approx(whole.deviation, rel=1e-9)


def test_long_records_keep_every_second_phase_and_nearly_the_value(monkeypatch):
    y = np.random.default_rng(3).standard_normal((60000, 1))
    exact = accumulate(y, 100.0, 5000)
    monkeypatch.setattr(deviation, "_PHASES", 5000)
    thinned = accumulate(y, 100.0, 5000)
    assert np.array_equal(thinned.size, exact.size)
    short = exact.size <= 1024
    assert thinned.deviation[short] == pytest.approx(exact.deviation[short], rel=1e-12)
    # Of 60,000 phases every 16th is kept; a block of 5000 samples is no multiple of that.
    phase = np.concatenate([[0.0], np.cumsum(y[:, 0])])[::16] / 100.0
    for m, estimate in zip(thinned.size[~short], thinned.deviation[~short, 0], strict=True):
        second = phase[m // 8 :] - 2.0 * phase[m // 16 : -(m // 16)] + phase[: -(m // 8)]
        assert estimate == pytest.approx(np.sqrt(np.mean(second**2) / 2.0) / (m / 100.0), rel=1e-9)
    # Neighbouring second differences at m >= 1024 overlap to 1 - 16/m: the same estimate.
    assert thinned.deviation[~short] == pytest.approx(exact.deviation[~short], rel=0.02)


def test_pieces_are_not_bridged():
    rng = np.random.default_rng(4)
    piece_a, piece_b = rng.standard_normal((2, 20000, 1))
    accumulator = DeviationAccumulator(100.0, 1)
    for piece in (piece_a, piece_b + 1000.0):
        accumulator.add(piece)
        accumulator.end_piece()
    both = accumulator.result()
    single = [accumulate(piece, 100.0, 20000) for piece in (piece_a, piece_b)]
    mean = np.sqrt(0.5 * (single[0].deviation ** 2 + single[1].deviation ** 2))
    assert both.deviation == pytest.approx(mean, rel=1e-9)


def test_sizes_are_multiples_of_the_power_of_two_below_their_64th():
    sizes = cluster_sizes(10**8)
    for m in sizes:
        step = 1 << max(int(m).bit_length() - 7, 0)
        assert m % step == 0
    assert np.all(np.diff(sizes) > 0)
    assert sizes[0] == 1
    assert len(cluster_sizes(1_440_000)) == pytest.approx(90, abs=3)
    assert len(cluster_sizes(2)) == 0


@pytest.mark.parametrize("walk", [False, True])
def test_band_covers_the_deviation_of_white_noise_and_of_a_walk(walk):
    """95 % of 400 independent records; binomial standard deviation 1.1 %, four of them allowed.

    White noise has the deviation ``sqrt(1/m)``; sums of it ``sqrt((2 m^2 + 1) / (6 m))``, the
    mean square of the difference of two neighbouring means over 2.
    """
    rng = np.random.default_rng(5)
    y = rng.standard_normal((3000, 400))
    allan = accumulate(np.cumsum(y, axis=0) if walk else y, 1.0, 3000)
    rows = np.isin(allan.size, [1, 10, 100, 508])
    sizes, allan = allan.size[rows], allan.deviation[rows]
    assert len(sizes) == 4
    low, high = confidence_factors(3000, sizes)
    truth = np.sqrt((2.0 * sizes**2 + 1.0) / (6.0 * sizes) if walk else 1.0 / sizes)[:, None]
    covered = np.mean((allan * low <= truth) & (truth <= allan * high), axis=1)
    assert np.all(covered > 0.95 - 0.044)
