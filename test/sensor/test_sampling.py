# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Averaged, oversampled and counted readings against closed forms, above Nyquist as well."""

import numpy as np
import pytest

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.sensors.errors.triad import variance_discrete
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

RATE = 200.0
BASE = {"imu.preset": "perfect", "trajectory.type": "static", "rate": RATE}


def simulation(**values):
    parameters = {name.replace("__", "."): value for name, value in values.items()}
    return Body(load_simulation({**BASE, **parameters}))


def read_samples(count=2000, **values):
    return simulation(**values).next(count)["imu"]


def shaken(frequency, acceleration, **values):
    return read_samples(
        trajectory__vibration__frequency=[frequency],
        trajectory__vibration__acceleration=acceleration,
        **values,
    )


@pytest.mark.parametrize("frequency", [30.0, 99.0, 390.0, 1234.5])
def test_mean_of_a_vibration_is_that_of_the_sinusoid(frequency):
    """The mean of A sin(w t) over h is A sinc(f h) sin(w (t - h / 2)), however far beyond Nyquist.

    Three nodes gave 4.57 m/s^2 instead of 0.252 at 390 Hz.
    """
    block = shaken(frequency, [10.0, 0.0, 0.0], imu__sampling="averaged")
    t, h = (block.true_t_ns[1:] - block.true_t_ns[0]) * 1e-9, 1 / RATE
    expected = 10.0 * np.sinc(frequency * h) * np.sin(2 * np.pi * frequency * (t - 0.5 * h))
    np.testing.assert_allclose(block.accel[1:, 0], expected, atol=1e-5)


def test_mean_with_turning_gravity_and_lever_arm_is_that_of_many_instants():
    """Against Simpson's rule with 100 steps per interval."""
    values = {
        "trajectory__type": "lecture",
        "trajectory__vibration__frequency": [390.0, 170.0],
        "trajectory__vibration__acceleration": [10.0, 3.0, 0.0, 0.0, 0.0, 5.0],
        "trajectory__vibration__angular_rate": [0.0, 2.0, 1.0, 3.0, 0.0, 0.0],
        "imu__lever_arm": [0.1, 0.0, 0.05],
    }
    block = read_samples(50, imu__sampling="averaged", **values)
    fine = read_samples(49 * 100 + 1, **{**values, "rate": RATE * 100})
    weights = np.ones(101)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    weights /= weights.sum()
    for means, instants in ((block.gyro, fine.gyro), (block.accel, fine.accel)):
        for k in (1, 20, 49):
            piece = instants[(k - 1) * 100 : k * 100 + 1]
            np.testing.assert_allclose(means[k], weights @ piece, atol=3e-5)


@pytest.mark.parametrize("ask", [Body.warnings, lambda body: body.next(1)])
def test_frequencies_that_cannot_be_averaged_over_are_refused_before_the_first_sample(ask):
    body = simulation(
        imu__sampling="averaged",
        trajectory__vibration__frequency=[20000.0],
        trajectory__vibration__acceleration=[1.0, 0.0, 0.0],
    )
    with pytest.raises(ConfigurationError, match="20000 Hz, 100 times the rate; at most 50"):
        ask(body)


OVERSAMPLED = {
    "imu__sampling": "oversampled",
    "imu__internal_rate": 3200.0,
    "imu__gyroscope_bandwidth": 60.0,
    "imu__accelerometer_bandwidth": 60.0,
}


@pytest.mark.parametrize("frequency", [20.0, 150.0, 390.0])
def test_readings_are_as_large_and_as_late_as_the_filter_makes_them(frequency):
    """A Butterworth filter of order 2 at 3200 Hz, and of every 16 readings the last, at its time.

    ``1 / (s^2 + sqrt(2) s + 1)`` with the bilinear transform's s; from 100 Hz on it is an alias.
    The first of the 16 would be 4.7 ms early: 0.6 rad at 20 Hz.
    """
    block = shaken(frequency, [10.0, 0.0, 0.0], **OVERSAMPLED)
    t = block.true_t_ns[200:] * 1e-9
    wave = np.exp(2j * np.pi * frequency * t)
    response = 2j * np.mean(block.accel[200:, 0] / wave)  # of 10 sin(w t) it is 10
    s = 1j * np.tan(np.pi * frequency / 3200.0) / np.tan(np.pi * 60.0 / 3200.0)
    assert response == pytest.approx(10.0 / (s * s + np.sqrt(2.0) * s + 1.0), rel=1e-3)


def test_vibration_is_rectified_ahead_of_the_filter():
    """q x^2 of a sinusoid has the mean q A^2 / 2, which no filter behind it takes away."""
    block = shaken(790.0, [20.0, 0.0, 0.0], imu__accelerometer_quadratic=1e-3, **OVERSAMPLED)
    assert block.accel[200:, 0].mean() == pytest.approx(1e-3 * 400.0 / 2.0, rel=1e-3)


def test_noise_of_an_oversampled_sensor_has_the_stated_variance():
    """White at the internal rate, filtered, decimated: as the messages' covariance says.

    The filter leaves neighbours correlated: some 10,000 independent values, 1.5 %; three of these.
    """
    settings = {"imu__accelerometer_noise_density": 2e-3, **OVERSAMPLED}
    run = simulation(**settings)
    block = run.next(20_000)["imu"]
    stated = variance_discrete(run.parameters.imu, "accelerometer", RATE)
    np.testing.assert_allclose((block.accel - [0, 0, 9.81]).var(axis=0), stated, rtol=0.045)
    # A second-order Butterworth passes pi / (2 sqrt 2) of its cut-off: 2 N^2 f pi / (2 sqrt 2).
    assert stated[0] == pytest.approx(4e-6 * 2 * 60.0 * 1.1107, rel=0.01)


def test_an_oversampled_sensor_at_rest_has_its_biases():
    block = read_samples(
        500,
        imu__gyroscope_bias=[0.01, 0.0, -0.02],
        imu__accelerometer_rate_ramp=1e-3,
        imu__gyroscope_random_walk=1e-3,
        **OVERSAMPLED,
    )
    np.testing.assert_allclose(block.gyro_bias[0], [0.01, 0.0, -0.02], atol=1e-3)
    t = (block.true_t_ns - block.true_t_ns[0]) * 1e-9
    np.testing.assert_allclose(block.accel_bias[:, 1], 1e-3 * t, atol=1e-5)
    # The reading follows with the filter's delay of some milliseconds.
    np.testing.assert_allclose(block.gyro, block.gyro_bias, atol=1e-3)


def test_an_oversampled_rate_of_eight_by_default():
    eight = {**OVERSAMPLED, "imu__internal_rate": 8 * RATE, "imu__gyroscope_noise_density": 1e-3}
    default = {**eight, "imu__internal_rate": 0.0}
    np.testing.assert_array_equal(
        read_samples(300, **eight).gyro, read_samples(300, **default).gyro
    )


COUNTED = {
    "imu__sampling": "averaged",
    "imu__gyroscope_increment_resolution": 1e-4,
    "imu__accelerometer_increment_resolution": 2e-3,
}


def test_increments_are_whole_steps_whose_sum_is_the_rounded_sum():
    noise = {"imu__gyroscope_noise_density": 1e-4, "imu__accelerometer_noise_density": 2e-3}
    counted, exact = (
        read_samples(5000, trajectory__type="lecture", **settings)
        for settings in ({**COUNTED, **noise}, {"imu__sampling": "averaged", **noise})
    )
    for rounded, smooth, step in (
        (counted.gyro, exact.gyro, 1e-4),
        (counted.accel, exact.accel, 2e-3),
    ):
        counts = rounded / RATE / step
        np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)
        drift = np.cumsum(rounded - smooth, axis=0) / RATE
        assert np.abs(drift).max() <= 0.5 * step * (1 + 1e-9)
        assert np.abs(drift).max() > 0.45 * step
        # What is left is uniform in one step: Q = step / sqrt(12), IEEE Std 952-1997, C.1.5.
        np.testing.assert_allclose(drift.std(axis=0), step / np.sqrt(12), rtol=0.05)


def test_variance_of_counted_readings_is_stated():
    """Two roundings per increment: step^2 / 6, where the noise is spread over steps."""
    settings = {**COUNTED, "imu__accelerometer_noise_density": 2e-2}
    run = simulation(**settings)
    accel = run.next(40_000)["imu"].accel
    stated = variance_discrete(run.parameters.imu, "accelerometer", RATE)
    np.testing.assert_allclose(accel.var(axis=0), stated, rtol=4 * np.sqrt(2 / 40_000))


@pytest.mark.parametrize(
    "settings",
    [
        {**OVERSAMPLED, "imu__internal_rate": 500.0},
        {**OVERSAMPLED, "imu__internal_rate": 200.0},
    ],
)
def test_internal_rate_must_be_a_multiple(settings):
    with pytest.raises(ConfigurationError, match="internal_rate = .* integer multiple of the rate"):
        simulation(**settings)


def test_contradictions_are_reported():
    with pytest.raises(ConfigurationError) as caught:
        simulation(imu__sampling="oversampled", imu__gyroscope_increment_resolution=1e-6)
    assert len(caught.value.problems) == 3  # both bandwidths, and increments that are no means
    with pytest.raises(ConfigurationError, match="half the internal rate, 1600 Hz"):
        simulation(**{**OVERSAMPLED, "imu__gyroscope_bandwidth": 1600.0})
