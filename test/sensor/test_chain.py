# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The deterministic terms, temperature, digital output and covariance against closed forms."""

import math

import numpy as np
import pytest
from scipy import signal

from imu_sim_ros.core.conventions import ERRORS, TRIADS
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.sensors.environment import TemperatureParameters
from imu_sim_ros.sensors.errors.realised import realise_unit
from imu_sim_ros.sensors.errors.triad import noise_gain, variance_discrete
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import TemperatureProfile
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

S = np.array([[1.01, 0.002, -0.003], [0.004, 0.98, 0.005], [-0.006, 0.007, 1.02]])
G_SENSITIVITY = np.array([[1e-3, 2e-3, 3e-3], [4e-3, 5e-3, 6e-3], [7e-3, 8e-3, 9e-3]])


def simulation(**values: object) -> Body:
    """Return a simulation of the lecture's trajectory, where all axes move."""
    base = {"imu.preset": "perfect", "trajectory.type": "lecture"}
    return Body(load_simulation({**base, **values}))


def read_samples(count: int = 500, **values: object) -> Samples:
    return simulation(**values).next(count)["imu"]


def sensor(**values: object) -> dict[str, object]:
    return {f"imu.{name}": value for name, value in values.items()}


def test_scale_and_misalignment_matrix() -> None:
    flat = S.ravel().tolist()
    block = read_samples(
        **sensor(gyroscope_scale_misalignment=flat, accelerometer_scale_misalignment=flat)
    )
    assert np.allclose(block.gyro, block.ideal_gyro @ S.T, atol=1e-15)
    assert np.allclose(block.accel, block.ideal_accel @ S.T, atol=1e-14)


def test_percent_forms_are_the_same_matrix() -> None:
    error = 100.0 * (S - np.eye(3))
    cross = [error[i, j] for i, j in ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))]
    block = read_samples(
        **sensor(
            accelerometer_scale_error_percent=np.diag(error).tolist(),
            accelerometer_misalignment_percent=cross,
        )
    )
    assert np.allclose(block.accel, block.ideal_accel @ S.T, atol=1e-13)


def test_quadratic_and_g_sensitivity_and_bias() -> None:
    q, b = np.array([1e-3, -2e-3, 3e-3]), np.array([0.1, 0.2, -0.3])
    block = read_samples(
        **sensor(
            gyroscope_quadratic=q.tolist(),
            gyroscope_g_sensitivity=G_SENSITIVITY.ravel().tolist(),
            gyroscope_bias=b.tolist(),
            gyroscope_scale_misalignment=S.ravel().tolist(),
        )
    )
    x, f = block.ideal_gyro, block.ideal_accel
    assert np.allclose(block.gyro, x @ S.T + q * x**2 + f @ G_SENSITIVITY.T + b, atol=1e-14)
    assert np.array_equal(block.gyro_bias, np.tile(b, (500, 1)))
    assert np.array_equal(block.accel, block.ideal_accel)


def test_scale_acts_on_the_response_and_not_on_the_bias() -> None:
    values = sensor(
        gyroscope_bias=1.0,
        gyroscope_scale_misalignment=S.ravel().tolist(),
        gyroscope_temperature_scale=[0.01, 0.02, 0.03],
        gyroscope_turn_on_scale_sigma=0.1,
    )
    block = read_samples(**values, **{"temperature.value": 30.0})
    assert np.ptp(block.gyro_scale, axis=0).max() == 0.0
    assert np.allclose(block.gyro, block.gyro_scale * (block.ideal_gyro @ S.T) + 1.0, atol=1e-14)
    turn_on = read_samples(**{**values, "imu.gyroscope_temperature_scale": []}).gyro_scale[0]
    assert np.allclose(block.gyro_scale[0] - turn_on, [0.05, 0.10, 0.15])


def test_truth_accounts_for_the_reading() -> None:
    """reading = scale * ideal + bias, with everything but S, q, G, noise and output on."""
    values = sensor(
        accelerometer_bias=0.1,
        accelerometer_random_walk=0.01,
        accelerometer_gauss_markov_sigma=0.1,
        accelerometer_correlation_time=1.0,
        accelerometer_bias_instability=0.01,
        accelerometer_rate_ramp=0.01,
        accelerometer_turn_on_bias_sigma=0.1,
        accelerometer_turn_on_scale_sigma=0.01,
        accelerometer_temperature_bias=[0.01, 0.02, 0.03, 1e-4, 2e-4, 3e-4],
        accelerometer_temperature_scale=[1e-3, 2e-3, 3e-3],
    )
    block = read_samples(**values, **{"temperature.profile": [0.0, 20.0, 2.0, 50.0]})
    explained = block.accel_scale * block.ideal_accel + block.accel_bias
    assert np.allclose(block.accel, explained, atol=1e-13)
    assert np.ptp(block.accel_bias, axis=0).min() > 0.1
    assert np.ptp(block.accel_scale, axis=0).min() > 0.01


STEP, RANGE = 0.002, 9.9
EVERY_TERM: dict[str, object] = {
    "imu.preset": "mpu6000",
    "rate": 100.0,
    "temperature.profile": [0.0, 20.0, 2.0, 50.0],
    "imu.age_days": 30.0,
    **{
        f"imu.{triad}_{name}": value
        for triad in TRIADS
        for name, value in {
            "misalignment_sigma": 0.01,
            "quadratic_sigma": 1e-3,
            "turn_on_scale_sigma": 0.01,
            "temperature_scale": [1e-3, 2e-3, 3e-3],
            "ageing_scale": 0.01,
            "ageing_bias": 0.01,
            "bandwidth": [30.0, 20.0, 10.0],
            "noise_temperature_coefficient": 0.01,
            "resolution": STEP,
            "range": RANGE,
        }.items()
    },
    "imu.gyroscope_g_sensitivity_sigma": 1e-3,
    "imu.vibration.line_frequency": [17.0],
    "imu.vibration.line_amplitude": [0.01, 0.0, 0.0, 0.0, 0.0, 0.3],
}


@pytest.mark.parametrize("sampling", ["instantaneous", "averaged", "oversampled"])
def test_the_truths_explain_every_digit_of_the_reading(sampling: str) -> None:
    """Rounded and saturated, the sum of the ideal reading and all truths is the reading.

    Rounding of the sum, 1e-15, takes a value across the middle of two steps in 1 of 1e12.
    """
    rates = {"imu.internal_rate": 800.0} if sampling == "oversampled" else {}
    run = simulation(**EVERY_TERM, **{"imu.sampling": sampling}, **rates)
    block, imu, limit = run.next(600)["imu"], run.parameters.imu, math.floor(RANGE / STEP)
    for triad, name in zip(TRIADS, ("gyro", "accel"), strict=True):
        x, reading = getattr(block, f"ideal_{name}"), getattr(block, name)
        truths = {error: getattr(block, f"{name}_{error}") for error in ERRORS}
        for error, values in truths.items():
            assert np.ptp(values) > 1e-3, error
        unit = realise_unit(imu.triad(triad), triad, run.parameters.seed)
        response = x @ unit.response().T + np.array(unit.quadratic) * x**2
        response += block.ideal_accel @ np.reshape(unit.g_sensitivity, (3, 3)).T
        scale = truths.pop("scale")
        np.testing.assert_allclose(truths["response_error"], scale * response - x, atol=1e-14)
        total = np.rint((x + sum(truths.values())) / STEP)
        np.testing.assert_array_equal(reading, np.clip(total, -limit, limit) * STEP)
    assert np.abs(total).max() > limit


def test_biases_and_scales_follow_polynomials_of_the_temperature() -> None:
    block = read_samples(
        **sensor(
            gyroscope_temperature_bias=[0.1, 0.2, 0.3, 0.01, 0.02, 0.03],
            gyroscope_temperature_scale=[0.0, 0.0, 1e-3],
            reference_temperature=20.0,
        ),
        **{"temperature.value": 30.0},
    )
    assert np.allclose(block.temperature, 30.0)
    assert np.allclose(block.gyro_bias, [2.0, 4.0, 6.0])
    assert np.allclose(block.gyro_scale, [1.0, 1.0, 1.01])


def profile(**values: object) -> TemperatureProfile:
    return TemperatureProfile(build(TemperatureParameters, values))


def test_temperature_ramp_and_steps() -> None:
    t = np.array([0.0, 5.0, 10.0, 15.0, 20.0, 30.0])
    nodes = [10.0, 20.0, 20.0, 60.0]
    assert profile(value=40.0).at(t).tolist() == [40.0] * 6
    assert profile(value=40.0, profile=nodes).at(t).tolist() == [40, 30, 20, 40, 60, 60]
    steps = profile(value=40.0, profile=nodes, interpolation="steps")
    assert steps.at(t).tolist() == [40, 40, 20, 20, 60, 60]


@pytest.mark.parametrize("interpolation", ["linear", "steps"])
def test_thermal_lag_solves_its_equation(interpolation: str) -> None:
    """tau dT/dt = T_a - T, integrated by small steps of the classical Runge-Kutta method."""
    values = {"value": 20.0, "profile": [10.0, 50.0, 30.0, 10.0], "interpolation": interpolation}
    ambient, lagged = profile(**values), profile(**values, time_constant=7.0)
    h = 0.05
    t = h * np.arange(1200)
    middle = ambient.at(t + 0.5 * h)
    expected = [20.0]
    for k in range(len(t) - 1):
        # Within a step the ambient temperature is a straight line; its ends are taken from the
        # inside, so that a jump at a step's start counts.
        slope = (ambient.at(np.array([t[k] + 0.9 * h]))[0] - middle[k]) / (0.4 * h)
        start, end = middle[k] - 0.5 * h * slope, middle[k] + 0.5 * h * slope
        x = expected[-1]
        k1 = (start - x) / 7.0
        k2 = (middle[k] - x - 0.5 * h * k1) / 7.0
        k3 = (middle[k] - x - 0.5 * h * k2) / 7.0
        k4 = (end - x - h * k3) / 7.0
        expected.append(x + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4))
    assert np.allclose(lagged.at(t), expected, atol=1e-8)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_low_pass_has_its_cut_off_and_slope(order: int) -> None:
    """|H|^2 = 1/2 at the cut-off, and 1 / (1 + u^(2 n)) elsewhere."""
    rate, cutoff = 200.0, 20.0
    for f in (5.0, 20.0, 40.0):
        roll = {"amplitude": [0.01], "angular_frequency": [2 * np.pi * f]}
        block = read_samples(
            4000,
            rate=rate,
            **{"trajectory.type": "harmonic"},
            **{f"trajectory.roll.{name}": value for name, value in roll.items()},
            **sensor(gyroscope_bandwidth=cutoff, bandwidth_order=order),
        )
        x, y = block.ideal_gyro[2000:, 0], block.gyro[2000:, 0]
        u = math.tan(math.pi * f / rate) / math.tan(math.pi * cutoff / rate)
        assert np.std(y) / np.std(x) == pytest.approx((1 + u ** (2 * order)) ** -0.5, rel=1e-6)


def test_low_pass_starts_settled() -> None:
    block = read_samples(
        50, **{"trajectory.type": "static"}, **sensor(accelerometer_bandwidth=10.0)
    )
    assert np.allclose(block.accel, block.ideal_accel, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2, 8])
@pytest.mark.parametrize("cutoff", [0.5, 20.0, 99.0])
def test_noise_gain_is_the_sum_of_the_squared_impulse_response(cutoff: float, order: int) -> None:
    sections = signal.butter(order, cutoff, fs=200.0, output="sos")
    impulse = np.zeros(20_000)
    impulse[0] = 1.0
    expected = np.sum(signal.sosfilt(sections, impulse) ** 2)
    assert noise_gain(cutoff, order, 200.0) == pytest.approx(expected, rel=1e-6)
    assert noise_gain(0.0, order, 200.0) == 1.0


def test_saturation_and_quantisation() -> None:
    block = read_samples(
        **sensor(accelerometer_range=[0.0, 5.0, 9.0], accelerometer_resolution=[0.0, 0.0, 0.25])
    )
    assert np.array_equal(block.accel[:, 0], block.ideal_accel[:, 0])
    assert np.array_equal(block.accel[:, 1], np.clip(block.ideal_accel[:, 1], -5.0, 5.0))
    expected = np.rint(np.clip(block.ideal_accel[:, 2], -9.0, 9.0) / 0.25) * 0.25
    assert np.array_equal(block.accel[:, 2], expected)
    assert block.accel[:, 2].max() == 9.0


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_covariance_is_the_variance_of_the_samples(rate: float) -> None:
    """White noise, low-pass and rounding together; n samples, the low-pass keeps over half of them.

    The relative deviation of a variance is sqrt(2 / n) for white noise, and below sqrt(4 / n) for
    noise that a low-pass at a quarter of the rate leaves.
    """
    n = 200_000
    run = Body(
        load_simulation(
            {
                "imu.preset": "perfect",
                "trajectory.type": "static",
                "rate": rate,
                **sensor(
                    gyroscope_noise_density=[0.01, 0.02, 0.03],
                    gyroscope_bandwidth=[0.0, 0.25 * rate, 0.25 * rate],
                    gyroscope_resolution=[0.01, 0.02, 0.25],
                    accelerometer_noise_density=[0.02, 0.0, 0.1],
                ),
            }
        )
    )
    block = run.next(n)["imu"]
    imu = run.parameters.imu
    ratio = block.gyro.var(axis=0) / variance_discrete(imu, "gyroscope", rate)
    assert np.abs(ratio - 1.0).max() < 5.0 * np.sqrt(4.0 / n)
    x, y, z = variance_discrete(imu, "accelerometer", rate)
    assert (x, y) == (pytest.approx(0.02**2 * rate), 0.0)
    assert block.accel[:, 2].var() / z == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / n))


def test_perfect_sensor_has_no_error_at_all() -> None:
    block = read_samples()
    assert np.array_equal(block.gyro, block.ideal_gyro)
    assert np.array_equal(block.accel, block.ideal_accel)
    assert np.array_equal(block.t_ns, block.true_t_ns)
    assert np.array_equal(block.release_t_ns, block.true_t_ns)
    assert np.array_equal(block.delivered, np.arange(500))
    assert not block.gyro_bias.any()
    assert not block.accel_bias.any()
    assert (block.gyro_scale == 1.0).all()
    assert (block.accel_scale == 1.0).all()
