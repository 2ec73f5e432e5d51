# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One start for node and command: the same readings give the same state, bit for bit."""

import json

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands import dead_reckon, generate
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import LiveReading, Readings
from imu_sim_ros.jobs.dead_reckon import ReadingsAndTruth, initial_condition
from imu_sim_ros.navigation import initialisation
from imu_sim_ros.navigation.evaluation import anees_band
from imu_sim_ros.navigation.parameters import IntegratorParameters, load_integrator
from imu_sim_ros.nodes.integrator.initialiser import initialiser
from imu_sim_ros.recordings.order import READINGS_GAP, LiveGap

STEP_NS = 5_000_000
G_SENSITIVITY = [1e-3, 0.0, 2e-3, 0.0, -1e-3, 5e-4, 3e-4, 0.0, 1e-3]
KNOWN = {
    "initial_state": "level",
    "level_time": 0.5,
    "initial_position": [1.0, 2.0, 3.0],
    "initial_velocity": [4.0, 5.0, 6.0],
    "initial_orientation": [0.0, 0.0, 1.0],
    "gyroscope_bias": [0.01, -0.02, 0.03],
    "accelerometer_bias": [0.1, 0.0, -0.1],
    "gyroscope_scale_misalignment": [1.02, 0.01, 0.0, 0.0, 0.98, 0.0, 0.0, 0.02, 1.01],
    "gyroscope_g_sensitivity": G_SENSITIVITY,
    "imu.gyroscope_noise_density": 0.01,
    "imu.accelerometer_turn_on_bias_sigma": 0.2,
}


def parameters(**values) -> IntegratorParameters:
    return load_integrator({**KNOWN, **values})


def record(count=300, gap=None):
    """Return noisy readings at rest, a hundred of which are lost before row ``gap``."""
    generator = np.random.default_rng(7)
    rows = np.arange(count)
    if gap is not None:
        rows[gap:] += 100
    gyro = generator.normal([0.02, 0.01, -0.01], 0.001, (count, 3))
    accel = generator.normal([0.5, -0.3, 9.78], 0.01, (count, 3))
    t_ns = 10**9 + rows * STEP_NS
    return Readings(t_ns, gyro, accel)


def of_the_node(chosen, readings):
    """Return the start that the node's initialiser finds, reading by reading."""
    gap = LiveGap(chosen.max_gap, READINGS_GAP)
    complaints = []
    start = initialiser(chosen, gap, complaints.append)
    columns = (readings.t_ns.tolist(), readings.gyro.tolist(), readings.accel.tolist())
    for t_ns, gyro, accel in zip(*columns, strict=True):
        gap.add(t_ns)
        start_state = start.add_reading(LiveReading(t_ns, tuple(gyro), tuple(accel)))
        if start_state is not None:
            assert all("begin again" in line for line in complaints)
            return start_state.readings[0].t_ns, start_state.initial
    return None


@pytest.mark.parametrize("state", ["level", "parameters"])
@pytest.mark.parametrize("gap", [None, 50])
def test_node_and_command_start_alike(state, gap):
    chosen, readings = parameters(initial_state=state), record(gap=gap)
    begun = initial_condition(chosen, ReadingsAndTruth(readings, None))
    start_ns, of_node = of_the_node(chosen, readings)
    assert begun.recording.readings.t_ns[0] == start_ns
    for mine, node_value in zip(begun.state, of_node.state, strict=True):
        np.testing.assert_array_equal(mine, node_value)
    assert begun.correction == of_node.correction


def test_the_bias_found_at_rest_makes_the_corrected_rate_zero():
    """Whatever was known before, the mean of the corrected readings is that of a body at rest."""
    chosen, readings = parameters(), record()
    rest = initialisation.rest_rows(chosen, readings.t_ns)
    initial = initialisation.from_rest(chosen, readings.gyro[rest], readings.accel[rest])
    rate, force = initial.correction.apply(readings.gyro[rest], readings.accel[rest])
    np.testing.assert_allclose(rate.mean(axis=0), 0.0, atol=1e-15)
    up = rotation.rotate(initial.state.q_wb, force.mean(axis=0))
    np.testing.assert_allclose(up[:2], 0.0, atol=1e-14)


def test_the_turning_of_the_earth_is_no_bias():
    earth_rate = [0.0, 4e-5, 6e-5]
    chosen = parameters(earth_rate=earth_rate)
    readings = record()
    initial = initialisation.from_rest(chosen, readings.gyro, readings.accel)
    rate, _ = initial.correction.apply(readings.gyro, readings.accel)
    start_state = rotation.rotate(initial.state.q_wb, rate.mean(axis=0))
    np.testing.assert_allclose(start_state, earth_rate, atol=1e-15)


def test_readings_that_are_not_finite_are_passed_over():
    chosen, readings = parameters(), record()
    readings.gyro[3] = np.nan
    readings.accel[5] = np.inf
    initial = initialisation.from_rest(chosen, readings.gyro, readings.accel)
    assert np.isfinite(np.concatenate(initial.state)).all()
    assert np.isfinite(initial.correction.gyroscope_bias).all()


@pytest.mark.parametrize("count", [1, 2, 100])
def test_too_short_a_rest_is_said(count):
    with pytest.raises(InputError, match=r"level_time = 0.5: the readings .* last only"):
        initialisation.rest_rows(parameters(), record(count).t_ns)


def test_levelling_with_a_known_g_sensitivity_stays_in_place(tmp_path, capsys):
    """A perfect IMU at rest but for its g-sensitivity, which the correction knows."""
    values = f"gyroscope_g_sensitivity={json.dumps(G_SENSITIVITY)}"
    bag = str(tmp_path / "rest.mcap")
    options = ["--imu", "perfect", "--trajectory", "static", "--duration", "30s", "--quiet"]
    assert generate.main([*options, "--set", f"imu.{values}", "-o", bag]) == 0
    options = ["--initial-state", "level", "--set", values, "--json"]
    assert dead_reckon.main([bag, *options]) == 0
    assert json.loads(capsys.readouterr().out)["final_position_error_m"] < 1e-9


@pytest.mark.parametrize(
    ("trajectory", "message"),
    [("figure_eight", "the body moves|by the truth"), ("circle", "by the truth the body moves")],
)
def test_levelling_in_motion_is_refused(trajectory, message):
    """A figure of eight was levelled and 251 m off after 20 s, without a word."""
    flight = ims.simulate(imu="tactical", trajectory=trajectory, duration=5, rate=100, seed=1)
    with pytest.raises(InputError, match=message):
        ims.dead_reckon(flight, initial="level")


@pytest.mark.parametrize("trajectory", ["figure_eight", "tumble", "lecture"])
def test_motion_is_told_by_the_readings_alone(trajectory):
    flight = ims.simulate(imu="mpu6000", trajectory=trajectory, duration=5, rate=100, seed=1)
    readings = ims.Readings(flight.t_ns, flight.gyro, flight.accel)
    with pytest.raises(InputError, match="the body moves|the body turns|not at rest"):
        ims.dead_reckon(readings, initial="level")


@pytest.mark.parametrize("preset", ["bno055", "mpu6000", "adis16448", "lecture"])
def test_the_sensor_of_a_flight_tells_what_rest_may_look_like(preset):
    """A bno055 has a bias of 0.8 m/s^2: 38 of 60 rests were refused as motion.

    The limits are four standard deviations of the bias and 25 times the variance of white noise:
    one of 40 rests is refused once in 100 times, at most.
    """
    for seed in range(10):
        flight = ims.simulate(imu=preset, trajectory="static", duration=3, rate=50, seed=seed)
        ims.dead_reckon(flight, initial="level")


def test_a_walk_of_the_sensor_over_a_long_rest_is_no_motion():
    imu = {"preset": "perfect", "accelerometer_random_walk": 3e-3, "gyroscope_random_walk": 3e-4}
    flight = ims.simulate(imu=imu, trajectory="static", duration=610, rate=20, seed=3)
    for readings in (flight, ims.Readings(flight.t_ns, flight.gyro, flight.accel)):
        ims.dead_reckon(readings, initial="level", level_time=600.0)


LEVELLED = ("tactical", "icm42688p", "mpu6000", "adis16448", "bmi088", "bno055", "lecture", "vn100")


def levelled_nees(preset, runs):
    """Return the mean NEES of the position at the end of flights that start level."""
    squares = []
    for seed in range(runs):
        flight = ims.simulate(
            imu=preset,
            trajectory={"type": "figure_eight", "rest_before": 8.0},
            duration=15,
            rate=50,
            seed=seed,
        )
        track = ims.dead_reckon(flight, initial="level", covariance=True, level_time=7.0)
        error = track.position[-1] - flight.truth.position[-1]
        squares.append(error @ np.linalg.solve(track.covariance[-1][:3, :3], error))
    return float(np.mean(squares))


def test_the_covariance_of_a_level_start_holds():
    """An exact start would have a third of the NEES; the band is that of 99.9 %."""
    low, high = anees_band(3, 20, 0.999)
    assert low < levelled_nees("icm42688p", 20) < high


@pytest.mark.slow
@pytest.mark.parametrize("preset", LEVELLED)
def test_the_covariance_of_a_level_start_holds_for_each_preset(preset):
    """All eight lie in their bands with a probability of 95 % (Bonferroni)."""
    low, high = anees_band(3, 60, 1.0 - 0.05 / len(LEVELLED))
    assert low < levelled_nees(preset, 60) < high
