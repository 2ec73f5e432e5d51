# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The vehicle's vibration in a board's readings: spectra, coherence, intensity, and its absence."""

import numpy as np
import pytest

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.parameters import trajectory_layer

RATE = 200.0
BAND = {
    "imu.vibration.band_low": [10.0, 40.0],
    "imu.vibration.band_high": [30.0, 60.0],
    "imu.vibration.band_density": [
        *(0.01, 0.02, 0.03, 0.1, 0.2, 0.3),
        *(0.001, 0.0, 0.0, 0.0, 0.0, 0.05),
    ],
}


def residual(block_size=8192, duration=200.0, trajectory="static", **values):
    """Return reading minus ideal reading (n, 6) of an IMU with nothing but vibration."""
    settings = {"imu.preset": "perfect", "rate": RATE, "duration": duration, "seed": 3}
    parameters = load_simulation(trajectory_layer(trajectory), {**settings, **values})
    blocks = [samples["imu"] for samples in Body(parameters).windows(block_size)]
    return np.concatenate(
        [np.concatenate([b.gyro - b.ideal_gyro, b.accel - b.ideal_accel], axis=1) for b in blocks]
    )


def cross_density(values, low, high):
    """Return the mean two-sided cross-spectral density (6, 6) in a band, and its freedom."""
    size = 1000
    window = np.hanning(size + 2)[1:-1, None]
    parts = values[: len(values) // size * size].reshape(-1, size, 6)
    spectra = np.fft.rfft(window * parts, axis=1) / np.sqrt(RATE * np.sum(window**2))
    frequency = np.arange(size // 2 + 1) * RATE / size
    chosen = spectra[:, (frequency > low) & (frequency < high)].reshape(-1, 6)
    # Hann's window makes neighbours alike: two thirds of the frequencies count.
    return np.einsum("ki,kj->ij", chosen, chosen.conj()) / len(chosen), 2.0 * len(chosen) / 1.5


@pytest.fixture(scope="module")
def noise():
    coherence = np.zeros((2, 15, 2))
    coherence[0, 2] = [0.6, 0.5]  # gx and ax
    coherence[0, 14] = [-0.9, 0.0]  # ay and az
    return residual(**BAND, **{"imu.vibration.band_coherence": coherence.ravel().tolist()})


def test_bands_have_their_densities_and_nothing_lies_outside(noise):
    density, freedom = cross_density(noise, 11.0, 29.0)
    expected = np.square([0.01, 0.02, 0.03, 0.1, 0.2, 0.3])
    # A mean of freedom squares has the relative standard deviation sqrt(2 / freedom).
    assert np.all(np.abs(np.diag(density).real / expected - 1.0) < 4.0 * np.sqrt(2.0 / freedom))
    density, freedom = cross_density(noise, 41.0, 59.0)
    assert density[5, 5].real == pytest.approx(0.05**2, rel=4.0 * np.sqrt(2.0 / freedom))
    for low, high in ((1.0, 8.0), (32.0, 38.0), (62.0, 99.0)):
        assert np.all(np.diag(cross_density(noise, low, high)[0]).real < 1e-5 * expected)


def test_axes_are_coherent_as_given(noise):
    density, freedom = cross_density(noise, 11.0, 29.0)
    size = np.sqrt(np.diag(density).real)
    coherence = density / np.outer(size, size)
    # The real or imaginary part of an estimated coherence deviates by at most sqrt(1 / freedom).
    limit = 4.0 / np.sqrt(freedom)
    assert abs(coherence[0, 3] - (0.6 + 0.5j)) < limit
    assert abs(coherence[4, 5] + 0.9) < limit
    assert abs(coherence[0, 1]) < limit
    assert abs(coherence[3, 4]) < limit


def test_samples_do_not_depend_on_the_blocks():
    values = {
        **BAND,
        "imu.vibration.line_frequency": [33.3],
        "imu.vibration.line_amplitude": [0.1, 0.0, 0.0, 1.0, 0.0, 0.0],
        "imu.vibration.range_edges": [35.0],
        "imu.vibration.gyroscope_exponents": [1.0, 0.5, 0.2, 0.0, 0.0, 0.3],
        "trajectory.time_scale": 1.5,
    }
    whole = residual(duration=30.0, trajectory="figure_eight", **values)
    pieces = residual(block_size=377, duration=30.0, trajectory="figure_eight", **values)

    assert np.array_equal(whole, pieces)


def test_lines_keep_the_phases_between_axes():
    values = residual(
        duration=20.0,
        **{
            "imu.vibration.line_frequency": [33.0],
            "imu.vibration.line_amplitude": [0.1, 0.0, 0.2, 0.0, 1.0, 0.0],
            "imu.vibration.line_phase": [0.0, 0.0, 1.0, 0.0, -0.5, 0.0],
        },
    )
    t = np.arange(len(values)) / RATE
    parts = 2.0j * np.exp(-2j * np.pi * 33.0 * t) @ values / len(t)

    np.testing.assert_allclose(np.abs(parts), [0.1, 0.0, 0.2, 0.0, 1.0, 0.0], atol=1e-9)
    assert np.angle(parts[2] / parts[0]) == pytest.approx(1.0, abs=1e-9)
    assert np.angle(parts[4] / parts[0]) == pytest.approx(-0.5, abs=1e-9)


def test_intensity_follows_the_motion_with_the_given_power():
    """On a circle the rate is constant: the gyroscope's noise is (rate / reference)^p times it."""
    circle = {"trajectory": "circle", "duration": 30.0}
    plain = residual(**circle, **BAND)
    rate = 2.0 * np.pi / 20.0
    parameters = load_simulation(trajectory_layer("circle"), {"imu.preset": "perfect"})
    motion = Body(parameters).next(10)["imu"].motion
    rate = float(np.linalg.norm(motion.angular_velocity[0]))
    followed = residual(
        **circle,
        **BAND,
        **{
            "imu.vibration.gyroscope_exponents": [2.0, 0.0, 0.0],
            "imu.vibration.reference_motion": [rate / 3.0, 1.0, 1.0],
            "imu.vibration.motion_floor": 0.5,
        },
    )
    expected = (9.0 + 0.25) / (1.0 + 0.25)
    np.testing.assert_allclose(followed[:, :3], expected * plain[:, :3], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(followed[:, 3:], plain[:, 3:], rtol=1e-12)
    limited = residual(
        **circle,
        **BAND,
        **{
            "imu.vibration.gyroscope_exponents": [2.0, 0.0, 0.0],
            "imu.vibration.reference_motion": [rate / 3.0, 1.0, 1.0],
            "imu.vibration.motion_floor": 0.5,
            "imu.vibration.motion_ceiling": [1.5, 0.0, 0.0],
        },
    )
    np.testing.assert_allclose(limited[:, :3], 1.5**2 * plain[:, :3], rtol=1e-9, atol=1e-12)


def test_other_noise_is_the_same_with_and_without_vibration():
    sensor = {"imu.gyroscope_noise_density": 1e-3, "imu.accelerometer_random_walk": 1e-3}
    plain = residual(duration=10.0, **sensor)
    both = residual(duration=10.0, **sensor, **BAND)
    alone = residual(duration=10.0, **BAND)

    np.testing.assert_allclose(both - alone, plain, atol=1e-12)
    assert np.std(alone) > 0.0


def test_bands_above_half_the_rate_are_left_out():
    values = residual(
        duration=10.0,
        **{
            "imu.vibration.band_low": [150.0],
            "imu.vibration.band_high": [180.0],
            "imu.vibration.band_density": [1.0] * 6,
            "imu.vibration.line_frequency": [130.0],
            "imu.vibration.line_amplitude": [1.0] * 6,
        },
    )
    assert not values.any()


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"band_low": [1.0]}, "imu.vibration.band_high: 0 entries; must be 1, one for each band"),
        ({"line_frequency": [5.0]}, "imu.vibration.line_amplitude: 0 entries; must be 6, six"),
        (
            {"band_low": [5.0], "band_high": [4.0], "band_density": [1.0] * 6},
            "imu.vibration.band_high = 4: must be above band_low, 5 Hz",
        ),
        (
            {"band_low": [1.0, 3.0], "band_high": [4.0, 5.0], "band_density": [1.0] * 12},
            "imu.vibration.band_low = 3: must be at least 4 Hz",
        ),
        ({"range_edges": [5.0, 5.0]}, "imu.vibration.range_edges = [5.0, 5.0]: must increase"),
        ({"gyroscope_exponents": [1.0] * 6}, "6 entries; must be 0 or 3, three for each range"),
        (
            {
                "band_low": [2.0],
                "band_high": [4.0],
                "band_density": [1.0] * 6,
                # gx follows gy, gy follows gz, and gz is against gx
                "band_coherence": [1.0, 0.0, -1.0, *[0.0] * 9, 1.0, *[0.0] * 17],
            },
            "band_coherence: band 1, from 2 Hz: its matrix must be positive semidefinite",
        ),
        ({"band_coherence": [0.5] * 29}, "imu.vibration.band_coherence = "),
        ({"motion_time": 0.0}, "imu.vibration.motion_time = 0.0: must be"),
    ],
)
def test_contradictions_are_reported(values, problem):
    settings = {f"imu.vibration.{name}": value for name, value in values.items()}
    with pytest.raises(ConfigurationError) as caught:
        load_simulation({"imu.preset": "perfect", **settings})
    assert any(problem in line for line in caught.value.problems), caught.value.problems
