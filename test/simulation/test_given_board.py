# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Magnetometer and barometer on given fields and pressures: those of a simulation, bit for bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError

IMU: dict[str, Any] = {
    "preset": "mpu9250",
    "latency": 0.01,
    "latency_jitter": 0.002,
    "dropout_probability": 0.05,
    "clock_skew_ppm": 50.0,
    "magnetometer_rate": 50.0,
    "magnetometer_hard_iron_sigma": 1e-5,
    "magnetometer_soft_iron_sigma": 0.02,
    "magnetometer_misalignment_sigma": 0.02,
    "magnetometer_current_coupling": [1e-6, 2e-6, 0.0],
    "magnetometer_current_profile": [0.0, 1.0, 3.0, 2.0],
    "magnetometer_noise_density": 1e-7,
    "magnetometer_random_walk": 1e-8,
    "magnetometer_turn_on_scale_sigma": 0.01,
    "magnetometer_temperature_bias": [1e-7, 2e-7, 3e-7],
    "barometer_rate": 25.0,
    "barometer_noise_density": 1.0,
    "barometer_gauss_markov_sigma": 20.0,
    "barometer_correlation_time": 10.0,
    "barometer_turn_on_bias_sigma": 100.0,
    "barometer_temperature_bias_sigma": 1.0,
    "barometer_gust_rate": 2.0,
    "barometer_gust_sigma": 5.0,
    "barometer_minimum": 30000.0,
    "barometer_resolution": 0.5,
}
GIVEN: dict[str, Any] = {
    "imu": IMU,
    "rate": 200.0,
    "seed": 4,
    "temperature": {"profile": [0.0, 20.0, 3.0, 40.0]},
}
BOTH = ("magnetic_field", "pressure")


@pytest.fixture(scope="module")
def flight() -> Any:
    return ims.simulate(trajectory="figure_eight", duration=6, sensors=BOTH, **GIVEN)


@pytest.fixture(scope="module")
def ideal() -> Any:
    """Return the samples of a simulation, lost ones too."""
    run = {"trajectory": "figure_eight", "duration": 6, "sensors": BOTH, "block_size": 1200}
    return next(iter(ims.blocks(**run, **GIVEN)))


def assert_same(actual: Any, expected: Any) -> None:
    for name in vars(expected):
        mine, theirs = getattr(actual, name), getattr(expected, name)
        np.testing.assert_array_equal(mine, theirs, err_msg=name)


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_readings_are_those_of_the_simulation_in_blocks_of_any_size(
    flight: Any, ideal: Any, size: int
) -> None:
    model = ims.ErrorModel(**GIVEN)
    field, air = (ideal.sensors[name] for name in BOTH)
    parts = [
        model.read_magnetic_field(field.true_t_ns[k : k + size], field.ideal_field[k : k + size])
        for k in range(0, len(field.true_t_ns), size)
    ]
    for name in vars(flight.magnetic_field):
        mine = np.concatenate([getattr(block, name) for block in parts])
        np.testing.assert_array_equal(mine, getattr(flight.magnetic_field, name), err_msg=name)
    parts = [
        model.read_pressure(air.true_t_ns[k : k + size], air.ideal_pressure[k : k + size])
        for k in range(0, len(air.true_t_ns), size)
    ]
    for name in vars(flight.pressure):
        mine = np.concatenate([getattr(block, name) for block in parts])
        np.testing.assert_array_equal(mine, getattr(flight.pressure, name), err_msg=name)


def test_a_flight_has_them_and_is_saved_with_them(flight: Any, ideal: Any, tmp_path: Path) -> None:
    field, air = (ideal.sensors[name] for name in BOTH)
    samples = ims.add_errors(
        *(ideal.true_t_ns, ideal.ideal_gyro, ideal.ideal_accel),
        magnetic_field=(field.true_t_ns, field.ideal_field),
        pressure=(air.true_t_ns, air.ideal_pressure),
        **GIVEN,
    )
    assert_same(samples.magnetic_field, flight.magnetic_field)
    assert_same(samples.pressure, flight.pressure)
    np.testing.assert_array_equal(samples.gyro, flight.gyro)
    samples.save(tmp_path / "noisy.mcap")
    saved = ims.read_magnetometer(tmp_path / "noisy.mcap")
    np.testing.assert_array_equal(saved.values, flight.magnetic_field.field)
    assert len(ims.read_pressure(tmp_path / "noisy.mcap").values) == len(flight.pressure)


def test_heights_are_those_of_the_simulation(ideal: Any) -> None:
    """The level path is at the height of its position, in metres above sea level."""
    height = ideal.motion.position[::8, 2]
    air = ideal.sensors["pressure"]
    pressures = ims.ErrorModel(**GIVEN).read_pressure(air.true_t_ns, altitude=height)
    rows = air.delivered
    np.testing.assert_array_equal(pressures.ideal_pressure, air.ideal_pressure[rows])


@pytest.mark.parametrize("axes", ["flu", "frd", "optical"])
def test_fields_come_in_the_axes_of_the_readings(axes: str) -> None:
    q_ib = rotation.exp([0.1, -0.2, 0.3])
    mounting = rotation.to_matrix(q_ib)
    declared = {"axes": axes, "place": "body"}
    imu = {"preset": "perfect", "mounting": mounting.ravel().tolist()}
    model = ims.ErrorModel(imu=imu, rate=100, input=declared)
    in_flu = np.array([2e-5, 1e-5, -4e-5])
    to_axes = {
        "flu": in_flu,
        "frd": in_flu * [1.0, -1.0, -1.0],
        "optical": np.array([-in_flu[1], -in_flu[2], in_flu[0]]),
    }
    field_values = model.read_magnetic_field(0, to_axes[axes])
    np.testing.assert_allclose(field_values.field[0], mounting.T @ in_flu, rtol=1e-12)


def test_gaps_are_missing_samples_and_jumps_back_begin_again(ideal: Any) -> None:
    field = ideal.sensors["magnetic_field"]
    t_ns, values = field.true_t_ns, field.ideal_field
    sound = {**GIVEN, "imu": {**IMU, "dropout_probability": 0.0}}
    whole = ims.ErrorModel(**sound).read_magnetic_field(t_ns, values)
    rows = np.r_[0:50, 60 : len(t_ns)]
    gap = ims.ErrorModel(**sound).read_magnetic_field(t_ns[rows], values[rows])
    np.testing.assert_array_equal(gap.field, whole.field[rows])
    model = ims.ErrorModel(**sound)
    with pytest.warns(UserWarning, match="magnetic field: stamps jump back by"):
        again = model.read_magnetic_field(np.r_[t_ns, t_ns], np.r_[values, values])
    np.testing.assert_array_equal(again.field, np.r_[whole.field, whole.field])
    model.reset()
    np.testing.assert_array_equal(model.read_magnetic_field(t_ns, values).field, whole.field)


def test_faults_and_live_changes(ideal: Any) -> None:
    field = ideal.sensors["magnetic_field"]
    sound = {**GIVEN, "imu": {**IMU, "dropout_probability": 0.0, "magnetometer_resolution": 0.0}}
    whole = ims.ErrorModel(**sound).read_magnetic_field(field.true_t_ns, field.ideal_field)
    model = ims.ErrorModel(**sound)
    jump = [1e-5, 0.0, 0.0]
    assert model.inject("bias_jump", triad="magnetometer", value=tuple(jump), delay=1.0) == 50
    field_values = model.read_magnetic_field(field.true_t_ns[:100], field.ideal_field[:100])
    np.testing.assert_allclose(field_values.bias - whole.bias[:100], [[0.0] * 3] * 50 + [jump] * 50)
    model.update(imu={"magnetometer_bias": [0.0, 1e-5, 0.0]})
    later = model.read_magnetic_field(field.true_t_ns[100:], field.ideal_field[100:])
    np.testing.assert_allclose(
        later.bias - whole.bias[100:], [[1e-5, 1e-5, 0.0]] * len(later), atol=1e-18
    )


@pytest.mark.parametrize(
    ("call", "kind", "line"),
    [
        (lambda m: m.read_magnetic_field(0, [0.0, 1.0]), ConfigurationError, "field"),
        (lambda m: m.read_magnetic_field([0, 1], [[0.0] * 3]), ConfigurationError, "2 stamps, 1"),
        (lambda m: m.read_magnetic_field(0.5, [0.0] * 3), ConfigurationError, "t_ns"),
        (lambda m: m.read_magnetic_field(0, [np.nan, 0.0, 0.0]), InputError, "magnetic_field"),
        (lambda m: m.read_pressure(0, np.inf), InputError, "pressure"),
        (lambda m: m.read_pressure(0, "high"), ConfigurationError, "pressure"),
        (lambda m: m.read_pressure(0), ConfigurationError, "either pressure or altitude"),
        (lambda m: m.read_pressure(0, altitude=np.nan), ConfigurationError, "altitude"),
        (lambda m: m.inject("stuck", triad="orientation"), ConfigurationError, "triad"),
    ],
)
def test_bad_calls_are_refused_with_a_line(call: Any, kind: type[Exception], line: str) -> None:
    with pytest.raises(kind, match=line):
        call(ims.ErrorModel(**GIVEN))


def test_values_in_other_units_are_said_to_be() -> None:
    with pytest.warns(UserWarning, match="48 T long; are the values in microtesla"):
        ims.ErrorModel(**GIVEN).read_magnetic_field(0, [0.0, 0.0, 48.0])
    with pytest.warns(UserWarning, match="1013.2 Pa; are the values in hectopascal"):
        ims.ErrorModel(**GIVEN).read_pressure(0, 1013.25)


@pytest.mark.parametrize("pair", [np.zeros(3), (np.arange(2),), "both"])
def test_a_pair_that_is_none_is_refused(pair: Any) -> None:
    with pytest.raises(ConfigurationError, match="pressure"):
        ims.add_errors([0, 5_000_000], np.zeros((2, 3)), np.ones((2, 3)), pressure=pair, **GIVEN)


def test_points_of_accelerometers_need_the_place_of_the_body() -> None:
    imu = {"accelerometer_positions": [0.01, 0, 0, 0, 0.02, 0, 0, 0, 0.03]}
    with pytest.raises(ConfigurationError, match="imu.accelerometer_positions: must be 0 unless"):
        ims.ErrorModel(imu=imu, rate=100)
    with pytest.raises(ConfigurationError, match="imu.accelerometer_positions: must be 0 unless"):
        ims.ErrorModel(imu=imu, rate=100, count=3)
    ims.ErrorModel(imu=imu, rate=100, input={"place": "body"})
