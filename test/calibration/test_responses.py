# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Six positions, rate table and temperature: recovered from simulated runs and plain arrays."""

import numpy as np
import pytest

from imu_sim_ros.calibration.deterministic.correction import (
    Calibrated,
    six_position_parameters,
    temperature_parameters,
    true_parameters,
    turntable_parameters,
    write_correction,
    write_simulator,
)
from imu_sim_ros.calibration.deterministic.positions import calibrate_six_position
from imu_sim_ros.calibration.deterministic.response import (
    Observations,
    fit_axis,
    is_distinguishable,
)
from imu_sim_ros.calibration.deterministic.steady import Steady, find_steady, whiten
from imu_sim_ros.calibration.deterministic.temperature import calibrate_temperature, temperatures_at
from imu_sim_ros.calibration.deterministic.turntable import (
    calibrate_turntable,
    match_table_rates,
    specific_force,
    true_rates,
)
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.parameters import trajectory_layer

G = 9.81
FLAWS: dict[str, object] = {
    "imu.preset": "perfect",
    "imu.gyroscope_noise_density": 1.7e-4,
    "imu.gyroscope_random_walk": 1.9e-5,
    "imu.accelerometer_noise_density": 2e-3,
    "imu.accelerometer_random_walk": 3e-4,
    "imu.gyroscope_bias": [0.01, -0.02, 0.03],
    "imu.accelerometer_bias": [0.1, -0.2, 0.05],
    "imu.gyroscope_scale_error_percent": [1.0, -1.0, 0.5],
    "imu.gyroscope_misalignment_percent": [0.2, -0.3, 0.6, 0.1, -0.2, 0.4],
    "imu.accelerometer_scale_misalignment": [
        *(1.02, 0.004, -0.006),
        *(0.003, 0.985, 0.002),
        *(-0.005, 0.001, 1.01),
    ],
    "imu.gyroscope_g_sensitivity": [1e-4, 2e-5, -3e-5, 1e-5, -2e-4, 4e-5, 0.0, 5e-5, 1.5e-4],
}
THERMAL: dict[str, object] = {
    "imu.gyroscope_temperature_bias": [2e-4, -1e-4, 3e-4, 1e-6, 0.0, -2e-6],
    "imu.accelerometer_temperature_bias": [1e-3, -2e-3, 5e-4],
    "imu.gyroscope_temperature_scale": [1e-4, 2e-4, -1e-4],
    "imu.accelerometer_temperature_scale": [-1e-4, 1e-4, 2e-4],
}


class Run:
    """A simulated calibration run as arrays."""

    def __init__(self, trajectory: str, *layers: dict[str, object], **values: object) -> None:
        parameters = load_simulation(trajectory_layer(trajectory), *layers, values)
        self.imu: ImuParameters = parameters.imu
        blocks = [windows["imu"] for windows in Body(parameters).windows()]
        self.t_ns = np.concatenate([block.t_ns for block in blocks])
        self.gyro = np.concatenate([block.gyro for block in blocks])
        self.accel = np.concatenate([block.accel for block in blocks])
        self.temperature = np.concatenate([block.temperature for block in blocks])
        self.rate = np.concatenate([block.motion.angular_velocity for block in blocks])

    def steady(self) -> Steady:
        return find_steady(self.t_ns, self.gyro, self.accel)


def deviations(values: dict[str, Calibrated], imu: ImuParameters) -> np.ndarray:
    """Return the errors of all uncertain parameters, in standard errors."""
    truth = true_parameters(imu, values)
    result = []
    for name, calibrated in values.items():
        sure = calibrated.sigma > 0.0
        result += list((calibrated.value - truth[name])[sure] / calibrated.sigma[sure])
    return np.array(result)


def within(values: dict[str, Calibrated], imu: ImuParameters) -> None:
    """Assert that all errors lie within 4 standard errors (one of 60 lies beyond: 0.4 %).

    Their mean square is between chi-square bounds for 9 independent parameters, the fewest there
    are: the standard errors are neither far too large nor far too small.
    """
    z = deviations(values, imu)
    assert np.abs(z).max() < 4.0
    assert 0.1 < np.mean(z**2) < 3.1


@pytest.mark.parametrize("seed", [1, 2])
def test_six_positions_recover_the_parameters_within_their_errors(seed):
    run = Run("six_position", FLAWS, seed=seed)
    calibration = calibrate_six_position(run.steady(), G)
    assert calibration.positions.stretches == 6
    assert calibration.left_out == 0
    values = six_position_parameters(calibration)
    within(values, run.imu)
    # The noise of a face's 150 s: what one can expect of the standard errors.
    assert np.all(calibration.scale_misalignment_sigma < 3e-4)


def test_six_positions_without_noise_are_exact():
    run = Run("six_position", FLAWS, {f"imu.{t}_{k}": 0.0 for t in ("gyroscope", "accelerometer")
                                      for k in ("noise_density", "random_walk")})  # fmt: skip
    calibration = calibrate_six_position(run.steady(), G)
    truth = true_parameters(run.imu, six_position_parameters(calibration))
    assert calibration.scale_misalignment.ravel() == pytest.approx(
        truth["accelerometer_scale_misalignment"], abs=1e-6
    )
    assert calibration.bias == pytest.approx(truth["accelerometer_bias"], abs=1e-5)


def test_simple_variant_is_equation_6():
    run = Run("six_position", FLAWS, seed=3)
    steady = run.steady()
    calibration = calibrate_six_position(steady, G, simple=True)
    up = np.array([steady.accel[steady.accel[:, k] > 8.0, k].mean() for k in range(3)])
    down = np.array([steady.accel[steady.accel[:, k] < -8.0, k].mean() for k in range(3)])
    assert np.diag(calibration.scale_misalignment) == pytest.approx(
        (up - down) / (2.0 * G), abs=2e-4
    )
    assert calibration.bias == pytest.approx((up + down) / 2.0, abs=5e-3)
    assert np.count_nonzero(calibration.scale_misalignment) == 3


def test_hand_movement_unequal_lengths_and_more_positions():
    """Rests of 4 to 20 s in any order, with shaking between, two faces twice."""
    rng = np.random.default_rng(4)
    s = np.array([[1.02, 0.004, -0.006], [0.003, 0.985, 0.002], [-0.005, 0.001, 1.01]])
    parts, rates = [], []
    for face, seconds in ((0, 5), (3, 20), (4, 4), (5, 9), (1, 6), (2, 12), (4, 7), (1, 8)):
        force = np.zeros(3)
        force[face // 2] = G * (1 - 2 * (face % 2))
        n = int(100 * seconds)
        parts.append(np.tile(s @ force + [0.1, -0.2, 0.05], (n, 1)))
        rates.append(np.zeros((n, 3)))
        shake = int(rng.integers(100, 300))
        t = np.linspace(0.0, 1.0, shake)[:, None]
        parts.append(rng.normal(0.0, 3.0, (shake, 3)) + G * np.sin(7 * t + [0, 1, 2]))
        rates.append(3.0 * np.sin(9.0 * t + [0, 1, 2]))
    accel = np.concatenate(parts) + 0.02 * rng.standard_normal((sum(map(len, parts)), 3))
    gyro = np.concatenate(rates) + 0.002 * rng.standard_normal(accel.shape)
    t_ns = np.arange(len(accel)) * 10_000_000
    calibration = calibrate_six_position(find_steady(t_ns, gyro, accel), G)
    assert calibration.positions.stretches == 8
    z = (calibration.scale_misalignment - s) / calibration.scale_misalignment_sigma
    assert np.abs(z).max() < 4.0
    assert np.abs((calibration.bias - [0.1, -0.2, 0.05]) / calibration.bias_sigma).max() < 4.0


def test_five_positions_are_not_enough():
    run = Run("six_position", FLAWS)
    steady = run.steady()
    with pytest.raises(InputError, match=r"5 of 6 positions found; never up: -z"):
        calibrate_six_position(steady.rows(steady.accel[:, 2] > -8.0), G)


@pytest.mark.parametrize("rate", [20.0, 25.0, 50.0])
@pytest.mark.parametrize("preset", ["mpu6000", "lsm6dso", "adis16448"])
def test_slow_or_coarse_readings_rest_as_long_as_the_fixture(preset, rate):
    """Few readings in half a second, or most of them the same code: six rests, 186 s at 200 Hz.

    A walk of the bias may divide one. The windows at both ends of each are left out.
    """
    steady = Run("six_position", {"imu.preset": preset}, rate=rate, seed=2).steady()
    assert 6 <= steady.stretches <= 8
    assert steady.duration.sum() > 186.0 - 2.0 * steady.stretches * 25.0 / rate


def test_a_motion_that_is_never_steady_is_refused():
    run = Run("lecture", FLAWS, duration=20.0)
    with pytest.raises(InputError, match=r"no 2 s at rest|of 6 positions"):
        calibrate_six_position(find_steady(run.t_ns, run.gyro, run.accel), G)


@pytest.mark.parametrize("source", ["rates", "truth"])
def test_a_turntable_recovers_the_parameters_within_their_errors(source):
    run = Run("turntable", FLAWS, seed=5)
    steady = run.steady()
    if source == "rates":
        steady, rate = match_table_rates(steady, np.array([0.5, 1.0, 2.0]))[:2]
    else:
        steady, rate = true_rates(steady, run.t_ns, run.rate)
    calibration = calibrate_turntable(steady, rate, G)
    assert steady.stretches == 78
    within(turntable_parameters(calibration), run.imu)
    assert np.all(calibration.scale_misalignment_sigma < 1e-4)


def test_without_each_axis_upside_down_there_is_no_g_sensitivity():
    run = Run("turntable", FLAWS, {"trajectory.upside_down": False}, seed=6)
    steady, rate = match_table_rates(run.steady(), np.array([0.5, 1.0, 2.0]))[:2]
    calibration = calibrate_turntable(steady, rate, G)
    assert calibration.g_sensitivity is None
    assert "gyroscope_g_sensitivity" not in turntable_parameters(calibration)


def test_a_table_that_turns_one_way_only():
    run = Run("turntable", FLAWS, seed=7)
    steady, rate = match_table_rates(run.steady(), np.array([0.5, 1.0, 2.0]))[:2]
    forward = rate[:, 1] >= 0.0
    with pytest.raises(InputError, match=r"no steady rotation about -y"):
        calibrate_turntable(steady.rows(forward), rate[forward], G)


@pytest.mark.parametrize("trajectory", ["temperature_soak", "temperature_ramp"])
def test_a_temperature_run_recovers_biases_and_scales_within_their_errors(trajectory):
    run = Run(trajectory, FLAWS, THERMAL, seed=2, rate=100.0)
    steady, rate = match_table_rates(run.steady(), np.array([1.0]))[:2]
    temperature = temperatures_at(steady, run.t_ns, run.temperature)
    calibration = calibrate_temperature(steady, temperature, rate, specific_force(steady, G), 25.0)
    values = temperature_parameters(calibration)
    z = deviations(values, run.imu)
    # Of n parameters, one lies beyond 4 standard errors in 6.3e-5 n of all runs.
    assert np.abs(z).max() < 4.0
    assert [len(axis.scale) for axis in calibration.triads["gyroscope"].axes] == [1, 1, 1]
    assert [len(axis.bias) >= 3 for axis in calibration.triads["gyroscope"].axes] == [
        True,
        False,
        True,
    ]


def test_temperature_at_rest_in_one_position_shows_the_bias_only():
    run = Run(
        "static",
        FLAWS,
        THERMAL,
        {"temperature.value": -10.0, "temperature.profile": [600.0, 50.0]},
        duration=600.0,
        rate=100.0,
    )
    steady = run.steady()
    temperature = temperatures_at(steady, run.t_ns, run.temperature)
    still = np.zeros((len(temperature), 3))
    calibration = calibrate_temperature(steady, temperature, still, specific_force(steady, G), 25.0)
    slope = np.array([axis.bias[1] for axis in calibration.triads["gyroscope"].axes])
    sigma = np.array([axis.bias_sigma[1] for axis in calibration.triads["gyroscope"].axes])
    truth = np.array([2e-4, -1e-4, 3e-4])
    assert np.abs((slope - truth) / np.hypot(sigma, 2e-5)).max() < 4.0
    assert "gyroscope_scale_misalignment" not in temperature_parameters(calibration)


def test_constant_temperature_and_missing_messages_are_refused():
    run = Run("six_position", FLAWS)
    steady = run.steady()
    temperature = temperatures_at(steady, run.t_ns, run.temperature)
    nothing = np.zeros((len(temperature), 3))
    with pytest.raises(InputError, match="must span at least 5 K"):
        calibrate_temperature(steady, temperature, nothing, nothing, 25.0)
    with pytest.raises(InputError, match="no temperature messages"):
        temperatures_at(steady, run.t_ns[:0], run.temperature[:0])
    with pytest.raises(InputError, match="do not span"):
        temperatures_at(steady, run.t_ns[:2000], run.temperature[:2000])


def test_standard_errors_are_those_of_many_runs():
    """White noise and a walk, 300 times: chi-square of 300 allows 1 +- 0.25 (three deviations)."""
    rng = np.random.default_rng(8)
    n = 40
    time = np.linspace(1.0, 200.0, n)
    inputs = rng.choice([-1.0, 0.0, 1.0], (n, 1))
    z = []
    for _ in range(300):
        walk = np.cumsum(rng.standard_normal(n) * np.sqrt(np.diff(time, prepend=0.0))) * 0.5
        readings = 2.0 * inputs[:, 0] + 1.0 + rng.standard_normal(n) + walk
        data = Observations(inputs, readings, np.ones(n), time, np.zeros(n))
        response = fit_axis(data)
        z.append([(response.gain[0] - 2.0) / response.gain_sigma[0],
                  (response.bias[0] - 1.0) / response.bias_sigma[0]])  # fmt: skip
    assert np.mean(np.square(z), axis=0) == pytest.approx([1.0, 1.0], abs=0.25)


def test_directions_determine_a_response_only_if_they_span_it_with_a_constant():
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    assert is_distinguishable(faces)
    assert not is_distinguishable(faces[:3])  # three faces up: the constant is their sum
    assert not is_distinguishable(np.zeros((10, 3)))
    assert not is_distinguishable(faces[:2])


def test_files_are_read_by_simulator_and_integrator(tmp_path):
    from imu_sim_ros.navigation.parameters import IntegratorParameters
    from imu_sim_ros.parameters.sections import build

    run = Run("six_position", FLAWS, seed=9)
    values = six_position_parameters(calibrate_six_position(run.steady(), G))
    write_simulator(values, tmp_path / "imu.yaml", "comment")
    write_correction(values, tmp_path / "correction.yaml", "comment")
    imu = load_simulation({"imu.preset": str(tmp_path / "imu.yaml")}).imu
    assert imu.accelerometer.bias == pytest.approx(values["accelerometer_bias"].value, rel=1e-8)
    correction = build(IntegratorParameters, files.load(tmp_path / "correction.yaml", "integrator"))
    assert correction.accelerometer_scale_misalignment == pytest.approx(
        values["accelerometer_scale_misalignment"].value, rel=1e-8
    )


def test_the_correction_makes_dead_reckoning_drift_less():
    """The closed loop: flaws in, calibrated on two runs, taken out of a third."""
    from imu_sim_ros.navigation.dead_reckoning import dead_reckon
    from imu_sim_ros.navigation.state import Correction, NavigationState

    six = Run("six_position", FLAWS, seed=10)
    table = Run("turntable", FLAWS, seed=11)
    steady, rate = match_table_rates(table.steady(), np.array([0.5, 1.0, 2.0]))[:2]
    values = six_position_parameters(calibrate_six_position(six.steady(), G))
    values.update(turntable_parameters(calibrate_turntable(steady, rate, G)))
    correction = Correction(
        **{name: tuple(calibrated.value) for name, calibrated in values.items()}
    )

    parameters = load_simulation(trajectory_layer("lecture"), FLAWS, {"seed": 12})
    simulation = Body(parameters)
    block = simulation.next(4000)["imu"]
    motion = block.motion
    start = NavigationState(motion.position[0], motion.velocity[0], motion.q_wb[0])
    errors = [
        float(np.linalg.norm(
            dead_reckon(block.t_ns, block.gyro, block.accel, start, **extra).position[-1]
            - motion.position[-1]
        ))
        for extra in ({}, {"correction": correction})
    ]  # fmt: skip
    assert errors[1] < errors[0] / 30.0


def test_a_filter_whitens_as_the_covariances_factor_does():
    """``L^-1 X`` with ``L L^T = q min(t, t) + sigma^2`` by Cholesky's factor."""
    rng = np.random.default_rng(5)
    time = np.concatenate([[0.0, 0.0], np.sort(rng.uniform(1.0, 900.0, 40))])
    sigma, columns = rng.uniform(0.5, 2.0, 42), rng.standard_normal((42, 3))
    walks = np.array([0.0, 1e-6, 1e-2, 10.0])
    whitening = whiten(columns, time, sigma, walks)
    for k, walk in enumerate(walks):
        factor = np.linalg.cholesky(walk * np.minimum.outer(time, time) + np.diag(sigma**2))
        assert whitening.columns[k] == pytest.approx(np.linalg.solve(factor, columns), abs=1e-12)
        determinant = 2.0 * np.sum(np.log(np.diag(factor)))
        assert whitening.log_determinant[k] == pytest.approx(determinant, abs=1e-11)
