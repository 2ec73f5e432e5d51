# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors on given readings: those of a simulation to the last bit; gaps, jumps, conventions."""

import sys

import numpy as np
import pytest
from simulation_runs import EVERY_TERM

import imu_sim_ros as ims
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.records import LiveReading, Readings, concatenate, replace_fields
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.samples import join_samples as joined_blocks
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.error_input import Differentiator
from imu_sim_ros.simulation.error_model import GivenImu
from imu_sim_ros.simulation.error_parameters import load_error_model
from imu_sim_ros.simulation.parameters import load_simulation

TIMES = ("true_t_ns", "t_ns", "release_t_ns", "delivered")
COUNT = 700
OF_TRIADS = {  # a value for every parameter of a triad that is not a switch of another
    "noise_density": {"noise_density": 0.01},
    "noise_correlation": {"noise_density": 0.01, "noise_correlation": [0.5, 0.2, 0.1]},
    "noise_temperature_coefficient": {
        "noise_density": 0.01,
        "noise_temperature_coefficient": 0.01,
    },
    "random_walk": {"random_walk": 1e-3},
    "gauss_markov_sigma": {"gauss_markov_sigma": 0.01, "correlation_time": 10.0},
    "gauss_markov_density": {"gauss_markov_density": 0.01, "correlation_time": 10.0},
    "correlation_time": {"gauss_markov_density": 0.01, "correlation_time": 1.0},
    "bias_instability": {"bias_instability": 1e-3},
    "rate_ramp": {"rate_ramp": 1e-3},
    "bias": {"bias": [0.01, -0.02, 0.03]},
    "turn_on_bias_sigma": {"turn_on_bias_sigma": 0.01},
    "turn_on_scale_sigma": {"turn_on_scale_sigma": 0.01},
    "scale_misalignment": {"scale_misalignment": [1.01, 0, 0.02, 0, 0.99, 0, 0.03, 0, 1.0]},
    "scale_error_percent": {"scale_error_percent": [1.0, -1.0, 0.5]},
    "misalignment_percent": {"misalignment_percent": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]},
    "quadratic": {"quadratic": [1e-3, 0.0, 2e-3]},
    "g_sensitivity": {"g_sensitivity": [1e-4, 0, 0, 0, 2e-4, 0, 0, 1e-5, 3e-4]},
    "g_squared_sensitivity": {"g_squared_sensitivity": [1e-4, 0, 0, 0, 2e-4, 0, 0, 1e-5, 3e-4]},
    "temperature_bias": {"temperature_bias": [1e-3, 2e-3, 3e-3, 1e-5, 2e-5, 3e-5]},
    "temperature_scale": {"temperature_scale": [1e-4, 2e-4, 3e-4]},
    "temperature_bias_sigma": {"temperature_bias_sigma": 1e-3},
    "temperature_scale_sigma": {"temperature_scale_sigma": 1e-3},
    "temperature_hysteresis": {"temperature_hysteresis": 0.01},
    "ageing_bias": {"ageing_bias": 0.01},
    "ageing_scale": {"ageing_scale": 0.01},
    "stress_step_sigma": {"stress_step_sigma": 0.01},
    "shock_bias_sigma": {"shock_bias_sigma": 0.01},
    "misalignment_sigma": {"misalignment_sigma": 0.01},
    "quadratic_sigma": {"quadratic_sigma": 0.01},
    "g_sensitivity_sigma": {"g_sensitivity_sigma": 0.001},
    "bandwidth": {"bandwidth": [60.0, 40.0, 20.0]},
    "range": {"range": 1.0},
    "resolution": {"resolution": 1e-2},
    "steps within a range": {"range": [1.0, 0.1, 0.01], "resolution": 3e-3},
}
ONLY_GYROSCOPE = ("g_sensitivity", "g_squared_sensitivity", "g_sensitivity_sigma")
ONLY_AVERAGED = ("increment_resolution",)
COMMON = {
    "imu.age_days": 10.0,
    "imu.stress_step_rate": 2.0,
    "imu.shock_threshold": 9.9,
    "imu.shock_recovery_time": 1.0,
    "temperature.profile": [0.0, 20.0, 1.0, 40.0, 2.0, 30.0],
    "temperature.time_constant": 1.0,
}
VIBRATION = {
    "imu.vibration.line_frequency": [20.0],
    "imu.vibration.line_amplitude": [0.1] * 6,
    "imu.vibration.band_low": [10.0],
    "imu.vibration.band_high": [50.0],
    "imu.vibration.band_density": [0.01] * 6,
}
OF_TIMING = tuple(
    f"imu.{name}" for name in ("stamp", "clock", "jitter", "latency", "dropout", "duplicate")
)
TIMING = {name: value for name, value in EVERY_TERM.items() if not name.startswith("imu.gyro")}


def of_triads(name: str) -> dict[str, object]:
    triads = ["gyroscope"] if name in ONLY_GYROSCOPE else ["gyroscope", "accelerometer"]
    imu_values = {f"imu.{t}_{key}": v for t in triads for key, v in OF_TRIADS[name].items()}
    return {**COMMON, **imu_values}


CASES: dict[str, dict[str, object]] = {
    **{name: of_triads(name) for name in OF_TRIADS},
    "vibration": VIBRATION,
    "timing": TIMING,
    "timing of a plain sensor": {k: v for k, v in TIMING.items() if k.startswith(OF_TIMING)},
    "clock": {
        "imu.clock_skew_ppm": 50.0,
        "imu.clock_drift_ppm_per_hour": 10.0,
        "imu.stamp_offset": 0.01,
        "imu.jitter": 2e-4,
        "imu.latency": 0.003,
    },
    "together": {**EVERY_TERM, **COMMON, **VIBRATION},
    "everything": {
        **{k: v for name in OF_TRIADS for k, v in of_triads(name).items()},
        **EVERY_TERM,
        **VIBRATION,
    },
}
CASES["everything"].pop("imu.gyroscope_gauss_markov_density")
CASES["everything"].pop("imu.accelerometer_gauss_markov_density")
for triad in ("gyroscope", "accelerometer"):  # percent and matrix exclude each other
    CASES["everything"].pop(f"imu.{triad}_scale_misalignment")


def joined(blocks: list[object]) -> Samples:
    """Return the IMU's samples of a model's windows, and of blocks, as one block."""
    return joined_blocks(
        [
            axis_values["imu"] if isinstance(axis_values, dict) else axis_values
            for axis_values in blocks
        ]
    )


def truth_of(values: dict[str, object], count: int = COUNT) -> Samples:
    base = {"imu.preset": "perfect", "trajectory.type": "lecture", "seed": 5}
    return Body(load_simulation({**base, **values})).next(count)["imu"]


def model_of(values: dict[str, object], **overrides: object) -> GivenImu:
    return GivenImu(load_error_model({"imu.preset": "perfect", "seed": 5, **values, **overrides}))


def series(
    t_ns: np.ndarray, gyro: np.ndarray, accel: np.ndarray, q_wb: np.ndarray | None = None
) -> Readings:
    return Readings.unchecked(t_ns=t_ns, gyro=gyro, accel=accel, q_wb=q_wb)


def given_of(block: Samples) -> Readings:
    return series(block.true_t_ns, block.ideal_gyro, block.ideal_accel)


def read_in(
    model: GivenImu, readings: Readings, sizes: list[int], numbers: bool = False
) -> Samples:
    """Return the samples of readings in blocks of some sizes, in numbers where that is possible."""
    blocks, begin, k = [], 0, 0
    while begin < len(readings.t_ns):
        size = sizes[k % len(sizes)]
        part = readings.rows(slice(begin, begin + size))
        columns = (part.t_ns, part.gyro, part.accel)
        few = [LiveReading(*row) for row in zip(*(v.tolist() for v in columns), strict=True)]
        samples = model.read_few(few) if numbers and size < 8 else None
        blocks += model.read(part) if samples is None else [samples]
        begin, k = begin + size, k + 1
    return joined(blocks)


def assert_same(actual: Samples, expected: Samples) -> None:
    for name in (*TIMES, *(name for name in expected.values if name != "motion")):
        mine, theirs = getattr(actual, name), getattr(expected, name)
        assert np.ascontiguousarray(mine).tobytes() == np.ascontiguousarray(theirs).tobytes(), name


def test_every_parameter_of_a_triad_is_tested() -> None:
    tested = {*OF_TRIADS, *ONLY_AVERAGED}
    assert set(parameters(TriadParameters)) <= tested


@pytest.mark.parametrize("name", CASES)
def test_errors_are_those_of_the_simulation(name: str) -> None:
    """Whole, in blocks of mixed sizes and, where that is possible, in numbers.

    Single readings alone are what mixed blocks have, too: a term by itself is not read so.
    """
    expected = truth_of(CASES[name])
    single = [] if name in OF_TRIADS else [([1], False), ([1], True)]
    for sizes, numbers in (
        *(([COUNT], False), *single),
        *(([3, 64, 1, 200], False), ([3, 64, 1, 2], True)),
    ):
        samples = read_in(model_of(CASES[name]), given_of(expected), sizes, numbers)
        assert_same(samples, expected)


def test_single_readings_follow_blocks_and_faults() -> None:
    values = {k: v for name in ("noise_density", "resolution") for k, v in of_triads(name).items()}
    readings = given_of(truth_of(values))

    def run(pieces: list[tuple[int, int]]) -> Samples:
        model, blocks, begin = model_of(values), [], 0
        model.inject(Fault("stuck", 0.1, triad="gyroscope"), 2.0)
        for count, size in pieces:
            blocks.append(read_in(model, readings.rows(slice(begin, begin + count)), [size]))
            begin += count
        return joined(blocks)

    whole = run([(700, 700)])
    assert_same(run([(3, 3), (70, 1), (200, 200), (427, 1)]), whole)


def test_a_few_readings_are_numbers_wherever_the_next_errors_begin() -> None:
    """Errors are made for 64 samples at a time; three readings may need those of two chunks."""
    values: dict[str, object] = {
        "imu.gyroscope_noise_density": 0.01,
        "imu.accelerometer_random_walk": 1e-3,
        "imu.accelerometer_turn_on_scale_sigma": 0.01,
    }
    expected = truth_of(values)
    readings, model = given_of(expected), model_of(values)
    blocks: list[Samples] = [*(block["imu"] for block in model.read(readings.rows(slice(0, 1))))]
    for begin in range(1, 199, 3):
        rows = readings.rows(slice(begin, begin + 3))
        columns = (rows.t_ns.tolist(), rows.gyro.tolist(), rows.accel.tolist())
        samples = model.read_few([LiveReading(*row) for row in zip(*columns, strict=True)])
        assert samples is not None
        blocks.append(samples)
    samples = joined(blocks)
    assert_same(samples, expected.at(0, len(samples.t_ns)))


PLAIN: dict[str, object] = {
    "imu.preset": "mpu6000",
    "imu.stamp_offset": 0.002,
}
NOT_STEADY: dict[str, dict[str, object]] = {
    "latency": {"imu.latency": 0.003},
    "losses": {"imu.dropout_probability": 0.2},
    "bursts": {"imu.dropout_burst_rate": 2.0, "imu.dropout_burst_duration": 0.05},
    "duplicates": {"imu.duplicate_probability": 0.2},
    "jitter": {"imu.jitter": 0.0005},
    "skew": {"imu.clock_skew_ppm": 50.0},
    "filter": {"imu.gyroscope_bandwidth": 20.0},
}
"""Parameters with which more is to be done than to add errors to readings."""


@pytest.mark.parametrize("name", ["plain", *NOT_STEADY])
def test_readings_alone_are_those_of_the_samples(name: str) -> None:
    """Readings alone are those of a node without truth; in turn with blocks, some after a gap."""
    values = {**PLAIN, **NOT_STEADY.get(name, {})}
    readings = given_of(truth_of(values))
    keep = np.ones(len(readings.t_ns), dtype=bool)
    keep[300:310] = False
    readings = readings.rows(keep)
    samples = read_in(model_of(values), readings, [len(readings.t_ns)])
    model, rows, alone, sizes = model_of(values), list[tuple[object, ...]](), 0, [1, 2, 40, 3, 5]
    begin = k = 0
    while begin < len(readings.t_ns):
        part = readings.rows(slice(begin, begin + sizes[k % len(sizes)]))
        columns = (part.t_ns.tolist(), part.gyro.tolist(), part.accel.tolist())
        few = [LiveReading(*row) for row in zip(*columns, strict=True)]
        numbers = model.read_numbers(few) if len(few) < 8 and k % 3 else None
        if numbers is not None:
            rows += [(t_ns, *gyro, *accel) for t_ns, gyro, accel, _ in numbers]
            alone += 1
        else:
            few_samples = model.read_few(few) if len(few) < 8 else None
            block = joined(model.read(part) if few_samples is None else [few_samples])
            sent = block.delivered
            stamps = block.t_ns[sent].tolist()
            table = np.hstack([block.gyro[sent], block.accel[sent]]).tolist()
            rows += [(t_ns, *row) for t_ns, row in zip(stamps, table, strict=True)]
        begin, k = begin + len(part.t_ns), k + 1
    # What nobody sent during the gap is in the samples of a block, not in its messages.
    sent = samples.delivered
    table = np.hstack([samples.gyro[sent], samples.accel[sent]]).tolist()
    assert rows == [
        (t_ns, *row) for t_ns, row in zip(samples.t_ns[sent].tolist(), table, strict=True)
    ]
    assert bool(alone) == (name == "plain")


@pytest.mark.parametrize("preset", ["lecture", "mpu6000"])
def test_a_reading_alone_takes_few_calls(preset: str) -> None:
    """Numbers without their truth take fewer calls than samples, which have arrays."""
    model = model_of({"imu.preset": preset, "rate": 1000.0, "input.check": False})
    level = np.array([[0.0, 0.0, 9.81]])
    model.read(series(np.zeros(1, np.int64), level * 0.0, level))
    readings = [LiveReading(k * 1_000_000, (0.0, 0.0, 0.0), (0.0, 0.0, 9.81)) for k in range(1, 9)]
    for reading in readings[:-1]:
        assert model.read_numbers([reading]) is not None
    calls = 0

    def count(_: object, event: str, __: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    model.read_numbers(readings[-1:])
    sys.setprofile(None)
    assert calls < 60


@pytest.mark.parametrize("preset", ["lecture", "mpu6000", "tactical", "icm42688p", "bno055"])
def test_one_reading_takes_few_calls(preset: str) -> None:
    """Numbers take half as many calls as arrays of one row, which take some 140.

    Once in 64 readings what is added to them is made for the next ones; the others are as here.
    """
    model, gyro, accel = ims.ErrorModel(imu=preset, rate=1000), np.zeros(3), np.full(3, 5.0)
    for k in range(10):
        model.read(k * 1_000_000, gyro, accel)
    calls = 0

    def count(_: object, event: str, __: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    model.read(10_000_000, gyro, accel)
    sys.setprofile(None)
    assert calls < 100


def test_oversampled_errors_are_those_of_the_simulation() -> None:
    values = {**EVERY_TERM, "imu.sampling": "oversampled", "imu.internal_rate": 1000.0}
    count = 200  # each of five dense readings is also read by itself
    expected = truth_of(values, count)
    perfect = {name: v for name, v in values.items() if not name.startswith("imu.")}
    mounted = {name: values[name] for name in ("imu.lever_arm", "imu.mounting")}
    dense = truth_of({**perfect, **mounted, "rate": 1000.0}, 5 * (count - 1) + 1)
    for sizes in ([10000], [1], [3, 64, 1, 200]):
        model = model_of(values, **{"input.rate": 1000.0})
        assert_same(read_in(model, given_of(dense), sizes), expected)


def test_averaged_errors_are_close_to_those_of_the_simulation() -> None:
    values = {"imu.sampling": "averaged", "imu.gyroscope_bias": 0.1}
    expected = truth_of(values)
    dense = truth_of({"rate": 8000.0}, 40 * (COUNT - 1) + 1)
    samples = read_in(model_of(values, **{"input.rate": 8000.0}), given_of(dense), [1000])
    again = read_in(model_of(values, **{"input.rate": 8000.0}), given_of(dense), [7])
    assert np.array_equal(samples.gyro, again.gyro)
    assert np.array_equal(samples.accel, again.accel)
    # A straight line between readings misses h^2 / 12 of the second derivative, the lecture's
    # motion has some 1e3 m/s^4 of it: 1e-6.
    assert np.abs(samples.gyro - expected.gyro).max() < 1e-6
    assert np.abs(samples.accel - expected.accel).max() < 1e-5


def test_any_ratio_of_rates_is_sampled_in_any_blocks() -> None:
    dense = truth_of({"rate": 700.0}, 2100)
    expected = truth_of({"imu.gyroscope_noise_density": 0.01}, 600)
    values = {"imu.gyroscope_noise_density": 0.01, "input.rate": 700.0}
    samples = read_in(model_of(values), given_of(dense), [2100])
    assert np.array_equal(samples.true_t_ns, expected.true_t_ns[: len(samples.true_t_ns)])
    assert len(samples.true_t_ns) == 600
    repeated = read_in(model_of(values), given_of(dense), [1, 2, 50])
    assert_same(repeated, samples)
    assert np.abs(samples.gyro - expected.gyro).max() < 1e-4  # the noise is the same


def test_missing_samples_leave_the_errors_of_the_others_as_they_are() -> None:
    values = {"imu.gyroscope_noise_density": 0.01, "imu.gyroscope_random_walk": 1e-3}
    values |= {"imu.accelerometer_bias_instability": 1e-3}
    expected = truth_of(values)
    keep = np.ones(COUNT, dtype=np.bool_)
    keep[[100, 101, 102, 400]] = False
    model = model_of(values)
    samples = read_in(model, given_of(expected).rows(keep), [37])
    assert np.array_equal(samples.gyro, expected.gyro[keep])
    assert np.array_equal(samples.accel, expected.accel[keep])
    assert model.counts.missing == 4


def test_a_long_gap_is_a_pause() -> None:
    values = {"imu.gyroscope_noise_density": 0.01}
    expected = truth_of(values)
    readings = given_of(expected)
    late = readings.t_ns.copy()
    late[300:] += 60_000_000_000
    lines: list[str] = []
    model = GivenImu(
        load_error_model({"imu.preset": "perfect", "seed": 5, **values}), remark=lines.append
    )
    samples = joined(model.read(replace_fields(readings, t_ns=late)))
    assert np.array_equal(samples.gyro, expected.gyro)
    assert model.counts.pauses == 1
    assert "60.005 s: a pause" in lines[0]


@pytest.mark.parametrize("restart", ["same_seed", "next_seed"])
def test_a_jump_back_begins_again(restart: str) -> None:
    values = {"imu.gyroscope_noise_density": 0.01, "imu.latency": 0.01}
    starts, second = truth_of(values, 300), truth_of(values, 300)
    if restart == "next_seed":
        second = truth_of({**values, "seed": 6}, 300)
    twice = concatenate([given_of(starts), given_of(starts)])
    model = model_of(values, **{"input.restart": restart})
    samples = read_in(model, twice, [64])
    assert np.array_equal(samples.gyro, np.concatenate([starts.gyro, second.gyro]))
    assert model.counts.restarts == 1


def test_late_and_repeated_readings_are_left_out() -> None:
    values = {"imu.gyroscope_noise_density": 0.01}
    expected = truth_of(values)
    order = [0, 1, 2, 2, 3, 4, 1, 5, 6, 6, 7]
    model = model_of(values)
    samples = joined(model.read(given_of(expected).rows(np.array(order))))
    assert np.array_equal(samples.gyro, expected.gyro[:8])
    assert (model.counts.repeated, model.counts.backward) == (2, 1)


def test_live_changes_and_faults_do_not_depend_on_the_blocks() -> None:
    values = {"imu.gyroscope_noise_density": 0.01, "imu.gyroscope_random_walk": 1e-3}
    readings = given_of(truth_of(values))

    def run(sizes: list[int]) -> Samples:
        model = model_of(values)
        model.inject(Fault("bias_jump", 0.5, (0.1, 0.0, 0.0), "gyroscope"), 1.0)

        def read(rows: slice) -> Samples:
            return read_in(model, readings.rows(rows), sizes)

        begin = read(slice(0, 100))
        changed = load_error_model(
            {"imu.preset": "perfect", "seed": 5, **values, "imu.gyroscope_bias": [1.0, 0.0, 0.0]}
        )
        model.update(changed)
        return joined([begin, read(slice(100, None))])

    whole = run([1000])
    assert_same(run([1]), whole)
    assert_same(run([7, 64]), whole)
    jumps = np.flatnonzero(np.abs(np.diff(whole.gyro_bias[:, 0])) > 0.05) + 1
    assert jumps.tolist() == [128, 200, 300]  # the next multiple of 64; 1 s; 1.5 s


def test_a_parameter_that_is_not_live_stays() -> None:
    model = model_of({})
    with pytest.raises(ConfigurationError, match=r"imu\.gyroscope_bandwidth: cannot be changed"):
        model.update(
            load_error_model({"imu.preset": "perfect", "seed": 5, "imu.gyroscope_bandwidth": 10.0})
        )


# --------------------------------------------------------------------------- conventions
AXES = {
    "frd": np.diag([1.0, -1.0, -1.0]),
    "optical": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
}
"""``v_axes = M v_flu``: frd is forward, right, down; optical right, down, forward."""


@pytest.mark.parametrize("axes", AXES)
def test_axes_of_the_input_turn_without_rounding(axes: str) -> None:
    block = truth_of({})
    turned = series(
        block.true_t_ns, block.ideal_gyro @ AXES[axes].T, block.ideal_accel @ AXES[axes].T
    )
    samples = joined(model_of({}, **{"input.axes": axes}).read(turned))
    assert np.array_equal(samples.ideal_gyro, block.ideal_gyro)  # signs and order, no rounding
    assert np.array_equal(samples.ideal_accel, block.ideal_accel)


def test_frame_rotation_is_into_the_imu() -> None:
    block = truth_of({})
    r = rotation.to_matrix(rotation.from_euler(np.array([0.1, -0.2, 0.3])))
    turned = series(block.true_t_ns, block.ideal_gyro @ r, block.ideal_accel @ r)
    model = model_of({}, **{"input.frame_rotation": r.ravel().tolist()})
    assert np.allclose(joined(model.read(turned)).ideal_accel, block.ideal_accel, atol=1e-13)


@pytest.mark.parametrize("axes", ["flu", "frd", "optical"])
def test_missing_gravity_is_added_with_the_orientation(axes: str) -> None:
    block = truth_of({})
    r_wb = rotation.to_matrix(block.motion.q_wb)
    kinematic = np.einsum("nji,nj->ni", r_wb, block.motion.acceleration)  # R_bw a_w
    to_axes = AXES.get(axes, np.eye(3))
    r_w_axes = r_wb @ to_axes.T
    if axes == "frd":  # its world is north, east, down
        r_w_axes = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]) @ r_w_axes
    q = np.stack([rotation.from_matrix(r) for r in r_w_axes])
    readings = series(block.true_t_ns, block.ideal_gyro @ to_axes.T, kinematic @ to_axes.T, q)
    model = model_of({}, **{"input.gravity": "missing", "input.axes": axes})
    samples = joined(model.read(readings))
    assert np.allclose(samples.ideal_accel, block.ideal_accel, atol=1e-12)
    difference = np.abs(np.sum(samples.motion.q_wb * block.motion.q_wb, axis=1))
    assert np.allclose(difference, 1.0, atol=1e-12)  # of the body in east north up


def test_missing_gravity_needs_an_orientation() -> None:
    model = model_of({}, **{"input.gravity": "missing"})
    with pytest.raises(InputError, match=r"input\.gravity = missing: needs the orientation"):
        model.read(given_of(truth_of({})))


def test_lever_arm_from_the_rate_and_its_derivative() -> None:
    mounted = {
        "imu.lever_arm": [0.1, 0.2, -0.3],
        "imu.mounting": [0, -1, 0, 1, 0, 0, 0, 0, 1],
        "imu.accelerometer_positions": [0.01, 0, 0, 0, 0.02, 0, 0, 0, 0.03],
    }
    at_body, at_imu = truth_of({"rate": 1000.0}), truth_of({"rate": 1000.0, **mounted})
    model = model_of({**mounted, "rate": 1000.0}, **{"input.place": "body"})
    samples = read_in(model, given_of(at_body), [1, 30])
    assert np.allclose(samples.gyro, at_imu.gyro, atol=1e-14)
    # The stated error: |r| h^2 / 3 of the third derivative of the rate, here by differences.
    third = np.abs(np.diff(at_body.ideal_gyro, 3, axis=0) * 1000.0**3).max()
    bound = np.linalg.norm([0.1, 0.2, -0.3]) * third * 1e-6 / 3.0
    error = np.abs(samples.accel - at_imu.accel)[2:].max()
    assert error < 3.0 * bound  # three axes
    assert error > 0.01 * bound


def test_odometry_becomes_readings_late_by_what_is_stated() -> None:
    block = truth_of({"rate": 1000.0})
    q = block.motion.q_wb
    velocity_b = rotation.rotate_inverse(q, block.motion.velocity)
    for span in (1, 3):
        differentiator = Differentiator(load_error_model({"input.odometry_span": span}))
        parts = [
            differentiator.apply(block.true_t_ns[k], q[k], velocity_b[k], block.ideal_gyro[k])
            for k in (slice(0, 1), slice(1, 2), slice(2, 50), slice(50, COUNT))
        ]
        t_ns = np.concatenate([part.t_ns for part in parts])
        accel = np.concatenate([part.accel for part in parts])
        rows = slice(span, COUNT - span)
        assert np.array_equal(t_ns, block.true_t_ns[rows])
        third = np.abs(np.diff(block.motion.acceleration, 2, axis=0)).max() * 1e6
        bound = (span * 1e-3) ** 2 / 6.0 * third
        assert np.abs(accel - block.ideal_accel[rows]).max() < 2.0 * bound


def test_odometry_that_begins_again_or_repeats_itself() -> None:
    t_ns = np.array([10, 11, 12, 12, 13, 5, 6, 7, 8], np.int64) * 1_000_000_000
    ones, zero = np.tile(rotation.IDENTITY, (9, 1)), np.zeros((9, 3))
    whole = Differentiator(load_error_model({})).apply(t_ns, ones, zero, zero)
    assert (whole.t_ns // 1_000_000_000).tolist() == [11, 12, 6, 7]
    differentiator = Differentiator(load_error_model({}))
    parts = [differentiator.apply(t_ns[k : k + 1], ones[:1], zero[:1], zero[:1]) for k in range(9)]
    assert np.array_equal(np.concatenate([part.t_ns for part in parts]), whole.t_ns)


# ------------------------------------------------------------------------------ remarks
def resting(accel: list[float], rate: float = 200.0, **values: object) -> list[str]:
    lines: list[str] = []
    model = GivenImu(load_error_model({"imu.preset": "perfect", **values}), remark=lines.append)
    t_ns = np.arange(int(2.5 * rate), dtype=np.int64) * round(1e9 / rate)
    force = np.tile(accel, (len(t_ns), 1))
    q_wb = np.tile(rotation.IDENTITY, (len(t_ns), 1))
    readings = series(t_ns, np.zeros((len(t_ns), 3)), force, q_wb)
    for k in range(0, len(t_ns), 50):
        model.read(readings.rows(slice(k, k + 50)))
    return lines


def test_the_check_at_the_start() -> None:
    assert resting([0.0, 0.0, 9.81]) == []
    assert "gravity is missing" in resting([0.0, 0.0, 0.0])[0]
    assert "gravity is included" in resting([0.0, 0.0, 9.81], **{"input.gravity": "missing"})[0]
    assert resting([0.0, 0.0, 0.0], **{"input.gravity": "missing"}) == []
    assert "frd would fit" in resting([0.0, 0.0, -9.81])[0]
    assert "optical would fit" in resting([0.0, -9.81, 0.0])[0]
    assert resting([0.0, 0.0, -9.81], **{"input.axes": "frd"}) == []
    assert resting([0.0, -9.81, 0.0], **{"input.axes": "optical"}) == []
    upside_down = [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0]
    assert resting([0.0, 0.0, -9.81], **{"imu.mounting": upside_down}) == []
    assert "the readings come 1000 times a second" in resting([0.0, 0.0, 9.81], 1000.0)[0]
    assert resting([0.0, 0.0, 0.0], **{"input.check": False}) == []
    assert "instead of 9.81" in resting([0.0, 0.0, 1.0 * 8.0])[0]
    assert "it is in g; accel_unit='g' converts it" in resting([0.0, 0.0, 1.0])[0]


def moving(
    scale: float = 1.0, turn: float = 1.0, gravity: float = 1.0, **values: object
) -> list[str]:
    """Return the remarks on a body that pitches by up to 0.2 rad and shakes by up to 2 m/s^2."""
    lines: list[str] = []
    model = GivenImu(load_error_model({"imu.preset": "perfect", **values}), remark=lines.append)
    t = np.arange(500) / 200.0
    pitch, zero = 0.2 * np.sin(3.0 * t), np.zeros(500)
    up = np.stack([-np.sin(pitch), zero, np.cos(pitch)])
    force = 9.81 * gravity * up + np.stack([2.0 * np.sin(9.0 * t), zero, zero])
    gyro = np.stack([zero, 0.6 * np.cos(3.0 * t), zero]) * turn
    q_wb = np.stack([np.cos(0.5 * pitch), zero, np.sin(0.5 * pitch), zero])
    t_ns = np.rint(t * 1e9).astype(np.int64)
    model.read(series(t_ns, gyro.T, scale * force.T, q_wb.T))
    return lines


def test_conventions_are_checked_in_motion() -> None:
    assert moving() == []
    assert moving(gravity=0.0, **{"input.gravity": "missing"}) == []
    assert "it is in g" in moving(1.0 / 9.80665)[0]
    assert "gravity is missing" in moving(gravity=0.0)[0]
    assert "gravity is included" in moving(**{"input.gravity": "missing"})[0]
    assert "frd would fit" in moving(gravity=-1.0)[0]
    assert "deg/s" in moving(turn=180.0 / np.pi * 3.0)[0]


def test_axes_of_a_tumbling_body_are_said_to_be_unchecked() -> None:
    t = np.arange(500) / 200.0
    force = 9.81 * np.stack([np.sin(2 * np.pi * t), np.zeros(500), np.cos(2 * np.pi * t)])
    gyro = np.stack([np.zeros(500), np.full(500, -2 * np.pi), np.zeros(500)])
    lines: list[str] = []
    model = GivenImu(load_error_model({"imu.preset": "perfect"}), remark=lines.append)
    model.read(series(np.rint(t * 1e9).astype(np.int64), gyro.T, force.T))
    assert "input.axes: not checked" in lines[0]


QUIETEST = "navigation"
"""The preset with the least white noise of both triads."""


def said_of(readings: Readings, rate: float, imu: str = QUIETEST, **values: object) -> list[str]:
    """Return the remarks on noise, those of blocks of any size."""
    lines: list[list[str]] = []
    for size in (len(readings.t_ns), 77):
        warned: list[str] = []
        given_values = {"imu.preset": imu, "rate": rate, **values}
        model = GivenImu(load_error_model(given_values), remark=warned.append)
        read_in(model, readings, [size])
        lines.append([line for line in warned if "white noise" in line])
    assert lines[0] == lines[1]
    return lines[0]


def fly(rate: float, trajectory: str = "figure_eight", **imu: object) -> ims.Flight:
    """Return 2.1 s of an IMU."""
    imu_values = {"preset": "perfect", **imu}
    return ims.simulate(imu=imu_values, trajectory=trajectory, rate=rate, duration=2.1, seed=1)


def read_of(flight: ims.Flight) -> Readings:
    return series(flight.t_ns, flight.gyro, flight.accel)


def ideal_of(rate: float, trajectory: str = "figure_eight") -> Readings:
    return read_of(fly(rate, trajectory))


def densities(lines: list[str]) -> list[float]:
    return [float(line.split("white noise of ")[1].split()[0]) for line in lines]


def test_the_preset_named_as_quietest_has_the_least_noise() -> None:
    presets = set(files.names("imus")) - {"perfect"}
    for triad in ("gyroscope", "accelerometer"):
        values = {
            name: min(load_error_model({"imu.preset": name}).imu.triad(triad).noise_density)
            for name in presets
        }
        assert min(values, key=values.__getitem__) == QUIETEST


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("trajectory", files.names("trajectories"))
def test_ideal_readings_have_no_noise(trajectory: str, rate: float) -> None:
    readings = ideal_of(rate, trajectory)
    assert said_of(readings, rate) == []
    single = [
        values.astype(np.float32).astype(np.float64) for values in (readings.gyro, readings.accel)
    ]
    assert said_of(series(readings.t_ns, *single), rate) == []


@pytest.mark.parametrize("rate", [50.0, 100.0, 1000.0])
@pytest.mark.parametrize("trajectory", ["static", "excitation"])
def test_noise_is_told_with_its_density(trajectory: str, rate: float) -> None:
    """Half of the sensor's is told, a quarter is not; the number is good to 40 %."""
    ideal, expected_densities = ideal_of(rate, trajectory), (6.1707e-05, 0.0027737)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        noise = rng.standard_normal((2, len(ideal.t_ns), 3)) * np.sqrt(rate)
        for share, count in ((1.0, True), (0.5, True), (0.25, False)):
            gyro, accel = (
                values + share * density * white
                for values, density, white in zip(
                    (ideal.gyro, ideal.accel), expected_densities, noise, strict=True
                )
            )
            coarse = {f"imu.{triad}_resolution": 0.0 for triad in ("gyroscope", "accelerometer")}
            lines = said_of(series(ideal.t_ns, gyro, accel), rate, "mpu6000", **coarse)
            assert [line.split()[2] for line in lines] == ["gyroscope", "accelerometer"] * count
            ratios = np.array(densities(lines)) / share / expected_densities[: len(lines)]
            assert ((ratios > 0.7) & (ratios < 1.4)).all()


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("sensor", ["mpu6000", "bmi088", "adis16470", "lecture", QUIETEST])
def test_errors_that_are_added_twice_are_told(sensor: str, rate: float) -> None:
    readings = read_of(fly(rate, preset=sensor))
    gyro, accel = said_of(readings, rate, sensor)
    assert "input: the gyroscope has white noise of " in gyro
    assert "rad/s/sqrt(Hz) already, and imu.gyroscope_noise_density adds " in gyro
    assert "m/s^2/sqrt(Hz) already, and imu.accelerometer_noise_density adds " in accel
    assert "switch off the noise of the source, or set imu.gyroscope_noise_density = 0" in gyro
    # Who does so is not told again, and a perfect sensor adds none.
    assert said_of(readings, rate, sensor, **{"imu.gyroscope_noise_density": 0.0}) == [accel]
    assert said_of(readings, rate, "perfect") == []
    assert said_of(readings, rate, sensor, **{"input.check": False}) == []
    # Much less than that of another sensor does not matter.
    if sensor == QUIETEST:
        assert said_of(readings, rate, "mpu6000") == []


def test_noise_of_an_input_in_other_axes_and_faster_than_the_sensor() -> None:
    ideal = ideal_of(1000.0)
    noise = np.random.default_rng(1).standard_normal((len(ideal.t_ns), 3)) * [0.0, 0.0, 0.05]
    readings = replace_fields(ideal, accel=ideal.accel + noise)
    axes = {"imu.accelerometer_noise_density": [1.0, 1.0, 0.002], "input.axes": "optical"}
    assert said_of(readings, 1000.0, "perfect", **axes) == []  # z is the sensor's x
    axes["imu.accelerometer_noise_density"] = [0.002, 1.0, 1.0]
    (line,) = said_of(readings, 1000.0, "perfect", **axes)
    assert "adds 0.002" in line
    # Every tenth reading has the noise of each; a mean of ten has less.
    faster = {"imu.accelerometer_noise_density": 0.002, "input.rate": 1000.0}
    (single,) = densities(said_of(readings, 100.0, "perfect", **faster))
    faster["imu.sampling"] = "averaged"
    (mean,) = densities(said_of(readings, 100.0, "perfect", **faster))
    assert single == pytest.approx(0.05 / 10.0, rel=0.15)
    assert mean == pytest.approx(0.05 / np.sqrt(1000.0), rel=0.15)


LINES = {
    "line_frequency": [87.0, 261.0],
    "line_amplitude": [0.02, 0.01] * 3 + [2.0, 0.5] * 3,
}
BAND = {"band_low": [20.0], "band_high": [80.0], "band_density": [1e-3] * 3 + [0.05] * 3}


@pytest.mark.parametrize("vibration", [LINES, BAND], ids=["lines", "band"])
@pytest.mark.parametrize("rate", [200.0, 1000.0])
def test_vibration_is_no_noise(vibration: dict[str, object], rate: float) -> None:
    shaken = fly(rate, **{f"vibration.{name}": value for name, value in vibration.items()})
    assert said_of(read_of(shaken), rate) == []


@pytest.mark.parametrize("share", [0.06, 1 / 7, 0.25, 0.3, 0.45, 0.5, 0.75, 0.9, 0.95])
def test_held_readings_are_no_noise_and_theirs_is_told(share: float) -> None:
    """A simulator takes coarser steps than its IMU reads, at any ratio."""
    rate = 1000.0
    fine = ims.simulate(imu="perfect", trajectory="excitation", rate=20 * rate, duration=2.1)
    t_ns = np.arange(2050) * 1_000_000
    step = np.floor(np.arange(len(t_ns)) * share + 1e-9).astype(int)
    rows = np.rint(step / share * 20).astype(int)
    readings = series(t_ns, fine.gyro[rows], fine.accel[rows])
    assert said_of(readings, rate) == []
    starts = np.unique(step, return_index=True)[1]
    joined_up = [
        np.interp(t_ns, t_ns[starts], axis_values) for axis_values in readings.accel[starts].T
    ]
    assert said_of(replace_fields(readings, accel=np.stack(joined_up, axis=1)), rate) == []
    density = 0.001
    noise = np.random.default_rng(1).standard_normal(readings.accel.shape)
    noise *= density * np.sqrt(rate * share)
    noisy = said_of(replace_fields(readings, accel=readings.accel + noise[step]), rate, "bmi055")
    if share in (0.06, 0.25, 0.5, 0.95):  # others have no stretch of even steps
        assert densities(noisy) == [pytest.approx(density, rel=0.3)]


def swinging(t: np.ndarray, frequency: float, to: float) -> Readings:
    """Return readings of up to 20 m/s^2 whose frequency rises in 2 s [Hz]."""
    phase = 2.0 * np.pi * (frequency * t + 0.25 * (to - frequency) * t * t)
    swing = 20.0 * np.sin(phase[:, None] + np.arange(3))
    return series(np.rint(t * 1e9).astype(np.int64), 0.1 * swing, swing)


@pytest.mark.parametrize(("rate", "band"), [(100.0, (8.3, 8.3)), (200.0, (1.0, 13.0))])
def test_fast_motion_is_no_noise(rate: float, band: tuple[float, float]) -> None:
    t = np.arange(round(2.1 * rate)) / rate
    assert said_of(swinging(t, *band), rate, "hg4930") == []


@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_contacts_gaps_and_jitter_are_no_noise(rate: float) -> None:
    rng, count = np.random.default_rng(1), round(2.1 * rate)
    t = np.arange(count) / rate
    readings = swinging(t, 3.0, 3.0)
    hit = rng.random((count, 1)) < 0.1
    kicks = rng.standard_normal((2, count, 3)) * hit
    kicked = replace_fields(
        readings, gyro=readings.gyro + kicks[0], accel=readings.accel + 20.0 * kicks[1]
    )
    assert said_of(kicked, rate, "bmi088") == []
    for lost in (0.01, 0.1, 0.4):
        assert said_of(readings.rows(rng.random(count) >= lost), rate) == []
    late = np.sort(t + rng.uniform(0.0, 0.3 / rate, count))
    assert said_of(swinging(late, 3.0, 3.0), rate) == []


def test_noise_is_told_in_spite_of_contacts_and_a_gap_but_not_of_few_readings() -> None:
    rng, density = np.random.default_rng(1), 6e-5
    coarse = {"imu.gyroscope_resolution": 0.0}
    for rate in (1000.0, 40.0):
        t = np.arange(round(2.1 * rate)) / rate
        readings = swinging(t, 1.0, 1.0)
        kicks = rng.standard_normal(readings.gyro.shape) * (rng.random((len(t), 1)) < 0.05)
        noise = density * np.sqrt(rate) * rng.standard_normal(kicks.shape)
        noisy = replace_fields(readings, gyro=readings.gyro + kicks + noise).rows(
            (t < 0.7) | (t > 1.1)
        )
        # Of 1,700 readings 5 % are hit, and each hit disturbs its neighbours too: the robust
        # estimate is wider by these, within 20 %.
        told_densities = densities(said_of(noisy, rate, "mpu6000", **coarse))
        assert told_densities == ([pytest.approx(density, rel=0.2)] if rate > 50.0 else [])


@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_rounding_is_noise_if_it_is_coarse(rate: float) -> None:
    ideal, deviation = ideal_of(rate), 0.00019613 * np.sqrt(rate)
    k = np.arange(len(ideal.t_ns))[:, None]
    moving = np.sin(0.05 * k + np.arange(3)) + np.sin(0.071 * k)
    for steps, count in ((0.8, 0), (2.0, 1)):
        step = steps * deviation
        readings = replace_fields(ideal, accel=np.rint(ideal.accel / step + 300.0 * moving) * step)
        lines = said_of(readings, rate, **{"imu.accelerometer_resolution": 0.0})
        assert len(lines) == count
        assert all("coarse rounding look the same" in line for line in lines)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"imu.sampling": "averaged"}, "imu.sampling = 'averaged': needs input.rate above"),
        ({"input.rate": 100.0}, "input.rate = 100: must be 0 or at least the rate, 200 Hz"),
        (
            {
                "imu.sampling": "oversampled",
                "imu.gyroscope_bandwidth": 50.0,
                "imu.accelerometer_bandwidth": 50.0,
            },
            "input.rate = 0: must be 1600 Hz, the rate inside the sensor",
        ),
        ({"input.frame_rotation": [1.0, 0, 0, 0, 2, 0, 0, 0, 1]}, "must be a rotation matrix"),
        ({"input.axes": "ned"}, "input.axes = 'ned'"),
        (
            {**VIBRATION, "imu.vibration.gyroscope_exponents": [1.0, 0.0, 0.0]},
            "imu.vibration: exponents must be 0",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_a_line(values: dict[str, object], line: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load_error_model({"imu.preset": "perfect", **values})
    assert any(line in problem for problem in caught.value.problems), caught.value.problems


def test_parameters_of_the_simulator_are_passed_over() -> None:
    built = load_error_model({"publish.ground_truth": True, "real_time_factor": 2.0})
    assert built.imu.preset == "lecture"


def episodes(length: int, count: int, first_ns: int = 0) -> Readings:
    """Return readings whose stamps begin again after each ``length``."""
    t_ns = np.tile(np.arange(length, dtype=np.int64) * 5_000_000, count)
    t_ns[length:] += first_ns
    zero = np.zeros((len(t_ns), 3))
    return series(t_ns, zero, zero)


@pytest.mark.parametrize("first_ns", [0, 7_000_000], ids=["same start", "later start"])
@pytest.mark.parametrize("sizes", [[1], [7], [5000]], ids=str)
def test_episodes_shorter_than_a_second_lose_nothing(sizes: list[int], first_ns: int) -> None:
    """Episodes of 0.5 s; one may begin a period and a half later than the first."""
    values = {"imu.gyroscope_noise_density": 0.01}
    readings = episodes(100, 10, first_ns)
    model = model_of(values, **{"input.restart": "next_seed"})
    samples = read_in(model, readings, sizes)
    assert np.array_equal(samples.true_t_ns, readings.t_ns)
    assert (model.counts.restarts, model.counts.backward) == (9, 0)
    expected = [truth_of({**values, "seed": 5 + k}, 100).gyro_noise for k in range(10)]
    assert np.array_equal(samples.gyro_noise, np.concatenate(expected))
    odometry = Differentiator(load_error_model({}))
    ones = np.tile(rotation.IDENTITY, (len(readings.t_ns), 1))
    differentiator = odometry.apply(readings.t_ns, ones, readings.gyro, readings.accel)
    assert len(differentiator.t_ns) == 10 * 98  # two of each episode have no neighbour


def test_a_reset_takes_the_next_seed_if_a_jump_back_does() -> None:
    values = {"imu.gyroscope_noise_density": 0.01}
    readings = given_of(truth_of(values, 50))
    for restart, seeds in (("same_seed", (5, 5, 5)), ("next_seed", (5, 6, 7))):
        model = model_of(values, **{"input.restart": restart})
        for seed in seeds:
            samples = joined(model.read(readings))
            assert np.array_equal(
                samples.gyro_noise, truth_of({**values, "seed": seed}, 50).gyro_noise
            )
            model.reset()


def test_readings_that_come_late_at_the_end_are_counted() -> None:
    model = model_of({})
    order = np.array([0, 1, 2, 3, 2])
    model.read(given_of(truth_of({})).rows(order))
    assert (model.counts.samples, model.counts.backward) == (4, 1)


@pytest.mark.parametrize("sizes", [[1], [7], [1000]], ids=str)
def test_irregular_stamps_are_no_missing_samples(sizes: list[int]) -> None:
    """Intervals of 0.3 and 1.7 periods, and bursts of four; a real gap among them is one."""
    for pattern in ([0.3, 1.7], [0.2, 0.2, 0.2, 3.4], [0.5, 1.5]):
        steps = np.resize(pattern, 400)
        steps[201] += 3.0
        t_ns = np.concatenate([[0], np.cumsum(np.rint(steps * 5e6).astype(np.int64))])
        zero = np.zeros((len(t_ns), 3))
        model = model_of({})
        read_in(model, series(t_ns, zero, zero), sizes)
        assert model.counts.missing == 3, pattern
