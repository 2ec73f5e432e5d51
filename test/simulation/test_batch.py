# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many sensors at once: each is the one of its seed, bit for bit; their statistics; bad input."""

import gc
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.random_streams import Streams, axis_generators
from imu_sim_ros.core.timebase import sample_times_ns
from imu_sim_ros.sensors.imu.batch import BatchSamples

RATE, COUNT, STEPS = 200.0, 5, 300
"""Steps over two chunks of noise."""
RNG = np.random.default_rng(7)
GYRO = RNG.normal(size=(STEPS, COUNT, 3))
ACCEL = 4.0 * RNG.normal(size=(STEPS, COUNT, 3)) + [0.0, 0.0, 9.81]
TERMS: dict[str, Any] = {
    "gyroscope_noise_density": [0.01, 0.0, 0.02],
    "gyroscope_noise_correlation": [0.3, 0.2, -0.1],
    "gyroscope_noise_temperature_coefficient": 0.01,
    "gyroscope_random_walk": [0.0, 1e-3, 1e-3],
    "gyroscope_gauss_markov_sigma": 0.01,
    "gyroscope_correlation_time": 0.3,
    "gyroscope_bias_instability": 1e-3,
    "gyroscope_rate_ramp": 1e-4,
    "gyroscope_bias": [0.1, -0.2, 0.3],
    "gyroscope_g_sensitivity_sigma": 1e-3,
    "gyroscope_quadratic_sigma": 1e-3,
    "gyroscope_misalignment_sigma": 0.01,
    "gyroscope_turn_on_bias_sigma": 0.01,
    "gyroscope_turn_on_scale_sigma": 0.01,
    "gyroscope_temperature_bias": [1e-3, 2e-3, 3e-3, 1e-5, 2e-5, 3e-5],
    "gyroscope_temperature_scale_sigma": 1e-3,
    "gyroscope_ageing_scale": 1e-3,
    "gyroscope_ageing_bias": 1e-3,
    "gyroscope_range": 3.0,
    "gyroscope_resolution": [1e-3, 0.0, 1e-3],
    "accelerometer_noise_density": 0.01,
    "accelerometer_bandwidth": [40.0, 40.0, 60.0],
    "accelerometer_scale_error_percent": [1.0, 2.0, 3.0],
    "accelerometer_bias_instability": [1e-3, 0.0, 1e-3],
    "accelerometer_range": 20.0,
}
SHOCKS = {"gyroscope_shock_bias_sigma": 0.1, "shock_threshold": 50.0}
CASES: dict[str, dict[str, Any]] = {
    "bmi088": {"imu": "bmi088"},
    "mpu6000": {"imu": "mpu6000"},
    "every term": {"imu": TERMS},
    "warming": {"imu": "bmi088", "temperature": {"profile": [0.0, 20.0, 1.0, 40.0]}},
    "axes": {"imu": "bmi088", "input": {"axes": "frd"}},
}
ERRORS = [name for name in BatchSamples._fields if name not in ("t_ns", "held")]


def steps(model: Any, gyro: np.ndarray = GYRO, accel: np.ndarray = ACCEL) -> list[BatchSamples]:
    return [
        model.read(k * 5_000_000, *pair) for k, pair in enumerate(zip(gyro, accel, strict=True))
    ]


def assert_same(samples: list[BatchSamples], unit: int, single: Any, begin: int = 0) -> None:
    """Compare one unit from a step on with the one sensor that starts there."""
    rows = slice(begin, begin + len(samples))
    t_ns = np.arange(len(samples)) * 5_000_000
    block = single.read(t_ns, GYRO[rows, unit], ACCEL[rows, unit])
    for name in ERRORS:
        mine = np.array([getattr(sample, name)[unit] for sample in samples])
        np.testing.assert_array_equal(mine, getattr(block, name), err_msg=f"{unit} {name}")


def test_streams_of_many_seeds_are_the_generators_of_each() -> None:
    seeds = np.array([0, 1, 2**31, 2**40 + 3, 2**63 - 1])
    streams = Streams(seeds, "a.source", "another")
    first_numbers, some = streams.next(7), streams.next(5, np.array([1, 3]), [0, 4])
    for unit, seed in enumerate(seeds.tolist()):
        plain = [*axis_generators(seed, "a.source"), *axis_generators(seed, "another")]
        for axis, generator in enumerate(plain):
            np.testing.assert_array_equal(
                first_numbers[:, unit, axis], generator.standard_normal(7)
            )
            if unit in (1, 3) and axis in (0, 4):
                unit_numbers = some[:, (unit - 1) // 2, axis // 4]
                np.testing.assert_array_equal(unit_numbers, generator.standard_normal(5))


@pytest.mark.parametrize("name", CASES)
def test_each_environment_is_the_sensor_of_its_seed(name: str) -> None:
    arguments = {"rate": RATE, **CASES[name]}
    samples = steps(ims.ErrorModel(count=COUNT, seed=3, **arguments))
    for unit in range(COUNT):
        assert_same(samples, unit, ims.ErrorModel(seed=3 + unit, **arguments))


def test_each_environment_has_its_preset() -> None:
    presets = ["bmi088", "mpu6000", "perfect"]
    changed = {"accelerometer_bandwidth": 0.0, "gyroscope_bandwidth": 0.0}
    boards = [{"preset": name, **changed} for name in presets]
    boards[2] |= {"gyroscope_scale_error_percent": 1.0, "gyroscope_misalignment_percent": [0.1] * 6}
    model = ims.ErrorModel(imu=boards, rate=RATE, seed=3, count=COUNT)
    samples = steps(model)
    for unit in range(COUNT):
        assert_same(samples, unit, ims.ErrorModel(imu=boards[unit % 3], rate=RATE, seed=3 + unit))
    model.reset(np.arange(COUNT) == 2)  # of the preset that has nothing to draw
    model.reset(np.arange(COUNT) == 3)
    again = steps(model, GYRO[:9], ACCEL[:9])
    for unit in (2, 3):
        seed = 3 + unit + COUNT
        assert_same(again, unit, ims.ErrorModel(imu=boards[unit % 3], rate=RATE, seed=seed))


SPREAD = {
    "gyroscope_noise_density": ("uniform", [1e-4, 2e-4, 3e-4], 4e-4),
    "accelerometer_bias": ("gaussian", 0.2),
    "gyroscope_resolution": ("uniform", 1e-4, 1e-3),
}


def test_a_spread_unit_can_be_made_alone() -> None:
    model = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT, spread=SPREAD)
    samples = steps(model)
    for unit in range(COUNT):
        single = model.unit(unit)
        assert single["seed"] == 3 + unit
        assert set(single["imu"]) == {"preset", *SPREAD}
        assert_same(samples, unit, ims.ErrorModel(rate=RATE, **single))


UNITS: dict[str, dict[str, Any]] = {
    "preset": {"imu": "mpu6000"},
    "parameter": {"imu": {"preset": "mpu6000", "gyroscope_bias": [0.1, 0.0, 0.0]}},
    "list": {"imu": ["bmi088", {"preset": "perfect", "accelerometer_range": 12.0}]},
    "default": {},
    "other arguments": {
        "imu": "bmi088",
        "input": {"axes": "frd"},
        "temperature": {"profile": [0.0, 20.0, 1.0, 40.0]},
        "gravity": [0.0, 0.0, -9.79],
    },
    "spread": {"imu": "bmi088", "imu.accelerometer_bias": [0.0, 1.0, 0.0], "spread": SPREAD},
}


@pytest.mark.filterwarnings("ignore:input")
@pytest.mark.parametrize("name", UNITS)
def test_a_unit_has_all_its_arguments(name: str) -> None:
    model = ims.ErrorModel(rate=RATE, seed=3, count=COUNT, **UNITS[name])
    samples = steps(model, GYRO[:20], ACCEL[:20])
    for unit in range(COUNT):
        assert_same(samples, unit, ims.ErrorModel(rate=RATE, **model.unit(unit)))


def test_a_unit_of_files_has_all_its_arguments(tmp_path: Path) -> None:
    """A file of parameters, one of a sensor, and a model of Gazebo, whose name is no preset's."""
    noise = "<noise type='gaussian'><stddev>0.01</stddev></noise>"
    rates = "".join(f"<{axis}>{noise}</{axis}>" for axis in "xyz")
    sdf = tmp_path / "model.sdf"
    imu = f"<imu><angular_velocity>{rates}</angular_velocity></imu>"
    sensor = f"<sensor name='imu' type='imu'><update_rate>100</update_rate>{imu}</sensor>"
    sdf.write_text(f"<sdf><model name='m'><link name='l'>{sensor}</link></model></sdf>")
    preset_path = tmp_path / "own.yaml"
    head = "/**:\n  ros__parameters:\n    imu:\n      preset: bmi088\n"
    preset_path.write_text(head + "      gyroscope_bias: [0.0, 0.2, 0.0]\n")
    parameters = tmp_path / "params.yaml"
    parameters.write_text(head + "      accelerometer_bias: 0.3\n")
    for arguments in ({"imu": sdf}, {"imu": preset_path}, {"params_file": parameters}):
        model = ims.ErrorModel(rate=RATE, seed=3, count=2, **arguments)
        samples = model.read(0, GYRO[0, :2], ACCEL[0, :2])
        for unit in range(2):
            single = ims.ErrorModel(rate=RATE, **model.unit(unit))
            block = single.read(0, GYRO[0, unit], ACCEL[0, unit])
            np.testing.assert_array_equal(block.gyro[0], samples.gyro[unit])
            np.testing.assert_array_equal(block.accel[0], samples.accel[unit])


UP = [0.0, 0.0, 9.81]


@pytest.mark.parametrize(
    ("accel", "line"),
    [
        ([0.0, 0.0, 1.0], "at rest the accelerometer reads 1 instead of 9.81: it is in g"),
        ([0.0, 0.0, 0.0], "gravity is missing"),
        ([0.0, 0.0, -9.81], "input.axes = flu: at rest upwards is"),
    ],
)
@pytest.mark.parametrize("count", [1, 50])
@pytest.mark.parametrize(("seconds", "ends"), [(2.1, False), (0.4, True)])
def test_the_first_readings_are_checked_as_those_of_one_sensor(
    accel: list[float], line: str, count: int, seconds: float, ends: bool
) -> None:
    """After 2 s, or at the end of fewer readings, which a reset of all environments is."""
    t_ns = np.arange(round(seconds * RATE)) * 5_000_000
    gyro, forces = np.zeros((len(t_ns), 3)), np.tile(accel, (len(t_ns), 1))
    with pytest.warns(UserWarning, match=line):
        ims.add_errors(t_ns, gyro, forces, imu="bmi088", rate=RATE)
    batch = ims.ErrorModel(imu="bmi088", rate=RATE, seed=1, count=count)

    def read_all() -> None:
        for k in t_ns.tolist():
            batch.read(k, np.zeros((count, 3)), np.tile(accel, (count, 1)))
        if ends:
            batch.reset()

    with pytest.warns(UserWarning, match=line) as warned:
        read_all()
    assert len(warned) == 1


def test_one_environment_that_differs_is_named(recwarn: pytest.WarningsRecorder) -> None:
    forces = np.tile(UP, (20, 1))
    forces[7] *= -1.0
    batch = ims.ErrorModel(imu="bmi088", rate=RATE, seed=1, count=20)
    for _ in range(401):
        batch.read(0, np.zeros((20, 3)), forces)  # a time that is only passed on
    (line,) = (str(warning.message) for warning in recwarn)
    assert line.startswith("environment 7: input.axes = flu: at rest upwards is")


def test_what_looks_like_a_mistake_is_told_as_of_one_sensor() -> None:
    with pytest.warns(UserWarning, match=r"imu.accelerometer_range = 5: smaller than gravity"):
        ims.ErrorModel(imu={"accelerometer_range": 5.0}, rate=RATE, count=3)


def test_spreads_have_their_distributions() -> None:
    """3,000 numbers each: mean within 5 sigma / sqrt(n), deviation within 5 / sqrt(2 n)."""
    model = ims.ErrorModel(imu="perfect", rate=RATE, seed=0, count=1000, spread=SPREAD)
    drawn = {name: model._batch.units.triad(name, slice(None)) for name in TRIADS}
    n = 3000
    bias = drawn["accelerometer"].bias
    assert abs(bias.mean()) < 5.0 * 0.2 / np.sqrt(n)
    assert bias.std() / 0.2 == pytest.approx(1.0, abs=5.0 / np.sqrt(2 * n))
    low = np.array([1e-4, 2e-4, 3e-4])
    share = (drawn["gyroscope"].noise_density - low) / (4e-4 - low)
    assert 0.0 <= share.min() < 0.01
    assert 0.99 < share.max() <= 1.0
    assert share.mean() == pytest.approx(0.5, abs=5.0 / np.sqrt(12 * n))
    correlation = np.corrcoef(np.concatenate([share, bias], axis=1).T) - np.eye(6)
    assert np.abs(correlation).max() < 5.0 / np.sqrt(1000)


@pytest.mark.parametrize("name", ["bmi088", "every term"])
def test_environments_begin_again_as_they_are_asked_to(name: str) -> None:
    """Some begin at step 50 as the next unit, at 130 others with the same seed."""
    arguments = {"rate": RATE, **CASES[name]}
    model = ims.ErrorModel(count=COUNT, seed=3, **arguments)
    samples = steps(model, GYRO[:50], ACCEL[:50])
    model.reset(np.array([True, False, False, True, False]))
    samples += steps(model, GYRO[50:130], ACCEL[50:130])
    model.reset(np.array([False, True, False, False, False]), "same_seed")
    samples += steps(model, GYRO[130:], ACCEL[130:])
    assert model.seeds.tolist() == [3 + COUNT, 4, 5, 6 + COUNT, 7]
    for unit, begin, seed in ((0, 50, 3 + COUNT), (3, 50, 6 + COUNT), (1, 130, 4), (2, 0, 5)):
        assert_same(samples[begin:], unit, ims.ErrorModel(seed=seed, **arguments), begin)


def test_the_same_unit_keeps_its_calibration_and_gets_new_noise() -> None:
    model = ims.ErrorModel(imu=TERMS, rate=RATE, seed=3, count=COUNT)
    still = np.zeros((COUNT, 3))
    first_numbers = model.read(0, still, still)
    triad = model._batch._triads["gyroscope"]
    quadratic = triad._parameters.quadratic.copy()
    model.reset(restart="same_unit")
    second = model.read(0, still, still)
    np.testing.assert_array_equal(triad._parameters.quadratic, quadratic)
    assert not (first_numbers.gyro_bias == second.gyro_bias).any()  # turn-on and noise
    with pytest.raises(ConfigurationError, match="did not begin again as the same unit"):
        model.unit(0)
    model.reset(restart="next_seed")
    assert not (triad._parameters.quadratic == quadratic).any()


def test_statistics_over_environments() -> None:
    """White noise sigma^2 rate, a walk sigma^2 t, turn-on sigma^2, over 1,500 units of three axes.

    Relative deviation of a variance: sqrt(2 / n), n = 4,500; five of them.
    """
    count, n, rate = 1500, 4500, 100.0
    imu = {
        "gyroscope_noise_density": 0.01,
        "gyroscope_random_walk": 0.02,
        "accelerometer_turn_on_bias_sigma": 0.3,
    }
    model = ims.ErrorModel(imu=imu, rate=rate, seed=11, count=count)
    still = np.zeros((count, 3))
    samples = [model.read(k * 10_000_000, still, still) for k in range(201)]
    tolerance = 5.0 * np.sqrt(2.0 / n)
    final = samples[-1]
    assert final.gyro_noise.var() / (0.01**2 * rate) == pytest.approx(1.0, abs=tolerance)
    assert final.gyro_bias.var() / (0.02**2 * 2.0) == pytest.approx(1.0, abs=tolerance)
    assert final.accel_bias.var() / 0.3**2 == pytest.approx(1.0, abs=tolerance)
    np.testing.assert_array_equal(final.gyro, final.gyro_bias + final.gyro_noise)
    # Neither units nor steps are correlated.
    noise = np.array([sample.gyro_noise[:, 0] for sample in samples])
    lags = (noise[1:] * noise[:-1]).mean(), (noise[:, 1:] * noise[:, :-1]).mean()
    assert np.abs(lags).max() / (0.01**2 * rate) < 5.0 / np.sqrt(noise.size)


def test_what_was_returned_stays_as_it_is() -> None:
    model = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT)
    samples = steps(model, GYRO[:1], ACCEL[:1])
    copies = {name: getattr(samples[0], name).copy() for name in ERRORS}
    steps(model)
    for name, value in copies.items():
        np.testing.assert_array_equal(getattr(samples[0], name), value)


def test_a_bad_reading_is_held_and_the_others_go_on() -> None:
    good = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT)
    model = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT)
    first_numbers = steps(good, GYRO[:1], ACCEL[:1])
    steps(model, GYRO[:1], ACCEL[:1])
    assert not first_numbers[0].held.any()
    gyro, accel = GYRO[1].copy(), ACCEL[1].copy()
    gyro[2, 1], accel[4, 0] = np.nan, 1e9
    with pytest.warns(UserWarning, match="environment 2, 4: a reading that is not finite"):
        measured = model.read(5_000_000, gyro, accel)
    assert measured.held.tolist() == [False, False, True, False, True]
    for unit in (2, 4):
        gyro[unit], accel[unit] = GYRO[0, unit], ACCEL[0, unit]
    expected = good.read(5_000_000, gyro, accel)
    np.testing.assert_array_equal(measured.gyro, expected.gyro)
    np.testing.assert_array_equal(measured.accel, expected.accel)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"count": 0}, "count = 0: must be a whole number from 1 to 1000000"),
        ({"count": 1_000_000_000}, "count = 1000000000: must be a whole number"),
        ({"count": 2.5}, "count = 2.5"),
        ({"imu": []}, "imu"),
        ({"imu": {"sampling": "averaged"}}, "averaged"),
        (
            {"imu": SHOCKS},
            "gyroscope_shock_bias_sigma: not in a batch",
        ),
        ({"imu": {"latency": 0.01}}, "imu.latency: not in a batch"),
        ({"spread": {"gyroscope_noise": ("gaussian", 1.0)}}, "gyroscope_noise"),
        ({"spread": {"gyroscope_bias": ("uniform", 2.0, 1.0)}}, "spread gyroscope_bias"),
        ({"spread": {"gyroscope_bias": "wide"}}, "spread gyroscope_bias"),
        ({"spread": {"gyroscope_bias": ("gaussian", np.nan)}}, "spread gyroscope_bias"),
        ({"input": {"place": "body"}}, "without place and rate in a batch"),
    ],
)
def test_what_a_batch_cannot_be_is_refused_with_a_line(
    arguments: dict[str, Any], line: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        ims.ErrorModel(**{"rate": RATE, "count": 3, **arguments})
    assert any(line in problem for problem in caught.value.problems), caught.value.problems


def test_bad_calls_are_refused_with_a_line() -> None:
    model = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT)
    with pytest.raises(ConfigurationError, match=r"gyro.*shape \(5, 3\)"):
        model.read(0, np.zeros((4, 3)), ACCEL[0])
    with pytest.raises(ConfigurationError, match="mask"):
        model.reset(np.array([0, 1]))
    with pytest.raises(ConfigurationError, match="restart"):
        model.reset(restart="again")
    with pytest.raises(ConfigurationError, match="k = 5"):
        model.unit(5)


FIELD = 1e-5 * RNG.normal(size=(STEPS, COUNT, 3)) + [2e-5, 0.0, -4e-5]
PRESSURE = 1e5 + 100.0 * RNG.normal(size=(STEPS, COUNT))
BOARD: dict[str, Any] = {
    "magnetometer_rate": 50.0,
    "magnetometer_hard_iron": [1e-5, 0.0, -2e-5],
    "magnetometer_hard_iron_sigma": 1e-5,
    "magnetometer_soft_iron_sigma": 0.02,
    "magnetometer_misalignment_sigma": 0.02,
    "magnetometer_current_coupling": [1e-6, 2e-6, 0.0],
    "magnetometer_current_profile": [0.0, 1.0, 3.0, 2.0],
    "magnetometer_noise_density": 1e-7,
    "magnetometer_random_walk": 1e-8,
    "magnetometer_bias_instability": 1e-7,
    "magnetometer_turn_on_bias_sigma": 1e-5,
    "magnetometer_turn_on_scale_sigma": 0.01,
    "magnetometer_temperature_bias": [1e-7, 2e-7, 3e-7],
    "magnetometer_time_offset": 0.01,
    "magnetometer_range": [5e-5, 5e-5, 0.0],
    "magnetometer_resolution": 1.5e-7,
    "barometer_rate": 25.0,
    "barometer_noise_density": 1.0,
    "barometer_random_walk": 0.1,
    "barometer_gauss_markov_sigma": 20.0,
    "barometer_correlation_time": 10.0,
    "barometer_turn_on_bias_sigma": 100.0,
    "barometer_temperature_bias_sigma": 1.0,
    "barometer_gust_rate": 2.0,
    "barometer_gust_sigma": 5.0,
    "barometer_maximum": 100200.0,
    "barometer_resolution": 0.5,
}
WARMING = {"profile": [0.0, 20.0, 3.0, 40.0]}


def board_steps(model: Any, begin: int, end: int) -> list[tuple[Any, Any]]:
    return [
        (model.read_magnetic_field(k, FIELD[k]), model.read_pressure(k, PRESSURE[k]))
        for k in range(begin, end)
    ]


def assert_same_board(samples: list[tuple[Any, Any]], unit: int, single: Any, begin: int) -> None:
    """Compare a unit's magnetometer and barometer with the ones that begin at a step."""
    rows = slice(begin, begin + len(samples))
    imu, count = single.parameters.imu, len(samples)
    t_ns = [sample_times_ns(0, count, sensor.rate) for sensor in (imu.magnetometer, imu.barometer)]
    field_values = single.read_magnetic_field(t_ns[0], FIELD[rows, unit])
    air = single.read_pressure(t_ns[1], PRESSURE[rows, unit])
    for name in ("field", "bias"):
        mine = np.array([getattr(sample, name)[unit] for sample, _ in samples])
        np.testing.assert_array_equal(mine, getattr(field_values, name), err_msg=f"{unit} {name}")
    for name in ("pressure", "bias"):
        mine = np.array([getattr(sample, name)[unit] for _, sample in samples])
        np.testing.assert_array_equal(mine, getattr(air, name), err_msg=f"{unit} {name}")


@pytest.mark.parametrize("imu", [BOARD, {"preset": "mpu9250", "barometer_preset": "bmp388"}])
def test_magnetometers_and_barometers_are_those_of_their_seeds(imu: dict[str, Any]) -> None:
    """Some begin at step 50 as the next unit, at 130 another one with the same seed."""
    arguments = {"rate": RATE, "imu": imu, "temperature": WARMING, "input": {"axes": "frd"}}
    model = ims.ErrorModel(count=COUNT, seed=3, **arguments)
    samples = board_steps(model, 0, 50)
    model.reset(np.array([True, False, False, True, False]))
    samples += board_steps(model, 50, 130)
    model.reset(np.array([False, True, False, False, False]), "same_seed")
    samples += board_steps(model, 130, STEPS)
    for unit, begin, seed in ((0, 50, 3 + COUNT), (3, 50, 6 + COUNT), (1, 130, 4), (2, 0, 5)):
        assert_same_board(samples[begin:], unit, ims.ErrorModel(seed=seed, **arguments), begin)


def test_a_list_and_a_spread_of_magnetometers() -> None:
    boards = [{**BOARD, "barometer_gust_rate": 0.0, "barometer_gust_sigma": 0.0}, BOARD]
    spread = {
        "magnetometer_hard_iron": ("gaussian", 1e-5),
        "magnetometer_noise_density": ("uniform", 1e-8, 1e-7),
        "magnetometer_misalignment_sigma": ("uniform", 0.0, 0.1),
    }
    model = ims.ErrorModel(imu=boards, rate=RATE, seed=3, count=COUNT, spread=spread)
    samples = board_steps(model, 0, 150)
    for unit in range(COUNT):
        sensor = model.unit(unit)
        assert set(sensor["imu"]) >= set(spread)
        alone = ims.ErrorModel(rate=RATE, **sensor)
        assert_same_board(samples, unit, alone, 0)


def test_bad_fields_and_pressures_are_held() -> None:
    model = ims.ErrorModel(imu=BOARD, rate=RATE, seed=3, count=COUNT)
    good = ims.ErrorModel(imu=BOARD, rate=RATE, seed=3, count=COUNT)
    for model_or_copy in (model, good):
        board_steps(model_or_copy, 0, 1)
    field, pressure = FIELD[1].copy(), PRESSURE[1].copy()
    field[2, 1], pressure[4] = np.nan, np.inf
    with pytest.warns(UserWarning, match="environment 2: a reading"):
        field_values = model.read_magnetic_field(0, field)
    with pytest.warns(UserWarning, match="environment 4: a reading"):
        air = model.read_pressure(0, pressure)
    assert np.flatnonzero(field_values.held).tolist() == [2]
    assert np.flatnonzero(air.held).tolist() == [4]
    field[2], pressure[4] = FIELD[0, 2], PRESSURE[0, 4]
    np.testing.assert_array_equal(field_values.field, good.read_magnetic_field(0, field).field)
    np.testing.assert_array_equal(air.pressure, good.read_pressure(0, pressure).pressure)


def test_heights_are_pressures_of_the_atmosphere() -> None:
    """The standard has 22632 Pa at 11 km (US Standard Atmosphere 1976, geopotential)."""
    model = ims.ErrorModel(imu="perfect", rate=RATE, seed=3, count=COUNT)
    heights = np.full(COUNT, 6356766.0 * 11e3 / (6356766.0 - 11e3))
    heights[1] = np.nan
    with pytest.warns(UserWarning, match="environment 1"):
        pressures = model.read_pressure(0, altitude=heights)
    np.testing.assert_allclose(np.delete(pressures.pressure, 1), 22632.06, atol=0.05)


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda m: m.read_magnetic_field(0, np.zeros((4, 3))), r"field.*shape \(5, 3\)"),
        (lambda m: m.read_pressure(0, np.zeros((5, 1))), r"pressure.*shape \(5,\)"),
        (lambda m: m.read_pressure(0), "either pressure or altitude"),
        (lambda m: m.read_pressure(0, PRESSURE[0], altitude=PRESSURE[0]), "either pressure or"),
    ],
)
def test_bad_fields_and_pressures_are_refused_with_a_line(call: Any, line: str) -> None:
    model = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT)
    with pytest.raises(ConfigurationError, match=line):
        call(model)


def test_magnetometers_of_different_rates_are_refused_when_they_are_read() -> None:
    model = ims.ErrorModel(imu=["mpu9250", "bno055"], rate=RATE, seed=3, count=COUNT)
    model.read(0, GYRO[0], ACCEL[0])
    with pytest.raises(ConfigurationError, match="imu.magnetometer_rate: must be the same"):
        model.read_magnetic_field(0, FIELD[0])


class OnlyDlpack:
    """An array of another library, which knows NumPy only through DLPack."""

    def __init__(self, values: np.ndarray) -> None:
        self._values = values

    def __dlpack__(self, **arguments: Any) -> Any:
        return self._values.__dlpack__(**arguments)

    def __dlpack_device__(self) -> tuple[int, int]:
        return self._values.__dlpack_device__()


class OnADevice:
    """An array that cannot be taken to the host without being asked, as CuPy's and torch's say."""

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("use tensor.detach().cpu()")


def test_arrays_of_other_libraries_are_taken_without_being_numpys() -> None:
    model = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT)
    second = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT)
    measured = second.read(0, OnlyDlpack(GYRO[0]), OnlyDlpack(ACCEL[0]))
    np.testing.assert_array_equal(measured.gyro, model.read(0, GYRO[0], ACCEL[0]).gyro)
    # What comes back is taken by DLPack without a copy.
    assert np.shares_memory(np.from_dlpack(measured.gyro), measured.gyro)
    single = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3)
    assert single.read([0], OnlyDlpack(GYRO[0, :1].copy()), ACCEL[0, :1]).gyro.shape == (1, 3)
    with pytest.raises(ConfigurationError, match=r"gyro: cannot be taken as a NumPy array: use"):
        model.read(0, OnADevice(), ACCEL[0])


@pytest.mark.parametrize("t_ns", [1.5, "now", None, np.nan, [0, 1], 2**70])
def test_a_time_that_is_none_is_refused(t_ns: Any) -> None:
    model = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT)
    for call in (
        lambda: model.read(t_ns, GYRO[0], ACCEL[0]),
        lambda: model.read_magnetic_field(t_ns, FIELD[0]),
        lambda: model.read_pressure(t_ns, PRESSURE[0]),
    ):
        with pytest.raises(ConfigurationError, match="t_ns = .*: must be whole nanoseconds"):
            call()


def test_times_that_go_back_change_nothing() -> None:
    model = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT)
    second = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=COUNT)
    for k in range(3):
        mine = model.read(-k * 10**9, GYRO[k], ACCEL[k])
        np.testing.assert_array_equal(mine.gyro, second.read(k, GYRO[k], ACCEL[k]).gyro)
        assert mine.t_ns == -k * 10**9


def test_seeds_that_would_overflow_are_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"seed = .*: must be at most"):
        ims.ErrorModel(imu="bmi088", rate=RATE, seed=2**63 - 1, count=COUNT)


def test_memory_does_not_grow_with_steps_and_episodes() -> None:
    """Every stream, chunk and process has been made anew after 200 steps."""
    imu = {**BOARD, "gyroscope_noise_density": 1e-3, "accelerometer_bias_instability": 1e-3}
    rng = np.random.default_rng(2)

    def run(steps: int) -> int:
        for k in range(steps):
            model.read(k, GYRO[0], ACCEL[0])
            model.read_magnetic_field(k, FIELD[0])
            model.read_pressure(k, PRESSURE[0])
            if k % 50 == 0:
                model.reset(rng.random(COUNT) < 0.5)
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        model = ims.ErrorModel(imu=imu, rate=RATE, seed=3, count=COUNT)
        memory_after_200_steps = run(200)
        memory_after_500_steps = run(300)
    finally:
        tracemalloc.stop()
    assert (
        memory_after_500_steps - memory_after_200_steps < 300 * 16
    )  # a single number a step would be more


def test_memory_of_a_unit_is_below_20_kilobytes() -> None:
    """All that a batch keeps, in steps that are done: bmi088, every term."""
    count = 256
    tracemalloc.start()
    try:
        bytes_before = tracemalloc.get_traced_memory()[0]
        model = ims.ErrorModel(imu="bmi088", rate=RATE, seed=3, count=count)
        still = np.zeros((count, 3))
        model.read(0, still, np.full((count, 3), 5.0))
        growth = tracemalloc.get_traced_memory()[0] - bytes_before
    finally:
        tracemalloc.stop()
    assert 12e3 < growth / count < 20e3
