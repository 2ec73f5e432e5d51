# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cosine spectrum and the terms' expectations, against exact covariances."""

import resource
import tempfile
import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from imu_sim_ros.calibration.noise import terms
from imu_sim_ros.calibration.noise.spectrum import Spectrum, SpectrumAccumulator

RATE = 50.0


def expectation(factor: np.ndarray) -> tuple[Spectrum, np.ndarray]:
    """Return spectrum and exact expected rows of noise ``factor @ e`` with independent unit e.

    Each column is what one e does; the expectation of the squared coefficients is their sum. So
    many columns at a time as fit into the processor's cache.
    """
    rows = 0.0
    for columns in np.array_split(factor, max(factor.shape[1] // 128, 1), axis=1):
        accumulator = SpectrumAccumulator(RATE, columns.shape[1])
        accumulator.add(columns)
        accumulator.end_piece()
        spectrum = accumulator.result()
        rows = rows + spectrum.power.sum(axis=1)
    return spectrum, rows


def test_white_noise_is_flat():
    n = 512
    spectrum, rows = expectation(np.eye(n) * np.sqrt(RATE))
    assert rows == pytest.approx(np.ones(len(rows)), rel=1e-9)
    assert rows == pytest.approx(terms.WHITE.expectation(spectrum), rel=1e-9)


def test_walk_is_exact_on_samples_and_on_averages():
    n = 2048
    spectrum, rows = expectation(np.tril(np.ones((n, n))) / np.sqrt(RATE))
    model = terms.WALK.expectation(spectrum)
    low = spectrum.order > 0
    assert np.count_nonzero(low) >= 5
    assert rows[low] == pytest.approx(model[low], rel=1e-6)
    # Averages of several coefficients are compared with the model in their middle.
    assert rows[~low] == pytest.approx(model[~low], rel=0.02)


def test_white_noise_and_walk_have_independent_coefficients():
    """The full covariance of the coefficients of a walk is diagonal."""
    from scipy.fft import dct

    n = 256
    walk = dct(np.tril(np.ones((n, n))), norm="ortho", axis=0)[1:]
    covariance = walk @ walk.T
    k = np.arange(1, n)
    assert np.diag(covariance) == pytest.approx(1.0 / (4.0 * np.sin(np.pi * k / (2 * n)) ** 2))
    off = covariance - np.diag(np.diag(covariance))
    assert np.abs(off).max() < 1e-9 * covariance.max()


def test_quantisation_of_the_angle():
    n = 1024
    angle = np.eye(n, n + 1, 1) - np.eye(n, n + 1)
    spectrum, rows = expectation(angle * RATE)
    high = np.isinf(spectrum.duration) & (spectrum.frequency > 5.0)
    # The two ends of the record add 4 / n, 1 % at 5 Hz.
    model = terms.QUANTISATION.expectation(spectrum)
    assert rows[high] == pytest.approx(model[high], rel=0.03)


@pytest.mark.parametrize("correlation_time", [1.0, 8.0, 100.0])
def test_gauss_markov_is_exact_at_the_edges_of_the_record(correlation_time):
    n = 2048
    lag = np.maximum(np.subtract.outer(np.arange(n), np.arange(n)), 0) / RATE
    # x_k = phi x_{k-1} + sqrt(1 - phi^2) e_k from the steady state on.
    factor = np.tril(np.exp(-lag / correlation_time))
    factor[:, 1:] *= np.sqrt(-np.expm1(-2.0 / (RATE * correlation_time)))
    spectrum, rows = expectation(factor)
    low = spectrum.order > 0
    model = terms.gauss_markov_expectation(spectrum, correlation_time)
    assert rows[low] == pytest.approx(model[low], rel=0.01)
    # Without the edges, which at 41 s still are 4 % there.
    assert rows[~low] == pytest.approx(model[~low], rel=0.05)


@pytest.mark.parametrize("order", [1, 2, 3, 6])
def test_flicker_of_the_first_coefficients(order):
    """The density 1/f weighted by the response of the k-th cosine, integrated numerically."""
    a = np.pi * order

    def weighted(w: float) -> float:
        return 8.0 * w * (1.0 - (-1.0) ** order * np.cos(w)) / (w**2 - a**2) ** 2

    end = 4000.0 * np.pi
    edges = np.unique(np.concatenate([np.arange(0.0, 60.0 * np.pi, np.pi), [a, 60.0 * np.pi, end]]))
    integral = sum(
        quad(weighted, low + 1e-7, high - 1e-7, limit=4000)[0] for low, high in pairwise(edges)
    )
    integral += 4.0 / end**2
    spectrum = single_row(order)
    assert terms.FLICKER.expectation(spectrum)[0] * 2.0 * np.pi == pytest.approx(integral, rel=1e-4)


def single_row(order: int) -> Spectrum:
    """Return a spectrum of one coefficient, of a record of 1 s."""
    ones = np.ones(1)
    return Spectrum(
        0.5 * order * ones,
        ones[:, None],
        ones,
        order * ones,
        1e-4 * ones,
        ones,
        ones[:, None],
        1e-4,
    )


def test_ramp_of_the_single_coefficients():
    n = 16 * 400
    accumulator = SpectrumAccumulator(RATE, 1)
    accumulator.add(np.arange(n)[:, None] / RATE)
    accumulator.end_piece()
    spectrum = accumulator.result()
    low = (spectrum.order > 0) & (spectrum.order < 9)
    assert spectrum.amplitude[low, 0] == pytest.approx(
        terms.ramp_amplitude(spectrum)[low], rel=1e-3, abs=1e-9
    )


def test_every_sample_is_counted_once():
    n = 3 * (1 << 17) + 5000
    accumulator = SpectrumAccumulator(RATE, 1)
    rng = np.random.default_rng(0)
    for _ in range(n // 1000):
        accumulator.add(rng.standard_normal((1000, 1)))
    accumulator.end_piece()
    spectrum = accumulator.result()
    assert spectrum.freedom.sum() == pytest.approx(n // 1000 * 1000, abs=4)
    deviation = (spectrum.power[:, 0] * RATE - 1.0) / np.sqrt(2.0 / spectrum.freedom)
    # Standardised rows: mean 0 and variance 1 within five standard errors of m rows.
    assert abs(deviation.mean()) < 5.0 / np.sqrt(len(deviation))
    assert abs(deviation.var() - 1.0) < 5.0 * np.sqrt(4.0 / len(deviation))


def spectrum_of_noise(segments: int) -> Spectrum:
    """Return the spectrum of 2^17 values of noise, which come several times."""
    noise = np.random.default_rng(3).standard_normal((1 << 17, 1))
    accumulator = SpectrumAccumulator(RATE, 1)
    for _ in range(segments):
        accumulator.add(noise)
    accumulator.end_piece()
    return accumulator.result()


def test_averages_take_no_memory_until_the_record_ends():
    """The averages of 32 segments of 2^17 readings are 2 MiB."""
    noise = np.random.default_rng(3).standard_normal((1 << 17, 1))
    accumulator = SpectrumAccumulator(RATE, 1)
    accumulator.add(noise)
    tracemalloc.start()
    for _ in range(32):
        accumulator.add(noise)
    growth = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert growth < 2**19


def test_averages_stay_in_memory_without_a_place_for_files(tmp_path, monkeypatch):
    """No folder for temporary files, and a disk that is full after the first averages."""
    expected = spectrum_of_noise(3)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "absent"))
    without_folder = spectrum_of_noise(3)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))  # averages of 1.5 segments
    try:
        full_disk = spectrum_of_noise(3)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    for spectrum in (without_folder, full_disk):
        for values, expected_values in zip(spectrum, expected, strict=True):
            np.testing.assert_array_equal(values, expected_values)


def test_flat_floor_of_flicker_and_deviation_of_gauss_markov():
    tau = np.array([1e-4, 1.0, 189.0, 1e5])
    assert pytest.approx(0.664, abs=5e-4) == terms.FLICKER.deviation(tau)[0]
    curve = terms.gauss_markov_deviation(tau, 100.0)
    # IEEE 952: a walk of 2 sigma^2 / T before, white noise of 2 sigma^2 T after, 0.617 at 1.89 T.
    assert curve[0] == pytest.approx(np.sqrt(2.0 / 3.0 * 1e-4 / 100.0), rel=1e-3)
    assert curve[2] == pytest.approx(0.617, abs=1e-3)
    assert curve[3] == pytest.approx(np.sqrt(2.0 * 100.0 / 1e5), rel=1e-2)
