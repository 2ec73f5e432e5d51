# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effects of time, heat, blows and size on a board: each set alone and recovered."""

import math
from typing import Any

import numpy as np
import pytest
from scipy import integrate

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.sensors.environment import TemperatureParameters
from imu_sim_ros.sensors.errors.terms import ShockBias, Surroundings
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import TemperatureProfile
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

CYCLES = [0.0, 25.0, 400.0, 65.0, 800.0, 25.0, 1200.0, 65.0]
"""Two heatings and a cooling of 40 K at 0.1 K/s."""
EVERYTHING: dict[str, Any] = {
    "temperature.profile": [0.0, 25.0, 4.0, 45.0, 8.0, 30.0],
    "temperature.power": 0.2,
    "imu.gyroscope_temperature_hysteresis": 0.01,
    "imu.gyroscope_ageing_bias": 0.01,
    "imu.accelerometer_ageing_scale": 0.01,
    "imu.age_days": 30.0,
    "imu.stress_step_rate": 2.0,
    "imu.accelerometer_stress_step_sigma": 0.1,
    "imu.gyroscope_stress_step_sigma": 0.01,
    "imu.shock_threshold": 9.9,
    "imu.shock_recovery_time": 0.5,
    "imu.gyroscope_shock_bias_sigma": 0.01,
    "imu.gyroscope_noise_density": 1e-3,
    "imu.gyroscope_noise_correlation": [0.5, -0.3, 0.2],
    "imu.gyroscope_noise_temperature_coefficient": 0.02,
    "imu.gyroscope_g_squared_sensitivity": [1e-4] * 9,
    "imu.accelerometer_positions": [0.01, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, -0.01],
}


def simulation(**values: Any) -> Body:
    base = {"imu.preset": "perfect", "trajectory.type": "lecture"}
    return Body(load_simulation({**base, **values}))


def at_rest(count: int, **values: Any) -> Samples:
    return simulation(**{"trajectory.type": "static", **values}).next(count)["imu"]


def test_samples_do_not_depend_on_the_block() -> None:
    whole = simulation(**EVERYTHING).next(2000)["imu"]
    repeated = simulation(**EVERYTHING)
    parts = [repeated.next(n)["imu"] for n in (1, 7, 92, 0, 900, 1000)]
    for name in ("gyro", "accel", "gyro_bias", "accel_scale", "temperature"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert np.array_equal(joined, getattr(whole, name)), name


def test_truth_accounts_for_the_reading() -> None:
    without = ("noise", "g_squared")
    values = {k: v for k, v in EVERYTHING.items() if not any(word in k for word in without)}
    block = simulation(**values).next(2000)["imu"]
    assert block.gyro_bias.std() > 1e-3
    gyro = block.gyro_scale * block.ideal_gyro + block.gyro_bias
    accel = block.accel_scale * block.ideal_accel + block.accel_bias
    assert np.allclose(block.gyro, gyro, rtol=0.0, atol=1e-14)
    assert np.allclose(block.accel, accel, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("internal", [0.0, 400.0])
def test_an_oversampled_sensor_has_the_same_board(internal: float) -> None:
    values = {k: v for k, v in EVERYTHING.items() if "noise" not in k}
    fast = simulation(
        rate=50.0,
        **values,
        **{
            "imu.sampling": "oversampled",
            "imu.internal_rate": internal,
            "imu.gyroscope_bandwidth": 20.0,
            "imu.accelerometer_bandwidth": 20.0,
        },
    ).next(400)["imu"]
    slow = simulation(rate=50.0, **values).next(400)["imu"]
    # Jumps fall on the next reading inside the sensor, not on the next sample.
    nearly_equal = np.isclose(fast.gyro_bias, slow.gyro_bias, rtol=0.0, atol=2e-3).all(axis=1)
    assert np.mean(nearly_equal) > 0.9


def test_hysteresis_is_a_loop_of_the_stated_width() -> None:
    width = np.array([0.01, -0.02, 0.03])
    block = at_rest(
        12000,
        rate=10.0,
        **{
            "temperature.profile": CYCLES,
            "imu.gyroscope_temperature_hysteresis": width.tolist(),
            "imu.hysteresis_temperature": 2.0,
        },
    )
    bias = block.gyro_bias
    heating, cooling, again = 2000, 6000, 10000  # 45 degC each time, 20 K from the ends
    for heated in (heating, again):
        # s is +-1 but for what is left of the turn, 2 exp(-20 K / 2 K) at most.
        expected = width * (1.0 - 2.0 * math.exp(-10.0))
        assert np.allclose(bias[heated] - bias[cooling], expected, rtol=1e-4)


def test_hysteresis_solves_its_equation() -> None:
    span, width = 7.0, 0.02
    block = at_rest(
        12000,
        rate=10.0,
        **{
            "temperature.profile": CYCLES,
            "imu.accelerometer_temperature_hysteresis": width,
            "imu.hysteresis_temperature": span,
        },
    )
    s, t = [0.0], [0.0]
    for begin, end, direction in ((0.0, 400.0, 1.0), (400.0, 800.0, -1.0), (800.0, 1200.0, 1.0)):
        solution = integrate.solve_ivp(
            lambda _, y, d=direction: (d - y) * 0.1 / span,
            (begin, end),
            [s[-1]],
            t_eval=np.linspace(begin, end, 41)[1:],
            rtol=1e-10,
            atol=1e-12,
        )
        t += solution.t.tolist()
        s += solution.y[0].tolist()
    rows = np.round(np.array(t[1:-1]) * 10.0).astype(int)
    assert np.allclose(block.accel_bias[rows, 0], 0.5 * width * np.array(s[1:-1]), atol=1e-8)


def test_a_sensor_that_stands_still_in_temperature_keeps_its_branch() -> None:
    values = {
        "temperature.profile": [0.0, 25.0, 100.0, 65.0, 200.0, 65.0],
        "imu.gyroscope_temperature_hysteresis": 0.02,
        "imu.hysteresis_temperature": 1.0,
    }
    bias = at_rest(4000, rate=10.0, **values).gyro_bias
    assert np.allclose(bias[1500:], 0.01, atol=1e-12)


def test_ageing_drifts_with_the_logarithm_of_the_days() -> None:
    values = {"imu.gyroscope_ageing_bias": 0.01, "imu.accelerometer_ageing_scale": -0.002}
    new_board, aged_board = (at_rest(10, **values, **{"imu.age_days": age}) for age in (0.0, 999.0))
    assert np.allclose(aged_board.gyro_bias[0] - new_board.gyro_bias[0], 3 * 0.01, atol=1e-15)
    assert np.allclose(aged_board.accel_scale[0] - new_board.accel_scale[0], 3 * -0.002, atol=1e-15)
    day = at_rest(86401, rate=1.0, **values)
    assert np.allclose(day.gyro_bias[-1] - day.gyro_bias[0], 0.01 * math.log10(2.0), atol=1e-12)


def test_stress_steps_are_a_poisson_process_of_both_triads() -> None:
    rate, seconds = 0.02, 20000
    block = at_rest(
        seconds * 2,
        rate=2.0,
        **{
            "imu.stress_step_rate": rate,
            "imu.gyroscope_stress_step_sigma": [1e-3, 2e-3, 0.0],
            "imu.accelerometer_stress_step_sigma": 0.1,
        },
    )
    gyro, accel = np.diff(block.gyro_bias, axis=0), np.diff(block.accel_bias, axis=0)
    jumped = np.flatnonzero(gyro[:, 0])
    assert np.array_equal(jumped, np.flatnonzero(accel[:, 2]))
    assert not gyro[:, 2].any()
    # 400 expected: the deviation of a Poisson count is 20; steps within one sample are one here.
    assert abs(len(jumped) - rate * seconds) < 4 * math.sqrt(rate * seconds)
    # Relative error of a deviation from n = 400 normal numbers: 1 / sqrt(2 n) = 3.5 %.
    sizes = gyro[jumped, :2].std(axis=0) / [1e-3, 2e-3]
    assert np.all(np.abs(sizes - 1.0) < 4 / math.sqrt(2 * len(jumped)))
    gaps = np.diff(jumped) / 2.0  # exponential: the deviation equals the mean, to 1 / sqrt(n)
    assert abs(gaps.std() / gaps.mean() - 1.0) < 4 * math.sqrt(2.0 / len(gaps))


@pytest.mark.parametrize("tau", [0.0, 3.0])
def test_a_shock_leaves_a_bias_that_decays(tau: float) -> None:
    dt, n = 0.01, 2000
    imu = build(
        ImuParameters,
        {
            "gyroscope_shock_bias_sigma": [0.02, 0.02, 0.0],
            "shock_threshold": 50.0,
            "shock_recovery_time": tau,
        },
    )
    force = np.tile([0.0, 0.0, 9.81], (n, 1))
    for start, length in ((300, 5), (800, 1), (999, 4)):
        force[start : start + length, 0] = 100.0
    term = ShockBias("gyroscope", imu, 3, 1.0 / dt, imu.gyroscope)
    blocks = [(0, 301), (301, 1001), (1001, n)]
    blows = [
        term.next(Surroundings(np.zeros(end - start), force[start:end])) for start, end in blocks
    ]
    bias = np.concatenate(blows).T
    assert not bias[2].any()
    k = np.arange(n)
    decay = [
        np.where(k >= e, np.exp(-(k - e) * dt / tau) if tau else 1.0, 0.0) for e in (300, 800, 999)
    ]
    jumps = [bias[:2, 300], bias[:2, 800] - bias[:2, 799] * (math.exp(-dt / tau) if tau else 1.0)]
    jumps.append(bias[:2, 999] - bias[:2, 998] * (math.exp(-dt / tau) if tau else 1.0))
    assert np.all(np.abs(jumps) > 0.0)
    expected = sum(jump[:, None] * shape for jump, shape in zip(jumps, decay, strict=True))
    assert np.allclose(bias[:2], expected, rtol=0.0, atol=1e-12)


def test_sizes_of_shock_biases() -> None:
    imu = build(ImuParameters, {"accelerometer_shock_bias_sigma": 0.5, "shock_threshold": 50.0})
    force = np.zeros((4000, 3))
    force[::2, 1] = -60.0
    term = ShockBias("accelerometer", imu, 0, 100.0, imu.accelerometer)
    bias = term.next(Surroundings(np.zeros(4000), force))
    jumps = np.diff(bias[::2], axis=0)
    # 3 * 1999 numbers: relative error 1 / sqrt(2 n) = 0.9 %.
    assert abs(jumps.std() / 0.5 - 1.0) < 4 / math.sqrt(2 * jumps.size)


def test_a_hard_landing_shows_in_the_readings() -> None:
    values = {"imu.shock_threshold": 9.9, "imu.gyroscope_shock_bias_sigma": 0.01}
    block = simulation(**values).next(2000)["imu"]
    struck = np.linalg.norm(block.ideal_accel, axis=1) > 9.9
    begins = np.flatnonzero(struck[1:] & ~struck[:-1]) + 1
    jumps = np.flatnonzero(np.diff(block.gyro_bias[:, 0])) + 1
    assert len(begins) > 0
    assert set(jumps) <= {*begins.tolist(), 0}
    assert set(begins.tolist()) <= set(jumps.tolist())


def test_each_accelerometer_reads_at_its_own_place() -> None:
    positions = 0.05 * np.array([[1.0, 0.2, -0.3], [0.1, -0.8, 0.4], [-0.5, 0.6, 0.7]])
    block = simulation(**{"imu.accelerometer_positions": positions.ravel().tolist()})
    accel = block.next(1000)["imu"].accel
    for axis, position in enumerate(positions):
        shifted = simulation(**{"imu.lever_arm": position.tolist()}).next(1000)["imu"].accel
        assert np.allclose(accel[:, axis], shifted[:, axis], rtol=0.0, atol=1e-13)


def test_size_effect_with_mounting_and_lever_arm() -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # R_bi
    arm, r_z = np.array([0.1, 0.2, 0.3]), np.array([0.02, -0.01, 0.03])
    mounted = {"imu.mounting": turn.ravel().tolist()}
    elements = [0.0] * 6 + r_z.tolist()
    board = simulation(
        **mounted, **{"imu.lever_arm": arm.tolist(), "imu.accelerometer_positions": elements}
    ).next(500)["imu"]
    two = simulation(**mounted, **{"imu.lever_arm": (arm + turn @ r_z).tolist()}).next(500)["imu"]
    assert np.allclose(board.accel[:, 2], two.accel[:, 2], rtol=0.0, atol=1e-13)


def test_noise_is_correlated_between_axes_as_stated() -> None:
    correlation, density, rate, n = [0.6, -0.3, 0.4], np.array([1e-3, 2e-3, 3e-3]), 100.0, 200_000
    block = at_rest(
        n,
        rate=rate,
        **{
            "imu.gyroscope_noise_density": density.tolist(),
            "imu.gyroscope_noise_correlation": correlation,
        },
    )
    measured = np.corrcoef(block.gyro.T)
    for (i, j), rho in zip(((0, 1), (0, 2), (1, 2)), correlation, strict=True):
        # The deviation of a correlation from n pairs is (1 - rho^2) / sqrt(n).
        assert abs(measured[i, j] - rho) < 4 * (1.0 - rho**2) / math.sqrt(n)
    deviation = block.gyro.std(axis=0) / (density * math.sqrt(rate))
    assert np.all(np.abs(deviation - 1.0) < 4 / math.sqrt(2 * n))


def test_axes_may_be_one_and_the_same_noise() -> None:
    values = {"imu.gyroscope_noise_density": 1e-3, "imu.gyroscope_noise_correlation": 1.0}
    gyro = at_rest(1000, **values).gyro
    assert np.allclose(gyro[:, 0], gyro[:, 1], rtol=0.0, atol=1e-16)
    assert np.allclose(gyro[:, 0], gyro[:, 2], rtol=0.0, atol=1e-16)


def test_noise_grows_with_temperature() -> None:
    rate, n, density, k = 100.0, 100_000, 1e-2, np.array([0.01, 0.0, -0.02])
    block = at_rest(
        2 * n,
        rate=rate,
        **{
            "temperature.profile": [0.0, 25.0, 1000.0, 65.0],
            "temperature.interpolation": "steps",
            "imu.accelerometer_noise_density": density,
            "imu.accelerometer_noise_temperature_coefficient": k.tolist(),
        },
    )
    for rows, warmer in ((slice(0, n), 0.0), (slice(n, 2 * n), 40.0)):
        deviation = block.accel[rows].std(axis=0) / (density * math.sqrt(rate))
        assert np.all(np.abs(deviation / (1.0 + k * warmer) - 1.0) < 4 / math.sqrt(2 * n))


def test_noise_does_not_become_negative() -> None:
    values = {
        "temperature.value": 125.0,
        "imu.gyroscope_noise_density": 1e-3,
        "imu.gyroscope_noise_temperature_coefficient": -0.02,
    }
    assert not at_rest(100, **values).gyro.any()


def test_the_gyroscope_reads_squares_of_the_force_by_its_matrix() -> None:
    h = 1e-5 * np.arange(1.0, 10.0).reshape(3, 3)
    block = simulation(**{"imu.gyroscope_g_squared_sensitivity": h.ravel().tolist()})
    samples = block.next(500)["imu"]
    expected = samples.ideal_gyro + np.square(samples.ideal_accel) @ h.T
    assert np.allclose(samples.gyro, expected, rtol=0.0, atol=1e-15)


def test_vibration_is_rectified_by_g_squared_sensitivity() -> None:
    amplitude, h = 20.0, 1e-5
    block = at_rest(
        2000,
        rate=100.0,
        **{
            "trajectory.vibration.frequency": [37.0],
            "trajectory.vibration.acceleration": [amplitude, 0.0, 0.0],
            "imu.gyroscope_g_squared_sensitivity": [h, 0.0, 0.0] * 3,
        },
    )
    # The mean of a squared sinusoid over whole periods (370 of them in 10 s).
    assert np.allclose(block.gyro[:1000].mean(axis=0), h * amplitude**2 / 2.0, rtol=1e-9)


def test_warm_up_is_two_exponentials() -> None:
    power, resistance, tau = 0.5, [60.0, 30.0], [20.0, 300.0]
    profile = TemperatureProfile(
        build(
            TemperatureParameters,
            {
                "value": 20.0,
                "power": power,
                "thermal_resistance": resistance,
                "warm_up_time": tau,
            },
        )
    )
    t = np.array([0.0, 1.0, 20.0, 300.0, 1e5])
    rise = sum(power * r * (1.0 - np.exp(-t / x)) for r, x in zip(resistance, tau, strict=True))
    assert np.allclose(profile.at(t), 20.0 + rise, rtol=0.0, atol=1e-12)
    assert profile.at(t)[-1] == pytest.approx(65.0)


def test_a_board_warms_up_in_a_changing_room() -> None:
    temperature = {"profile": [0.0, 20.0, 100.0, 40.0], "time_constant": 30.0}
    t = np.linspace(0.0, 500.0, 101)
    without = TemperatureProfile(build(TemperatureParameters, temperature)).at(t)
    heated = TemperatureProfile(
        build(TemperatureParameters, {**temperature, "power": 1.0, "warm_up_time": [0.0, 50.0]})
    ).at(t)
    rise = 60.0 - 30.0 * np.expm1(-t / 50.0)
    assert np.allclose(heated - without, rise, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"imu.gyroscope_stress_step_sigma": 0.1}, "imu.stress_step_rate = 0: must be above 0"),
        ({"imu.accelerometer_shock_bias_sigma": 0.1}, "imu.shock_threshold = 0: must be above 0"),
        ({"imu.gyroscope_noise_correlation": [0.9, 0.9, -0.9]}, "positive semidefinite"),
        ({"imu.gyroscope_noise_correlation": 1.5}, "imu.gyroscope_noise_correlation = 1.5"),
        ({"temperature.warm_up_time": [1.0, 2.0, 3.0, 4.0]}, "temperature.warm_up_time: must be"),
        ({"temperature.power": -1.0}, "temperature.power = -1"),
        ({"imu.hysteresis_temperature": 0.0}, "imu.hysteresis_temperature = 0"),
        ({"imu.accelerometer_g_squared_sensitivity": [0.0] * 9}, "unknown"),
    ],
)
def test_contradictions_are_reported(values: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        simulation(**values)
    assert line in str(caught.value)
