# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The barometer against the tables of the standard atmosphere and formulas written down anew."""

import itertools
import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from simulation_runs import read_all, same_bytes

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.barometer.model import Atmosphere
from imu_sim_ros.sensors.environment import AtmosphereParameters
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

BASE: dict[str, Any] = {"imu.preset": "perfect", "trajectory.type": "lecture", "rate": 200.0}
RANDOM = {
    "imu.barometer_noise_density": 0.2,
    "imu.barometer_random_walk": 0.1,
    "imu.barometer_bias_instability": 0.5,
    "imu.barometer_gauss_markov_sigma": 20.0,
    "imu.barometer_correlation_time": 5.0,
    "imu.barometer_turn_on_bias_sigma": 50.0,
    "imu.barometer_temperature_bias_sigma": 1.5,
    "imu.barometer_gust_rate": 3.0,
    "imu.barometer_gust_sigma": 10.0,
    "imu.barometer_resolution": 0.16,
    "imu.dropout_probability": 0.1,
    "imu.barometer_rate": 26.3,
    "imu.barometer_time_offset": 0.0071,
}


def simulation(*layers: dict[str, Any]) -> Body:
    values = dict(BASE)
    for layer in layers:
        values.update(layer)
    return Body(load_simulation(values), sensors=("pressure",))


pressure = partial(read_all, quantity="pressure")


@pytest.mark.parametrize(
    ("height", "expected"),
    [
        # U.S. Standard Atmosphere, 1976, table I: geometric height [m], pressure [Pa].
        (-1000.0, 1.1393e5),
        (0.0, 1.01325e5),
        (1000.0, 8.9876e4),
        (5000.0, 5.4048e4),
        (11000.0, 2.2700e4),
        (20000.0, 5.5293e3),
        (30000.0, 1.1970e3),
        (50000.0, 7.9779e1),
        (70000.0, 5.2209e0),
    ],
)
def test_the_pressure_is_that_of_the_standard_s_table(height: float, expected: float) -> None:
    pressure_there = Atmosphere(AtmosphereParameters()).pressure(np.array([height]))[0]
    assert pressure_there == pytest.approx(expected, rel=5e-5)


def test_beyond_the_standard_s_layers_the_pressure_falls_exponentially() -> None:
    """The pressure at 84,852 m (geopotential) and 186.946 K is 0.37338 Pa (table I)."""
    geopotential = np.array([84852.0, 100e3, 1000e3])
    height = 6356766.0 * geopotential / (6356766.0 - geopotential)
    pressure_there = Atmosphere(AtmosphereParameters()).pressure(height)
    scale = 8.31432 / 0.0289644 * 186.946 / 9.80665
    expected = 0.37338 * np.exp((84852.0 - geopotential) / scale)
    assert np.allclose(pressure_there, expected, rtol=2e-5, atol=0.0)


def test_the_pressure_is_the_solution_of_its_differential_equation() -> None:
    """``dp/dH = -g p / (R T(H))``, integrated numerically through four layers, on a warm day."""
    bases, lapse = [0.0, 11e3, 20e3, 32e3, 47e3], [-6.5e-3, 0.0, 1e-3, 2.8e-3]
    radius, air = 6356766.0, 8.31432 / 0.0289644
    warmth = 30.0 + 273.15

    def slope(h: float, log_p: Any) -> list[float]:
        t = warmth
        for base, top, rate in zip(bases, bases[1:], lapse, strict=False):
            t += rate * (min(max(h, base), top) - base)
        return [-9.80665 / (air * t)]

    log_p = math.log(99000.0)
    atmosphere = Atmosphere(
        AtmosphereParameters(sea_level_pressure=99000.0, sea_level_temperature=30.0)
    )
    for low, high in itertools.pairwise(bases):
        inner = np.linspace(low, high, 4)
        solved = solve_ivp(slope, (low, high), [log_p], t_eval=inner, rtol=1e-12, atol=1e-13)
        geometric = radius * inner / (radius - inner)
        assert np.allclose(atmosphere.pressure(geometric), np.exp(solved.y[0]), rtol=1e-9)
        log_p = float(solved.y[0][-1])


def test_the_reading_is_the_formula_at_the_imu_s_place() -> None:
    values = {
        "height": 120.0,
        "imu.lever_arm": [0.4, -0.3, 0.5],
        "imu.barometer_bias": 25.0,
        "temperature.value": 35.0,
        "imu.barometer_temperature_bias": [1.5, 0.01],
        "imu.barometer_rate": 70.0,
        "imu.barometer_time_offset": 0.003,
    }
    run = simulation(values)
    samples = pressure(run, 333, 1000)
    assert np.array_equal(
        samples.true_t_ns, 10**9 + 3_000_000 + np.rint(np.arange(350) * 1e9 / 70).astype(int)
    )
    motion = run.trajectory.sample((samples.true_t_ns - 10**9) * 1e-9)
    arm = Rotation.from_quat(motion.q_wb[:, [1, 2, 3, 0]]).apply(values["imu.lever_arm"])
    height = 120.0 + motion.position[:, 2] + arm[:, 2]
    geopotential = 6356766.0 * height / (6356766.0 + height)
    exponent = 9.80665 * 0.0289644 / (8.31432 * 0.0065)
    expected = 101325.0 * (1.0 - 0.0065 * geopotential / 288.15) ** exponent
    assert np.allclose(samples.ideal_pressure, expected, rtol=1e-12)
    assert np.allclose(samples.pressure - samples.ideal_pressure, 25.0 + 15.0 + 1.0, atol=1e-9)
    assert np.allclose(samples.bias, 41.0, atol=1e-9)


@pytest.mark.parametrize("size", [1, 7, 64, 1000])
def test_samples_do_not_depend_on_the_block_size(size: int) -> None:
    count = 300 if size == 1 else 4000
    whole, pieces = (pressure(simulation(RANDOM), s, count) for s in (count, size))
    assert same_bytes(whole, pieces)


def test_noise_and_gusts_have_the_stated_size() -> None:
    values = {"trajectory.type": "static", "imu.barometer_rate": 100.0}
    noise = {**values, "imu.barometer_noise_density": 0.2}
    samples = pressure(simulation(noise), 8192, 40000)
    ratio = np.sum((samples.pressure - samples.ideal_pressure) ** 2) / (0.04 * 100.0)
    assert chi2.ppf(1e-4, 20000) < ratio < chi2.ppf(1.0 - 1e-4, 20000)
    gusty = {**values, "imu.barometer_gust_rate": 5.0, "imu.barometer_gust_sigma": 12.0}
    samples = pressure(simulation(gusty), 8192, 100000)  # 500 s
    gust = samples.pressure - samples.ideal_pressure
    assert np.allclose(gust, samples.bias, atol=1e-9)
    steps = np.flatnonzero(np.abs(np.diff(gust)) > 1e-9)
    # A sample has a step with 1 - exp(-5 / 100): binomial, 4 standard deviations.
    mean = 50000 * -math.expm1(-0.05)
    assert abs(len(steps) - mean) < 4.0 * math.sqrt(mean)
    levels = gust[steps + 1]
    ratio = np.sum(levels**2) / 144.0
    assert chi2.ppf(1e-4, len(levels)) < ratio < chi2.ppf(1.0 - 1e-4, len(levels))


def test_steps_and_limits_of_the_output() -> None:
    values = {"trajectory.type": "static", "imu.barometer_resolution": 0.5}
    (value,) = pressure(simulation({**values, "height": 321.0}), 1, 1).pressure
    assert value % 0.5 == 0.0
    limits = {"imu.barometer_minimum": 30000.0, "imu.barometer_maximum": 110000.0}
    for height, expected in ((9900.0, 30000.0), (-900.0, 110000.0)):
        samples = pressure(simulation({**values, **limits, "height": height}), 1, 1)
        assert samples.pressure[0] == expected


def test_faults_of_the_barometer_are_its_own() -> None:
    run = simulation({"imu.barometer_rate": 50.0})
    repeated = Body(load_simulation(BASE))
    run.inject(Fault("bias_jump", 1.0, 30.0, "barometer"), 1.0)
    run.inject(Fault("stuck", 1.0, 0.0, "barometer"), 3.0)
    block = run.next(1000)
    assert np.array_equal(block["imu"].accel, repeated.next(1000)["imu"].accel)
    samples = block["pressure"]
    assert samples is not None
    off = (samples.pressure - samples.ideal_pressure)[:150]
    assert np.allclose(off, np.repeat([0.0, 30.0, 0.0], 50), atol=1e-9)
    assert np.ptp(samples.pressure[150:200]) == 0.0 < np.ptp(samples.pressure[200:])


@pytest.mark.parametrize("preset", files.names("barometers"))
def test_presets_are_layered_below_what_is_given(preset: str) -> None:
    settings = {"imu.barometer_preset": preset, "imu.barometer_bias": 3.0}
    barometer = load_simulation(BASE, settings).imu.barometer
    preset_values = files.load(files.find("barometers", preset))
    assert barometer.bias == 3.0
    assert barometer.noise_density == preset_values["imu.barometer_noise_density"]
    flown = pressure(simulation(settings), 1000, 1000)
    # Six of the largest turn-on bias sigma, bmp280's 100 Pa, beside which the noise is small.
    assert abs(np.mean(flown.pressure - flown.ideal_pressure)) < 6.0 * 100.0


def test_a_board_s_file_may_name_its_barometer(tmp_path: Any) -> None:
    board = tmp_path / "board.yaml"
    board.write_text(
        "/**: {ros__parameters: {imu: {preset: mpu9250, barometer_preset: bmp280, "
        "barometer_maximum: 120000.0}}}\n"
    )
    board_parameters = load_simulation({"imu.preset": str(board)})
    assert board_parameters.imu.barometer.maximum == 120000.0
    assert board_parameters.imu.barometer.minimum == 30000.0
    assert board_parameters.imu.gyroscope.noise_density == pytest.approx([0.00012341] * 3)
    with_bmp388 = load_simulation({"imu.preset": str(board), "imu.barometer_preset": "bmp388"})
    assert with_bmp388.imu.barometer.turn_on_bias_sigma == 50.0
    preset_path = tmp_path / "barometer.yaml"
    preset_path.write_text("/**: {ros__parameters: {imu: {barometer_noise_density: 0.5}}}\n")
    for name, density in ((str(preset_path), 0.5), ("", 0.0)):
        with_preset = load_simulation({"imu.preset": str(board), "imu.barometer_preset": name})
        assert with_preset.imu.barometer.noise_density == density
        assert with_preset.imu.barometer.turn_on_bias_sigma == 0.0


@pytest.mark.parametrize(
    ("values", "line"),
    [
        (
            {"imu.barometer_rate": -1.0},
            "imu.barometer_rate = -1.0: must be a finite number at least",
        ),
        ({"imu.barometer_gauss_markov_sigma": 1.0}, "imu.barometer_correlation_time = 0.0: must"),
        (
            {"imu.barometer_gust_rate": 1.0},
            "imu.barometer_gust_rate = 1 and imu.barometer_gust_sigma = 0: must",
        ),
        ({"imu.barometer_minimum": 2.0, "imu.barometer_maximum": 1.0}, "must be 0 or above"),
        ({"atmosphere.sea_level_pressure": 0.0}, "atmosphere.sea_level_pressure = 0.0: must be"),
        ({"imu.barometer_preset": "bmp999"}, "unknown barometer 'bmp999'; neither a file nor one"),
    ],
)
def test_bad_values_are_one_line_each(values: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load_simulation(BASE, values)
    (problem,) = caught.value.problems
    assert line in problem
