# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The magnetometer against formulas written down anew with SciPy's rotations, and its own grid."""

import dataclasses
import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from simulation_runs import arrays, read_all, same_bytes

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.magnetometer.model import MagneticField, realise_magnetometer
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.playback import load_simulator

BASE = {"imu.preset": "perfect", "trajectory.type": "lecture", "rate": 200.0}
MOUNTING = Rotation.from_euler("zyx", [0.4, -0.2, 1.1])
IRON = {
    "imu.magnetometer_hard_iron": [1e-5, -2e-5, 5e-6],
    "imu.magnetometer_soft_iron": [1.05, 0.02, -0.01, 0.03, 0.94, 0.04, -0.02, 0.01, 1.02],
    "imu.magnetometer_misalignment": [0.02, -0.03, 0.05],
    "imu.magnetometer_current_coupling": [2e-7, -1e-7, 3e-7],
    "imu.magnetometer_current_profile": [1.0, 0.0, 2.0, 10.0, 4.0, 5.0],
}
DISTURBED = {
    "magnetic_field.value": [1.3e-6, 1.9e-5, -4.5e-5],
    "magnetic_field.dipoles": [15.0, 0.0, 5.0, 10.0, -30.0, 20.0, -5.0, 9.0, 2.0, 0.0, 50.0, 0.0],
    "magnetic_field.alternating": [1e-7, 0.0, 2e-7],
    "magnetic_field.alternating_frequency": 16.7,
    "imu.lever_arm": [0.3, -0.2, 0.1],
    "imu.mounting": MOUNTING.as_matrix().ravel().tolist(),
}
RANDOM = {
    "imu.magnetometer_noise_density": 1e-8,
    "imu.magnetometer_random_walk": 1e-9,
    "imu.magnetometer_bias_instability": 1e-8,
    "imu.magnetometer_turn_on_bias_sigma": 1e-6,
    "imu.magnetometer_turn_on_scale_sigma": 0.01,
    "imu.magnetometer_hard_iron_sigma": 1e-5,
    "imu.magnetometer_soft_iron_sigma": 0.02,
    "imu.magnetometer_misalignment_sigma": 0.01,
    "imu.jitter": 1e-4,
    "imu.latency_jitter": 1e-3,
    "imu.dropout_probability": 0.1,
}
OWN_GRID = {"imu.magnetometer_rate": 70.0, "imu.magnetometer_time_offset": 0.003}


def simulation(*layers: dict[str, Any], sensors: tuple[str, ...] = ("magnetic_field",)) -> Body:
    values = dict(BASE)
    for layer in layers:
        values.update(layer)
    return Body(load_simulation(values), sensors=sensors)


magnetic = partial(read_all, quantity="magnetic_field")


def true_field(run: Body, t: np.ndarray) -> np.ndarray:
    """Return the field in the IMU's axes (n, 3): Jackson eq. 5.56 for each dipole."""
    values, motion = DISTURBED, run.trajectory.sample(t)
    attitude = Rotation.from_quat(motion.q_wb[:, [1, 2, 3, 0]])
    place = motion.position + attitude.apply(values["imu.lever_arm"])
    field = np.tile(values["magnetic_field.value"], (len(t), 1))
    for row in np.reshape(values["magnetic_field.dipoles"], (-1, 6)):
        r = place - row[:3]
        n = r / np.linalg.norm(r, axis=1)[:, None]
        m = row[3:]
        field += 1e-7 * (3.0 * n * (n @ m)[:, None] - m) / np.linalg.norm(r, axis=1)[:, None] ** 3
    wave = np.sin(2.0 * math.pi * values["magnetic_field.alternating_frequency"] * t)
    field += wave[:, None] * values["magnetic_field.alternating"]
    return MOUNTING.inv().apply(attitude.inv().apply(field))


def test_the_ideal_field_and_the_reading_are_the_formulas() -> None:
    run = simulation(DISTURBED, IRON, OWN_GRID)
    samples = magnetic(run, 333, 1200)
    k = np.arange(420)
    assert np.array_equal(samples.true_t_ns, 10**9 + 3_000_000 + np.rint(k * 1e9 / 70).astype(int))
    t = (samples.true_t_ns - 10**9) * 1e-9
    ideal = true_field(run, t)
    assert np.allclose(samples.ideal_field, ideal, rtol=0.0, atol=1e-9 * 5e-5)
    current = np.interp(t, [1.0, 2.0, 4.0], [0.0, 10.0, 5.0])
    at_sensor = ideal @ np.reshape(IRON["imu.magnetometer_soft_iron"], (3, 3)).T
    at_sensor += IRON["imu.magnetometer_hard_iron"]
    at_sensor += current[:, None] * IRON["imu.magnetometer_current_coupling"]
    axes = Rotation.from_rotvec(IRON["imu.magnetometer_misalignment"])
    assert np.allclose(samples.field, axes.inv().apply(at_sensor), rtol=0.0, atol=1e-9 * 5e-5)
    linear = axes.inv().apply(ideal @ np.reshape(IRON["imu.magnetometer_soft_iron"], (3, 3)).T)
    assert np.allclose(samples.field, linear + samples.bias, rtol=0.0, atol=1e-9 * 5e-5)


def test_without_errors_the_reading_is_the_field() -> None:
    samples = magnetic(simulation(), 1000, 1000)
    assert np.array_equal(samples.field, samples.ideal_field)
    assert not samples.bias.any()
    assert np.array_equal(samples.t_ns, samples.true_t_ns)
    assert np.array_equal(samples.delivered, np.arange(500))
    assert np.allclose(np.linalg.norm(samples.field, axis=1), math.hypot(2e-5, 4.5e-5), rtol=1e-12)


def test_a_dipole_is_twice_as_strong_on_its_axis_and_constant_inside() -> None:
    values = {"magnetic_field.value": 0.0, "magnetic_field.dipoles": [1.0, 0, 0, 0, 0, 4.0]}
    field = MagneticField(load_simulation(BASE, values))
    r = 0.05
    places = np.array([[1, 0, 2.0], [3, 0, 0], [1, 0, r * (1 + 1e-12)], [1, 0, 0], [1, 0.01, 0.02]])
    field_there = field.field(np.zeros(5), places)
    dipole_field = 1e-7 * 2.0 * 4.0 / r**3
    expected = [1e-7 * 2.0 * 4.0 / 8.0, -1e-7 * 4.0 / 8.0, dipole_field, dipole_field, dipole_field]
    assert np.allclose(field_there[:, 2], expected, rtol=1e-9)
    assert not field_there[:, :2].any()


@pytest.mark.parametrize(
    ("date", "height", "latitude", "longitude", "north_east_down"),
    [
        # "The US/UK World Magnetic Model for 2020-2025: Technical Report", NOAA, 2020, test
        # values [nT].
        (2020.0, 0.0, 80.0, 0.0, (6570.4, -146.3, 54606.0)),
        (2020.0, 0.0, 0.0, 120.0, (39624.3, 109.9, -10932.5)),
        (2020.0, 0.0, -80.0, 240.0, (5940.6, 15772.1, -52480.8)),
    ],
)
def test_the_world_magnetic_model_is_that_of_its_report(
    date: float, height: float, latitude: float, longitude: float, north_east_down: Any
) -> None:
    values = {
        "magnetic_field.model": "wmm",
        "magnetic_field.date": date,
        "latitude_deg": latitude,
        "longitude_deg": longitude if longitude <= 180.0 else longitude - 360.0,
        "height": height,
    }
    pytest.importorskip("pygeomag")
    field = MagneticField(load_simulation(BASE, values))
    north, east, down = north_east_down
    assert np.allclose(field.earth_w * 1e9, [east, north, -down], rtol=0.0, atol=0.051)


@pytest.mark.parametrize("size", [1, 7, 64, 1000])
def test_samples_do_not_depend_on_the_block_size(size: int) -> None:
    count = 300 if size == 1 else 2000
    layers = (DISTURBED, IRON, RANDOM, OWN_GRID)
    whole, pieces = (magnetic(simulation(*layers), s, count) for s in (count, size))
    assert same_bytes(whole, pieces)
    assert len(whole.delivered) < len(whole.t_ns)


def test_no_sample_of_the_imu_depends_on_the_magnetometer() -> None:
    noisy = {"imu.preset": "mpu9250", **RANDOM}
    with_magnetometer, off = (
        simulation(noisy, sensors=s).next(500) for s in (("magnetic_field",), ())
    )
    assert "magnetic_field" not in off
    imu, imu_alone = with_magnetometer["imu"], off["imu"]
    for mine, theirs in zip(arrays(imu), arrays(imu_alone), strict=True):
        assert np.array_equal(mine, theirs)


def test_a_faster_magnetometer_ends_with_the_run() -> None:
    values = {"imu.magnetometer_rate": 999.0, "duration": 1.003, "trajectory.type": "static"}
    run = simulation(values)
    samples = magnetic(run, 64, 640)
    assert len(samples.t_ns) == math.ceil(1.003 * 999.0)
    assert run.taken(run.rate) == 201


def test_noise_has_the_stated_density_and_the_units_differ_as_stated() -> None:
    values = {"imu.magnetometer_noise_density": 2e-8, "trajectory.type": "static"}
    samples = magnetic(simulation(values), 8192, 40000)
    noise = samples.field - samples.ideal_field
    count = noise.size
    ratio = np.sum(noise**2) / (4e-16 * 100.0)
    assert chi2.ppf(1e-4, count) < ratio < chi2.ppf(1.0 - 1e-4, count)
    drawn = []
    for seed in range(60):
        unit = {"seed": seed, "imu.magnetometer_hard_iron_sigma": 1e-5, "trajectory.type": "static"}
        drawn.append(magnetic(simulation(unit), 2, 2).bias[0])
    ratio = np.sum(np.square(drawn)) / 1e-10
    assert chi2.ppf(1e-4, 180) < ratio < chi2.ppf(1.0 - 1e-4, 180)


def test_the_realised_unit_reads_the_same() -> None:
    drawn = {name: value for name, value in RANDOM.items() if name.endswith("_sigma")}
    run = simulation(IRON, drawn)
    unit = realise_magnetometer(run.parameters.imu.magnetometer, run.parameters.seed)
    assert not any(any(getattr(unit, f"{name}_sigma")) for name in ("hard_iron", "turn_on_scale"))
    samples = magnetic(run, 50, 50)  # the current begins later
    m, b = unit.response_and_bias()
    assert np.allclose(samples.field, samples.ideal_field @ m.T + b, rtol=0.0, atol=1e-9 * 5e-5)
    again = dataclasses.replace(
        run.parameters.imu, sensors={**run.parameters.imu.sensors, "magnetometer": unit}
    )
    repeated = Body(dataclasses.replace(run.parameters, imu=again), sensors=("magnetic_field",))
    assert np.allclose(
        magnetic(repeated, 1000, 1000).field,
        magnetic(simulation(IRON, drawn), 1000, 1000).field,
        rtol=0.0,
        atol=1e-9 * 5e-5,
    )


def test_temperature_range_and_steps_act_as_in_other_sensors() -> None:
    values = {
        "trajectory.type": "static",
        "temperature.value": 35.0,
        "imu.magnetometer_temperature_bias": [1e-8, 0.0, 0.0],
        "imu.magnetometer_temperature_scale": [0.0, 1e-3, 0.0],
        "imu.magnetometer_range": [1e-4, 1e-4, 3e-5],
        "imu.magnetometer_resolution": 1.5e-7,
    }
    samples = magnetic(simulation(values), 2, 2)
    expected = np.rint(np.array([1e-7, 2e-5 * 1.01, -3e-5]) / 1.5e-7) * 1.5e-7
    assert np.allclose(samples.field[0], expected, rtol=1e-12)


def test_faults_of_the_magnetometer_are_its_own() -> None:
    run, without_magnetometer = simulation(), simulation(sensors=())
    run.next(3)
    without_magnetometer.next(3)
    begin = 0.985  # a second after the start
    jump = (1e-6, 2e-6, 3e-6)
    run.inject(Fault("bias_jump", 0.5, jump, "magnetometer"), begin)
    run.inject(Fault("dropout", 0.25, 1.0, "magnetometer"), begin + 1.0)
    run.inject(Fault("latency", 0.25, 0.1, "magnetometer"), begin + 2.0)
    run.inject(Fault("stuck", 0.25, 0.0, "magnetometer"), begin + 3.0)
    block, imu_alone = run.next(1000), without_magnetometer.next(1000)
    assert np.array_equal(block["imu"].gyro, imu_alone["imu"].gyro)
    assert np.array_equal(block["imu"].delivered, imu_alone["imu"].delivered)
    samples = block["magnetic_field"]
    assert samples is not None
    t = (samples.true_t_ns - run.t0_ns) * 1e-9
    off = np.where(((t >= 1.0 - 1e-9) & (t < 1.5 - 1e-9))[:, None], jump, 0.0)
    stuck = (t >= 4.0 - 1e-9) & (t < 4.25 - 1e-9)
    assert np.allclose((samples.field - samples.ideal_field)[~stuck], off[~stuck], atol=1e-18)
    assert np.all(samples.field[stuck] == samples.field[np.flatnonzero(stuck)[0] - 1])
    lost = np.setdiff1d(np.arange(len(t)), samples.delivered)
    assert np.array_equal(lost, np.flatnonzero((t >= 2.0 - 1e-9) & (t < 2.25 - 1e-9)))
    late = samples.release_t_ns - samples.true_t_ns > 0
    # What was to follow within the latency waits: no message overtakes another.
    assert np.array_equal(late, (t >= 3.0 - 1e-9) & (t < 3.35 - 1.5e-2))


def test_a_fault_of_a_sensor_that_is_not_simulated_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="no magnetometer"):
        simulation(sensors=()).inject(Fault("dropout", 1.0, 1.0, "magnetometer"))


def test_live_parameters_change_between_blocks() -> None:
    run = simulation({"trajectory.type": "static"})
    run.next(100)
    run.update(
        load_simulation(BASE, {"trajectory.type": "static"}, {"imu.magnetometer_bias": 1e-6})
    )
    samples = run.next(100)["magnetic_field"]
    assert samples is not None
    assert np.allclose(samples.field - samples.ideal_field, 1e-6, rtol=1e-9)


def test_several_boards_have_a_magnetometer_each() -> None:
    shared = {**BASE, "duration": 1.0, "imu.magnetometer_noise_density": 1e-8}
    right_imu = {"right.seed": 1, "right.imu.magnetometer_rate": 50.0}
    parameters = load_simulator({**shared, "imus": ["left", "right"], **right_imu})
    names = ["left/magnetic_field", "right/magnetic_field"]
    windows = list(Body(parameters, sensors=names).windows(33))
    assert [sum(len(window[name].t_ns) for window in windows) for name in names] == [100, 50]


@pytest.mark.parametrize(
    ("values", "line"),
    [
        (
            {"imu.magnetometer_rate": 0.0},
            "imu.magnetometer_rate = 0.0: must be a finite number at least 1e-06",
        ),
        ({"imu.magnetometer_time_offset": 0.01}, "must be below 1 / imu.magnetometer_rate, 0.01 s"),
        (
            {"imu.magnetometer_noise_density": -1.0},
            "imu.magnetometer_noise_density = -1.0: must be",
        ),
        ({"imu.magnetometer_soft_iron": [1.0]}, "must be a list of nine finite numbers"),
        ({"imu.magnetometer_soft_iron": [1.0] * 9}, "soft_iron = [1.0, 1.0, 1.0, 1.0, 1.0"),
        ({"imu.magnetometer_misalignment": 2.0}, "must be a rotation by at most pi rad"),
        ({"imu.magnetometer_current_profile": [0.0, 1.0, 0.0, 2.0]}, "times must increase"),
        ({"imu.magnetometer_current_profile": [0.0]}, "2 for each entry"),
        ({"magnetic_field.dipoles": [1.0]}, "6 for each entry"),
        ({"magnetic_field.dipole_radius": 0.0}, "magnetic_field.dipole_radius = 0.0: must be"),
        ({"magnetic_field.date": math.nan}, "magnetic_field.date = nan: must be a finite number"),
        ({"magnetic_field.model": "wmm", "magnetic_field.value": 1e-5}, "must be omitted"),
        ({"imu.magnetometer_bandwidth": 1.0}, "imu.magnetometer_bandwidth: unknown parameter"),
    ],
)
def test_bad_values_are_one_line_each(values: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load_simulation(BASE, values)
    (problem,) = caught.value.problems
    assert line in problem
