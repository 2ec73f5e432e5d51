# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The digital twin: recovered from our own recordings, flown again, and held against a real one."""

import importlib
from pathlib import Path

import numpy as np
import pytest
from recordings import EUROC, EUROC_IMU, missing

import imu_sim_ros as ims
from imu_sim_ros.calibration.twin.pose_noise import PoseNoise
from imu_sim_ros.core.gate import stamp_text
from imu_sim_ros.core.records import States
from imu_sim_ros.core.rotation import conjugate, exp, log, multiply, normalise, to_matrix
from imu_sim_ros.jobs.twin import check_settled, judge_fit

TURN = np.array([0.3, -0.2, 0.5])
S_A = np.array([[1.01, 0.004, -0.006], [0.0, 0.985, 0.002], [0.0, 0.0, 1.01]])
S_G = np.array([[0.99, 0.002, -0.003], [0.006, 1.01, 0.001], [-0.002, 0.004, 1.005]])
SENSOR = {
    "preset": "perfect",
    "mounting": to_matrix(exp(TURN)).T.ravel().tolist(),
    "lever_arm": [0.1, -0.05, 0.02],
    "stamp_offset": 0.004,
    "clock_skew_ppm": 40.0,
    "gyroscope_bias": [0.01, -0.02, 0.03],
    "gyroscope_scale_misalignment": S_G.ravel().tolist(),
    "gyroscope_noise_density": 1.7e-4,
    "accelerometer_bias": [0.1, -0.2, 0.05],
    "accelerometer_scale_misalignment": S_A.ravel().tolist(),
    "accelerometer_noise_density": 2e-3,
}
VIBRATION = {
    "band_low": [25.0],
    "band_high": [35.0],
    "band_density": [0.002, 0.001, 0.002, 0.04, 0.02, 0.05],
    "line_frequency": [41.3],
    "line_amplitude": [0.0, 0.01, 0.0, 0.3, 0.0, 0.0],
}


@pytest.fixture(scope="module")
def flight():
    sensor = {**SENSOR, "vibration": VIBRATION}
    return ims.simulate(imu=sensor, trajectory="excitation", duration=30, rate=100, seed=5)


@pytest.fixture(scope="module")
def fitted_twin(flight):
    return ims.twin(flight.readings, flight.truth)


@pytest.fixture(scope="module")
def half(flight):
    """Return readings and true poses of 15 s: what is named there is far beyond all noise."""
    readings, poses = flight.readings, flight.truth
    some = slice(1500)
    return (
        ims.Readings(readings.t_ns[some], readings.gyro[some], readings.accel[some], "half"),
        States(poses.t_ns[some], poses.position[some], poses.q_wb[some]),
    )


def test_constant_errors_are_within_their_standard_errors(fitted_twin):
    z = [
        (fitted_twin.errors[name].value - true) / np.maximum(fitted_twin.errors[name].sigma, 1e-12)
        for name, true in (
            ("stamp_offset", [0.004]),
            ("clock_skew_ppm", [40.0]),
            ("mounting", TURN),
            ("lever_arm", SENSOR["lever_arm"]),
            ("gyroscope_bias", SENSOR["gyroscope_bias"]),
            ("gyroscope_scale_misalignment", S_G.ravel()),
            ("accelerometer_bias", SENSOR["accelerometer_bias"]),
        )
    ]
    z = np.concatenate(z)
    # 23 numbers: beyond 3.6 standard errors once in 130 seeds.
    assert np.max(np.abs(z)) < 3.6, z.round(1)
    assert np.mean(z**2) < 2.0


def test_a_truth_that_is_smoothed_and_turned_is_found_out(flight, fitted_twin):
    """Attitudes are averaged over 15 ms RMS, in a world that is turned against the positions'."""
    psi, sigma = np.array([0.004, -0.007, 0.02]), 0.015
    poses = flight.truth
    q_wb = poses.q_wb
    mean = np.zeros((len(q_wb), 3))
    lags = np.arange(-4, 5)
    weights = np.exp(-0.5 * (0.01 * lags / sigma) ** 2)
    weights /= weights.sum()
    for lag, weight in zip(lags, weights, strict=True):
        neighbours = np.clip(np.arange(len(q_wb)) + lag, 0, len(q_wb) - 1)
        mean += weight * log(multiply(conjugate(q_wb), q_wb[neighbours]))
    smooth = multiply(multiply(exp(-psi), q_wb), exp(mean))
    turned_twin = ims.twin(flight.readings, States(poses.t_ns, poses.position, smooth))
    bend, turn = turned_twin.errors["truth_curvature"], turned_twin.errors["truth_turn"]
    variance = np.sum(weights * (0.01 * lags) ** 2)
    assert bend.value[0] < -4.0 * bend.sigma[0]
    assert abs(bend.value[0] + 0.5 * variance) < 4.0 * bend.sigma[0]
    assert np.all(np.abs(turn.value - psi) < 4.0 * turn.sigma)
    assert np.all(turn.sigma < 0.25 * np.abs(psi))
    assert np.all(np.abs(fitted_twin.errors["truth_turn"].value) < 4.0 * turn.sigma)
    # The sensor's own errors are found all the same.
    for name in ("gyroscope_scale_misalignment", "accelerometer_bias", "mounting"):
        fitted, sigmas = fitted_twin.errors[name], turned_twin.errors[name].sigma
        off = np.abs(turned_twin.errors[name].value - fitted.value)
        assert np.all(off < 4.0 * np.maximum(sigmas, 1e-12)), (name, off / sigmas)


def in_standard_errors(fitted_twin):
    """Return the errors of all numbers that this flight's sensor has."""
    pairs = [
        ("stamp_offset", [0.004]),
        ("clock_skew_ppm", [40.0]),
        ("mounting", TURN),
        ("lever_arm", SENSOR["lever_arm"]),
        ("gyroscope_bias", SENSOR["gyroscope_bias"]),
        ("gyroscope_scale_misalignment", S_G.ravel()),
        ("accelerometer_bias", SENSOR["accelerometer_bias"]),
        ("accelerometer_scale_misalignment", S_A.ravel()),
    ]
    z = [
        (fitted_twin.errors[name].value - true)
        / np.where(fitted_twin.errors[name].sigma, fitted_twin.errors[name].sigma, 1e9)
        for name, true in pairs
    ]
    return np.concatenate(z)


@pytest.mark.parametrize(
    ("motion", "white", "decimals"),
    [
        ("figure_eight", 0.0, 4),
        ("lecture", 1e-5, 0),
        ("excitation", 1e-3, 0),
        ("excitation", 0.0, 3),
    ],
)
def test_a_truth_with_noise_is_no_sensor(motion, white, decimals):
    """Poses with noise [m], [rad], or rounded: numbers keep within their standard errors."""
    flight = ims.simulate(imu=SENSOR, trajectory=motion, duration=20, rate=100, seed=8)
    poses, rng = flight.truth, np.random.default_rng(9)
    position = poses.position + white * rng.standard_normal((len(poses.t_ns), 3))
    q_wb = multiply(poses.q_wb, exp(white * rng.standard_normal((len(poses.t_ns), 3))))
    if decimals:
        position, q_wb = np.round(position, decimals), normalise(np.round(q_wb, decimals))
    fitted_twin = ims.twin(flight.readings, States(poses.t_ns, position, q_wb))
    noise = fitted_twin.source.noise
    expected = white or 10.0**-decimals / np.sqrt(12.0)
    assert noise.deviation[1] == pytest.approx(expected, rel=0.15)
    z = in_standard_errors(fitted_twin)
    # 32 numbers, some of one piece: beyond 4 standard errors once in 500 flights.
    assert np.max(np.abs(z)) < 4.0, z.round(1)
    assert np.mean(z**2) < 2.0
    assert fitted_twin.source.cutoff < 12.0


def test_rough_motion_up_to_the_cut_off_is_no_error_of_the_sensor():
    """A spline smooth above 12 Hz biased the gyroscope's scale by 5e-4 through rates at 6 Hz.

    Standard errors are 4e-5 at most.
    """
    rough = {
        "type": "excitation",
        "vibration": {
            "frequency": [5.3, 5.9, 8.0, 9.0, 10.0, 11.0],
            "acceleration": np.ravel([[0.4, 0.3, 0.5], [0.3, 0.5, 0.4]] * 3).tolist(),
            "angular_rate": np.ravel([[0.2, 0.3, 0.25], [0.3, 0.2, 0.25]] * 3).tolist(),
        },
    }
    sensor = {
        "preset": "perfect",
        "gyroscope_noise_density": 1e-4,
        "accelerometer_noise_density": 1e-3,
    }
    flight = ims.simulate(
        imu=sensor, trajectory=rough, duration=30, rate=100, seed=8, start_time=5.0
    )
    fitted_twin = ims.twin(flight, flight.truth)
    scale = fitted_twin.errors["gyroscope_scale_misalignment"]
    assert np.abs(scale.value[::4] - 1.0).max() < 1.6e-4
    assert np.abs(scale.value[::4] - 1.0).max() < 4.0 * scale.sigma.max()
    bias = fitted_twin.errors["accelerometer_bias"]
    assert np.abs(bias.value / bias.sigma).max() < 4.0
    assert fitted_twin.simulate(seed=1).truth.t_ns[0] == flight.truth.t_ns[0]


def test_a_clock_that_is_first_guessed_200_ms_off_is_no_wandering_clock(monkeypatch):
    """A sensor of the benchmark on ``lecture``, whose turns repeat, with poses of 0.01 mm."""
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "bench")
    run = importlib.import_module("bench_twin").run
    z, _, _, wanders = run("lecture", "0.01", 2510)
    assert not wanders
    # 42 numbers, some of one piece: beyond 4 standard errors once in 400 flights.
    assert np.nanmax(np.abs(z)) < 4.0, z.round(1)


def test_numbers_that_hang_on_the_noise_are_not_given(flight, fitted_twin):
    """``excitation`` with poses of 3 cm and 30 mrad, and what that leaves."""
    fit = fitted_twin.analysis.fit
    hanging = np.zeros(42)
    hanging[[20, 30]] = 6.0, 3.0
    trust = judge_fit(
        fit._replace(noise_shift=hanging), np.ones(42), PoseNoise(np.full(6, 1e-3), 0.0, 0.0)
    )
    assert np.flatnonzero(~trust.given).tolist() == [20]
    assert trust.warnings == (
        "not given, since they hang on the noise of the poses, 1 mm and 1 mrad: "
        "gyroscope_g_sensitivity xx",
        "corrected for the noise of the poses, 1 mm and 1 mrad, in standard errors: "
        "lever_arm y by 3.0",
    )


@pytest.mark.parametrize(
    ("white", "steps", "is_given"),
    [(1e-3, (1e-4, 1e-4), True), (1e-5, (1e-3, 0.0), False), (1e-5, (0.0, 1e-3), False)],
)
def test_less_may_hang_on_rounding_than_on_white_noise(fitted_twin, white, steps, is_given):
    hanging = np.zeros(42)
    hanging[30] = 3.0
    noise = PoseNoise(np.full(6, white), *steps)
    fit = fitted_twin.analysis.fit
    trust = judge_fit(fit._replace(noise_shift=hanging), np.ones(42), noise)
    assert trust.given[30] == is_given
    # What rounding does is known no better than its size: the interval holds both.
    wider = 1.0 if is_given else np.sqrt(1.0 + 3.0**2)
    assert trust.fit.sigma[30] == pytest.approx(wider * fit.sigma[30])
    assert trust.fit.sigma[29] == pytest.approx(fit.sigma[29])


def test_a_fit_that_does_not_settle_is_refused(fitted_twin):
    fit = fitted_twin.analysis.fit
    check_settled(fitted_twin.source, fit)
    with pytest.raises(ims.InputError, match="does not settle: the noise of the poses, 0 mm and 0"):
        check_settled(fitted_twin.source, fit._replace(settled=False))


def test_quarters_that_contradict_each_other_widen_the_intervals(flight):
    """The accelerometer's bias jumps by 0.3 m/s^2 in the middle."""
    readings = flight.readings
    accel = readings.accel.copy()
    accel[len(accel) // 2 :, 1] += 0.3
    fitted_twin = ims.twin(ims.Readings(readings.t_ns, readings.gyro, accel, "jump"), flight.truth)
    assert any("quarters of the recording contradict" in line for line in fitted_twin.warnings)
    assert any("accelerometer_bias y" in line for line in fitted_twin.warnings)


def test_a_truth_that_is_not_levelled_is_named(half):
    readings, poses = half
    turned = multiply(exp(np.radians([5.5, 0.0, 0.0])), poses.q_wb)
    fitted_twin = ims.twin(readings, States(poses.t_ns, poses.position, turned))
    named_lines = [line for line in fitted_twin.warnings if "against gravity" in line]
    assert len(named_lines) == 1
    assert "turned by 5." in named_lines[0]


def test_scales_that_no_sensor_has_are_named(half):
    readings, poses = half
    gyro = readings.gyro * [1.0, 1.15, 1.0]
    fitted_twin = ims.twin(ims.Readings(readings.t_ns, gyro, readings.accel, "scaled"), poses)
    named_lines = [line for line in fitted_twin.warnings if "more than a sensor has" in line]
    assert any(line.startswith("gyroscope_scale_misalignment ") for line in named_lines), (
        fitted_twin.warnings
    )


def test_a_clean_recording_has_no_warnings(fitted_twin):
    assert fitted_twin.warnings == ()
    assert fitted_twin.given.all()
    assert not fitted_twin.source.noise.is_present


def test_noise_lines_and_bands_are_those_of_the_sensor(fitted_twin):
    white = fitted_twin.analysis.white
    density = np.repeat([1.7e-4, 2e-3], 3)
    # 30 s at 100 Hz, of which vibration leaves three quarters: 1.5 % of a density.
    np.testing.assert_allclose(white.density, density, rtol=0.06)
    lines = fitted_twin.analysis.lines
    np.testing.assert_allclose(lines.frequency, [41.3], atol=0.002)
    assert abs(lines.amplitude[0, 3] - 0.3) < 4.0 * lines.amplitude_sigma[0, 3]
    bands = fitted_twin.analysis.vibration
    in_band = (bands.low > 25.0) & (bands.high < 35.0)
    power = np.mean(bands.density[in_band] ** 2, axis=0)
    expected = np.square(VIBRATION["band_density"])
    # 2 * 30 s * 9 Hz squares: a relative deviation of 6 % of the power.
    np.testing.assert_allclose(power, expected, rtol=0.25)


def test_the_parameter_file_flies_the_same_sensor_again(flight, fitted_twin, tmp_path):
    path = fitted_twin.save(tmp_path / "twin.yaml")
    again = ims.simulate(params_file=path, trajectory="excitation", duration=30, seed=9)
    real = np.concatenate([flight.gyro - flight.truth.gyro, flight.accel - flight.truth.accel], 1)
    twin = np.concatenate([again.gyro - again.truth.gyro, again.accel - again.truth.accel], 1)
    # Vibration and noise: differences from sample to sample. 3000 samples, 4 standard deviations.
    step, twin_step = np.diff(real, axis=0).std(axis=0), np.diff(twin, axis=0).std(axis=0)
    np.testing.assert_allclose(twin_step, step, rtol=0.12)
    np.testing.assert_allclose(twin.mean(axis=0), real.mean(axis=0), atol=0.02)


def test_the_result_can_be_printed_saved_and_drawn(fitted_twin, tmp_path):
    numbers = fitted_twin.to_dict()
    assert numbers["errors"]["lever_arm"]["sigma"][0] > 0.0
    assert len(numbers["bias_over_time"]["t_s"]) >= 5
    assert "Twin of" in repr(fitted_twin)
    fitted_twin.plot().savefig(tmp_path / "twin.png")
    with pytest.raises(ims.InputError, match="already exists"):
        fitted_twin.save(tmp_path / "twin.png")


def test_bad_input_is_reported_in_a_line_each(flight):
    readings = flight.readings
    short = ims.Readings(readings.t_ns[:500], readings.gyro[:500], readings.accel[:500], "short")
    with pytest.raises(
        ims.InputError, match="short: has 4.99 s in common with the truth; a twin needs 10 s"
    ):
        ims.twin(short, flight.truth)
    gyro = readings.gyro.copy()
    gyro[7] = np.nan
    with pytest.raises(ims.InputError) as caught:
        ims.Readings(readings.t_ns, gyro, readings.accel, "bad")
    assert list(caught.value.problems) == [
        f"bad: number 7: {stamp_text(int(readings.t_ns[7]))}: a value that is not finite: "
        "angular velocity [nan, nan, nan]"
    ]
    stuck = ims.Readings(readings.t_ns, readings.gyro, 0.0 * readings.accel, "stuck")
    with pytest.raises(ims.InputError, match="stuck: accelerometer x: all readings are equal"):
        ims.twin(stuck, flight.truth)
    later = ims.Readings(readings.t_ns + 10**12, readings.gyro, readings.accel, "later")
    with pytest.raises(ims.InputError, match="their stamps must be of one clock"):
        ims.twin(later, flight.truth)
    with pytest.raises(ims.ConfigurationError) as caught:
        ims.twin(readings, flight.truth, fit=29.0, gravity=float("nan"))
    assert list(caught.value.problems) == ["gravity = nan: must be between 1 and 30 m/s^2"]
    with pytest.raises(ims.InputError, match="must leave 8 s of the"):
        ims.twin(readings, flight.truth, fit=25.0)
    degrees = ims.Readings(readings.t_ns, 57.3 * readings.gyro, readings.accel, "degrees")
    with pytest.raises(ims.InputError, match=r"degrees: .*gyro_unit='deg/s' converts it"):
        ims.twin(degrees, flight.truth)
    reverse = ims.Readings(readings.t_ns, readings.gyro[::-1], readings.accel, "reverse")
    with pytest.raises(ims.InputError, match="the truth explains .* % of what the gyroscope reads"):
        ims.twin(reverse, flight.truth)
    still = ims.simulate(trajectory="static", duration=12, rate=50)
    with pytest.raises(ims.InputError, match="the truth: hardly turns"):
        ims.twin(still, still.truth)


def test_losses_are_bridged_or_end_a_piece(flight):
    """Two samples of each hundred are missing, and once two seconds."""
    readings = flight.readings
    row = np.arange(len(readings))
    keep = (row % 100 > 1) & ~((row > 1000) & (row < 1200))
    part = ims.Readings(readings.t_ns[keep], readings.gyro[keep], readings.accel[keep], "lossy")
    arm = ims.twin(part, flight.truth).errors["lever_arm"]
    assert np.all(np.abs(arm.value - SENSOR["lever_arm"]) < 4.0 * arm.sigma)
    slow = ims.Readings(readings.t_ns[::20], readings.gyro[::20], readings.accel[::20], "slow")
    with pytest.raises(ims.InputError, match="slow: the longest piece without a loss has 147 samp"):
        ims.twin(slow, flight.truth)


@pytest.mark.skipif(not EUROC_IMU.is_file(), reason=missing(EUROC_IMU))
def test_a_real_flight_and_its_twin():
    """EuRoC V1_02: what holds of the twin of its first 20 s on the 19 s that follow.

    Below 5 Hz the residual is mostly the truth's own error, which changes along this flight.
    """
    fitted_twin = ims.twin(EUROC_IMU, EUROC, fit=20.0)
    bias = fitted_twin.errors["gyroscope_bias"]
    assert np.all(np.abs(bias.value - [-0.0022, 0.0207, 0.0758]) < 3.0 * bias.sigma)
    bias = fitted_twin.errors["accelerometer_bias"]
    assert np.all(np.abs(bias.value - [-0.013, 0.103, 0.093]) < 3.0 * bias.sigma)
    # The truth's attitudes are smoothed, and not in the same world as its positions.
    bend, turn = fitted_twin.errors["truth_curvature"], fitted_twin.errors["truth_turn"]
    assert bend.value[0] < -5.0 * bend.sigma[0]
    assert np.any(np.abs(turn.value) > 4.0 * turn.sigma)
    check = fitted_twin.check
    assert np.all(np.abs(check.decibels[3:]) < 2.0), check.decibels.round(1)
    # Disturbances, counted in the real density, are left out of the twin's.
    assert np.all(np.abs(check.decibels[2]) < 2.5), check.decibels.round(1)
    assert np.count_nonzero(np.abs(check.decibels) < 2.0) >= 23
    assert np.all(np.abs(check.decibels) < 4.6), check.decibels.round(
        1
    )  # 4.7 along a smoother truth
    assert np.all(np.abs(check.simulated_drift / check.real_drift - 1.0) < 0.25)
    # Windows of twin and real sensor differ no more than those of the real sensor on both parts:
    # 5 points, and the deviation of a share of 66 windows, 6.2 points, over the root of 5 twins.
    assert check.told_apart < check.real_told_apart + 0.05 + 0.028
    # Its attitudes scatter less in the second part: 4.4, 3.4, 2.8 dB.
    assert np.all(check.truth_noise[:3] < 0.8)
    # At rest the sensor shows 1.2 to 1.6e-4 and 1.7 to 2.5e-3 in 100 readings, each deviation
    # within 1 / sqrt(200) = 7 % of its own, so 14 % below at two; in flight there is a bound.
    assert np.all(fitted_twin.analysis.white.high[:3] > 0.86 * 1.2e-4)
    assert np.all(fitted_twin.analysis.white.high[3:] > 0.86 * 1.7e-3)
