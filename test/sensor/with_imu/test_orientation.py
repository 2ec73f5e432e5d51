# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The orientation that a board states: its stated errors, and a filter against other people's."""

import itertools
import math
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from simulation_runs import read_all, same_bytes

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.errors.realised import realise_imu
from imu_sim_ros.sensors.orientation.model import EXACT
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.sensors import models, mount_sensors
from imu_sim_ros.trajectory.build import build_trajectory

BASE: dict[str, Any] = {"imu.preset": "perfect", "trajectory.type": "figure_eight", "rate": 100.0}
MOUNTING = Rotation.from_euler("zyx", [0.4, -0.2, 1.1])
MOUNTED = {"imu.mounting": MOUNTING.as_matrix().ravel().tolist()}
MODEL = {
    "imu.orientation_turn_on_sigma": [0.01, 0.01, 0.05],
    "imu.orientation_drift_sigma": [0.005, 0.006, 0.02],
    "imu.orientation_drift_time": 3.0,
    "imu.orientation_noise": [0.002, 0.003, 0.01],
    "imu.orientation_acceleration_sensitivity": [0.004, 0.005, 0.01],
}
FILTER = {
    "imu.preset": "mpu9250",
    "imu.orientation_source": "filter",
    "imu.magnetometer_rate": 70.0,
    "imu.magnetometer_time_offset": 0.003,
    "imu.magnetometer_noise_density": 3e-8,
    "imu.magnetometer_hard_iron": [1e-5, -2e-5, 5e-6],
    "imu.magnetometer_soft_iron_sigma": 0.02,
    "imu.magnetometer_turn_on_scale_sigma": 0.02,
    "imu.magnetometer_misalignment": [0.02, 0.01, -0.03],
    "imu.orientation_time_constant": 4.0,
}


def simulation(*layers: dict[str, Any], sensors: tuple[str, ...] = ("orientation",)) -> Body:
    values = dict(BASE)
    for layer in layers:
        values.update(layer)
    return Body(load_simulation(values), sensors=sensors)


def test_windows_need_not_begin_and_end_with_samples_of_the_imu() -> None:
    """Readings of the field before, at and after the IMU's, and windows with none of either."""
    p = load_simulation({**BASE, **FILTER, "rate": 10.0, "duration": 30.0})
    world = World(build_trajectory(p.trajectory), p, 0)
    names = {"orientation": "q_wi", "magnetic_field": "field", "pressure": "pressure"}

    def read(edges: np.ndarray) -> dict[str, np.ndarray]:
        models_by_name = models(mount_sensors(p), tuple(names), 0)
        times = [Fraction(edge) for edge in edges]
        windows = [Window(*pair) for pair in itertools.pairwise(times)]
        samples = [{n: models_by_name[n].read(w, world) for n in models_by_name} for w in windows]
        return {
            n: np.concatenate([sample[n].values[v] for sample in samples]) for n, v in names.items()
        }

    inner = np.random.default_rng(5).uniform(0.0, 30.0, 700)
    whole, parts = read(np.array([0.0, 30.0])), read(np.sort([0.0, *inner, 30.0]))
    assert len(whole["orientation"]) == 300
    assert all(np.array_equal(whole[name], parts[name]) for name in names)


stated = partial(read_all, quantity="orientation")


def as_rotation(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q[..., [1, 2, 3, 0]])


def errors(samples: Samples) -> np.ndarray:
    """Return rotation vectors about the world's axes (n, 3) [rad]."""
    truth = as_rotation(samples.ideal_q_wi)
    error: np.ndarray = (as_rotation(samples.q_wi) * truth.inv()).as_rotvec()
    return error


def test_without_errors_it_is_the_attitude_of_the_imu() -> None:
    run = simulation(MOUNTED)
    samples = stated(run, 100, 300)
    motion = run.trajectory.sample(np.arange(300) / 100.0)
    truth = as_rotation(motion.q_wb) * MOUNTING
    assert np.abs((as_rotation(samples.q_wi) * truth.inv()).magnitude()).max() < 1e-9
    assert np.allclose(samples.q_wi, samples.ideal_q_wi, rtol=0.0, atol=1e-15)
    assert np.all(samples.variance == EXACT)


@pytest.mark.parametrize("preset", files.names("imus"))
def test_every_preset_states_how_exact_its_orientation_is(preset: str) -> None:
    """A covariance of zeros would be unknown: no sensor's orientation comes without one."""
    samples = stated(simulation({"imu.preset": preset}), 100, 200)
    assert np.all(samples.variance >= EXACT)
    rotation_errors = errors(samples)
    assert np.abs(rotation_errors).max() < 6.0 * np.sqrt(samples.variance.max())


def test_the_error_has_the_stated_covariance() -> None:
    """NEES over seeds, at times far apart: chi-squared with three degrees of freedom each."""
    seeds, nees, squares = 150, [], []
    for seed in range(seeds):
        samples = stated(simulation(MOUNTED, MODEL, {"seed": seed}), 8192, 301)
        rows = [0, 300]
        error, variance = errors(samples)[rows], samples.variance[rows]
        nees.append(np.sum(error**2 / variance, axis=1))
        squares.append(error**2 / variance)
    for k in range(2):
        total = np.sum(np.array(nees)[:, k])
        assert chi2.ppf(1e-4, 3 * seeds) < total < chi2.ppf(1.0 - 1e-4, 3 * seeds)
    per_axis = np.sum(np.array(squares)[:, 1], axis=0)
    assert (per_axis > chi2.ppf(1e-4, seeds)).all()
    assert (per_axis < chi2.ppf(1.0 - 1e-4, seeds)).all()


def test_the_variance_is_the_sum_of_the_parts() -> None:
    run = simulation(MODEL)
    samples = stated(run, 64, 200)
    a = np.linalg.norm(run.trajectory.sample(np.arange(200) / 100.0).acceleration, axis=1)
    parts = [
        np.square(MODEL[f"imu.orientation_{n}"]) for n in ("turn_on_sigma", "drift_sigma", "noise")
    ]
    dynamic = np.outer(a**2, np.square(MODEL["imu.orientation_acceleration_sensitivity"]))
    assert np.allclose(samples.variance, sum(parts) + dynamic, rtol=1e-12)


@pytest.mark.parametrize("layer", [MODEL, FILTER], ids=["model", "filter"])
@pytest.mark.parametrize("size", [1, 7, 64, 1000])
def test_samples_do_not_depend_on_the_block_size(layer: dict[str, Any], size: int) -> None:
    count = 300 if size == 1 else 1500
    settings = {"imu.orientation_rate": 25.0, "imu.dropout_probability": 0.1}
    whole, pieces = (stated(simulation(layer, settings), s, count) for s in (count, size))
    assert same_bytes(whole, pieces)
    assert len(whole.t_ns) == count // 4
    assert len(whole.delivered) < len(whole.t_ns)


def test_the_filter_needs_no_topic_of_the_magnetometer_and_changes_nothing() -> None:
    alone = simulation(FILTER).next(400)
    together = simulation(FILTER, sensors=("orientation", "magnetic_field")).next(400)
    off = simulation(FILTER, sensors=()).next(400)
    assert "magnetic_field" not in alone
    assert alone["orientation"] is not None
    assert together["orientation"] is not None
    assert np.array_equal(alone["orientation"].q_wi, together["orientation"].q_wi)
    assert np.array_equal(alone["imu"].gyro, off["imu"].gyro)


@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.0], [0.3, -0.4, 2.0]])
def test_at_rest_without_noise_the_filter_finds_true_north(turn: list[float]) -> None:
    values = {
        **MOUNTED,
        "trajectory.type": "static",
        "trajectory.roll_pitch_yaw": turn,
        "imu.orientation_source": "filter",
        "magnetic_field.value": [5e-6, 1.8e-5, -4.5e-5],
        "imu.magnetometer_hard_iron": [1e-5, 0.0, 2e-5],
        "imu.magnetometer_misalignment": [0.1, 0.0, 0.1],
        "imu.gyroscope_bias": [0.01, -0.02, 0.03],
        "imu.accelerometer_scale_misalignment": [1.01, 0.02, 0, 0, 0.98, 0, 0.01, 0, 1.0],
    }
    samples = stated(simulation(values), 500, 3000)
    assert np.abs(errors(samples)).max() < 1e-9


def calibrated(readings: np.ndarray, triad: Any) -> np.ndarray:
    result: np.ndarray = (readings - triad.bias) @ np.linalg.inv(triad.response()).T
    return result


def test_the_tilt_is_that_of_mahony_s_filter_for_small_errors() -> None:
    """Against ahrs' recurrence with the gains of the same time constant, once both have settled.

    Both are wrong by the body's acceleration, alike to first order: theirs takes the direction of
    each reading, ours the direction of the mean, which differ by its square. The body sways and
    does not turn: their integral turns with the body, ours does not.
    """
    filters = pytest.importorskip("ahrs.filters")
    sway = {
        "trajectory.type": "harmonic",
        "trajectory.x.amplitude": [1.0],
        "trajectory.x.angular_frequency": [0.7],
        "trajectory.y.amplitude": [2.0],
        "trajectory.y.angular_frequency": [0.4],
        "imu.orientation_time_constant": 5.0,
    }
    run = simulation(FILTER, sway)
    block = run.next(6000)
    assert block["orientation"] is not None
    unit = realise_imu(run.parameters.imu, run.parameters.seed)
    theirs = filters.Mahony(
        gyr=calibrated(block["imu"].gyro, unit.gyroscope),
        acc=calibrated(block["imu"].accel, unit.accelerometer),
        frequency=100.0,
        k_P=2.0 / 5.0,
        k_I=1.0 / 25.0,
        q0=block["orientation"].ideal_q_wi[0],
    ).Q
    settled = slice(4000, None)
    ups = [
        as_rotation(q[settled]).inv().apply([0.0, 0.0, 1.0])
        for q in (
            block["orientation"].q_wi,
            theirs,
            block["orientation"].ideal_q_wi,
        )
    ]
    ours, upright, true = ups
    apart = np.sqrt(np.mean(np.sum((ours - upright) ** 2, axis=1)))
    off = np.sqrt(np.mean(np.sum((ours - true) ** 2, axis=1)))
    assert apart < 0.1 * off


def test_a_filter_of_others_finds_the_true_attitude_from_our_readings() -> None:
    filters = pytest.importorskip("ahrs.filters")
    values = {"imu.preset": "mpu9250", "imu.magnetometer_noise_density": 3e-8, "seed": 3}
    run = simulation(values, sensors=("orientation", "magnetic_field"))
    block = run.next(6000)
    assert block["orientation"] is not None
    assert block["magnetic_field"] is not None
    unit = realise_imu(run.parameters.imu, run.parameters.seed)
    filtered = filters.Madgwick(
        gyr=calibrated(block["imu"].gyro, unit.gyroscope),
        acc=calibrated(block["imu"].accel, unit.accelerometer),
        mag=(block["magnetic_field"].field - block["magnetic_field"].bias) * 1e9,
        frequency=100.0,
        gain=0.005,
    ).Q
    # Its x axis points to magnetic north, ours to the east.
    to_east = Rotation.from_euler("z", math.pi / 2.0)
    truth = as_rotation(block["orientation"].ideal_q_wi)
    off = (to_east * as_rotation(filtered) * truth.inv()).magnitude()
    assert np.degrees(np.sqrt(np.mean(off**2))) < 2.0


def test_stamps_are_the_readings() -> None:
    block = simulation(FILTER, {"imu.orientation_rate": 50.0, "imu.jitter": 1e-4}).next(100)
    assert block["orientation"] is not None
    assert np.array_equal(block["orientation"].t_ns, block["imu"].t_ns[::2])
    assert np.array_equal(block["orientation"].gyro, block["imu"].gyro[::2])


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"imu.orientation_rate": 33.0}, "imu.orientation_rate = 33: must divide the rate, 100 Hz"),
        ({"imu.orientation_source": "guess"}, "imu.orientation_source = 'guess': must be one of"),
        ({"imu.orientation_noise": -0.1}, "imu.orientation_noise = -0.1: must be"),
        ({"imu.orientation_time_constant": 0.0}, "imu.orientation_time_constant = 0.0: must be"),
        (
            {"imu.orientation_source": "filter", "imu.orientation_noise": 0.1},
            "must be 0 if imu.orientation_source is filter",
        ),
    ],
)
def test_bad_values_are_one_line_each(values: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load_simulation(BASE, values)
    (problem,) = caught.value.problems
    assert line in problem
