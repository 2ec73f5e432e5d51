# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The mathematics of the digital twin, on motions and noise that are known exactly."""

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.calibration.twin import alignment as clock
from imu_sim_ros.calibration.twin import model, spectrum
from imu_sim_ros.calibration.twin.alignment import coarse_offset, fit_mounting
from imu_sim_ros.calibration.twin.comparison import Windows, classification_rate
from imu_sim_ros.calibration.twin.fit import Recording, _inverse, _Sums, fit
from imu_sim_ros.calibration.twin.intensity import (
    factors,
    filter_band,
    find_lines,
    fit_exponents,
    remove_disturbances,
    vibration_mask,
)
from imu_sim_ros.calibration.twin.model import BodyMotion, Errors, KnownMotion
from imu_sim_ros.calibration.twin.pose_noise import (
    highest_motion,
    noise_of,
    noise_over,
    scatter,
)
from imu_sim_ros.calibration.twin.spectrum import (
    Bands,
    White,
    above_floor,
    band_edges,
    bound_above,
    bound_below,
    cross_spectra,
    quietest_density,
    white_floor,
)
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import States, replace_fields
from imu_sim_ros.jobs.twin import _steps

RATE = 100.0
SECONDS = 40.0
GYRO, ACCEL = 2e-4, 2e-3
"""Two-sided densities of the white noise."""


def motion_at(t):
    """Return a motion that tumbles and swings in all directions, at 0.1 to 0.9 Hz."""
    turns = np.array([[0.9, 0.5, 0.7], [0.6, 0.8, 0.4]])
    w = 2.0 * np.pi * np.array([[0.13, 0.29, 0.41], [0.71, 0.53, 0.83]])
    phase = np.array([[0.0, 1.0, 2.0], [0.5, 1.5, 2.5]])
    angle = w * t[:, None, None] + phase
    rate = np.sum(turns * np.sin(angle), axis=1)
    alpha = np.sum(turns * w * np.cos(angle), axis=1)
    sway = np.sum([4.0, 3.0, 5.0] * np.sin(0.7 * w[:1] * t[:, None, None] + 3.0 * phase), axis=1)
    tilt = 6.0 * np.sin(0.31 * t)[:, None] * [1.0, 0.0, 0.0] + [0.0, 0.0, 8.0]
    sideways = 6.0 * np.cos(0.47 * t)[:, None] * [0.0, 1.0, 0.0]
    return BodyMotion(rate, sway + tilt + sideways, alpha)


def turning(t):
    """Return the same with an attitude that turns about the vertical."""
    angle = np.stack([0.0 * t, 0.0 * t, 0.8 * t], axis=1)
    r_wb = rotation.to_matrix(rotation.exp(angle))
    return motion_at(t)._replace(r_bw=np.swapaxes(r_wb, -1, -2))


def flaws(seed):
    rng = np.random.default_rng(seed)
    response = np.eye(6)
    response[3:, 3:][np.triu_indices(3)] += 0.01 * rng.standard_normal(6)
    mounting = rotation.to_matrix(rotation.exp(0.5 * rng.standard_normal(3)))
    response[:3, :3] += 0.01 * rng.standard_normal((3, 3))
    response[:3, 3:] = 1e-4 * rng.standard_normal((3, 3))
    return Errors(
        mounting,
        response,
        0.1 * rng.standard_normal(3),
        np.concatenate([0.02 * rng.standard_normal(3), 0.1 * rng.standard_normal(3)]),
        0.005 * rng.standard_normal(),
        5e-5 * rng.standard_normal(),
        0.0,
        np.zeros(3),
    )


def record(errors, seed, extra=0.0):
    rng = np.random.default_rng(1000 + seed)
    stamps = 1.0 + np.arange(round(SECONDS * RATE)) / RATE
    reference = float(stamps[0] + stamps[-1]) / 2.0
    t = model.true_times(errors, stamps, reference, np.zeros(len(stamps)))
    noise = rng.standard_normal((len(t), 6)) * np.sqrt(RATE) * np.repeat([GYRO, ACCEL], 3)
    y = model.readings(errors, motion_at(t)) + noise + extra
    return Recording(stamps, y, (slice(0, len(t)),), RATE)


def deviation(estimated, true):
    """Return the errors of all parameters, that of the mounting as a rotation vector."""
    result = estimated.deviation() - true.deviation()
    turn = estimated.r_ib @ true.r_ib.T
    result[model.MOUNTING] = rotation.log(rotation.from_matrix(turn))
    return result


def test_the_jacobian_is_the_derivative_of_the_readings():
    errors = flaws(1)
    stamps = np.linspace(2.0, 8.0, 7)
    still = np.zeros(7)
    linear = model.linearise_readings(errors, turning, stamps, 5.0, still)
    jacobian = np.einsum("ns,asp->nap", linear.signals, linear.coefficients)

    def read(changed):
        t = model.true_times(changed, stamps, 5.0, still)
        return model.predict_readings(changed, turning, t)[0]

    for k in range(model.COUNT):
        step = np.zeros(model.COUNT)
        step[k] = 1e-6
        numeric = (read(errors.step(step)) - read(errors.step(-step))) / 2e-6
        np.testing.assert_allclose(jacobian[:, :, k], numeric, rtol=2e-6, atol=2e-6)
    np.testing.assert_array_equal(linear.slope, jacobian[:, :, 0])


@pytest.fixture(scope="module")
def fits():
    """Return the true parameters and the fit of three sensors, each recorded once."""
    result = []
    for seed in range(3):
        true = flaws(seed)
        recording = record(true, seed)
        y, stamps = recording.readings, recording.stamps
        offset = coarse_offset(stamps, y[:, :3], motion_at, stamps[-1] + 1.0, 0.05)
        start = model.perfect(fit_mounting(y[:, :3], y[:, 3:], motion_at(stamps)), offset)
        result.append((true, fit(recording, KnownMotion(motion_at, 6.0), start)))
    return result


def test_every_parameter_is_found_within_its_standard_error(fits):
    # Without an attitude nothing is known of the world of the truth, the last three.
    z = np.array([(deviation(fitted.errors, true) / fitted.sigma)[:39] for true, fitted in fits])
    # 117 numbers: the mean square of normal ones is 1 +- sqrt(2 / 117) = 0.13, more where they
    # depend on one another; standard errors wrong by sqrt(2) give 2 or 0.5.
    assert 0.6 < np.mean(z**2) < 1.5
    # One number in 4000 is beyond 3.7 standard errors.
    assert np.max(np.abs(z)) < 3.9


def test_standard_errors_are_those_of_the_noise(fits):
    """The bias of n samples of white noise that nothing else explains: density / sqrt(T)."""
    _, fitted = fits[0]
    assert np.all(fitted.sigma[model.BIAS][:3] > 0.9 * GYRO / np.sqrt(SECONDS))
    assert np.all(fitted.sigma[model.BIAS][:3] < 3.0 * GYRO / np.sqrt(SECONDS))


def test_a_motion_about_one_axis_leaves_the_rest_at_its_prior():
    def about_z(t):
        full = motion_at(t)
        z_axis = np.array([0.0, 0.0, 1.0])
        return BodyMotion(
            full.rate * z_axis, np.tile([0.0, 0.0, 9.81], (len(t), 1)), full.rate * 0.0
        )

    stamps = np.arange(3000) / RATE
    rng = np.random.default_rng(4)
    noise = rng.standard_normal((3000, 6)) * np.sqrt(RATE) * np.repeat([GYRO, ACCEL], 3)
    y = model.readings(model.perfect(np.eye(3)), about_z(stamps)) + noise
    recording = Recording(stamps, y, (slice(0, 3000),), RATE)
    fitted = fit(recording, KnownMotion(about_z, 6.0), model.perfect(np.eye(3)))
    # The lever arm along the axis, and what scales a rate that is always zero.
    prior = 0.5
    assert fitted.sigma[model.LEVER_ARM][2] == pytest.approx(prior, rel=1e-3)
    assert fitted.sigma[model.GYROSCOPE][0] == pytest.approx(0.03, rel=1e-2)
    assert fitted.sigma[model.GYROSCOPE][8] < 1e-3


def test_white_noise_is_a_floor_and_nothing_else():
    rng = np.random.default_rng(7)
    density = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    values = rng.standard_normal((8000, 6)) * np.sqrt(RATE) * density
    parts = [slice(0, 8000)]
    bands = cross_spectra(values, parts, RATE, band_edges(80.0, RATE))
    white = white_floor(bands, 1.0)
    # 8000 samples: a relative error of sqrt(1 / 16000) = 0.8 % of a density.
    np.testing.assert_allclose(white.density, density, rtol=0.03)
    assert np.all((white.low < density * 1.02) & (white.high > density * 0.98))
    assert len(above_floor(bands, white).low) <= 0.02 * len(bands.low) + 2


@pytest.mark.parametrize(
    ("share", "times", "hides"),
    [(0.0, (1.0, 1.0), False), (0.25, (1.1, 2.0), False), (0.4, (50.0, 50.0), False),
     (0.8, (1.2, 20.0), True)],
)  # fmt: skip
def test_intervals_of_a_floor_hold_it_whatever_else_some_bands_have(share, times, hides):
    """Intervals cover the floor where some of 50 bands exceed it; where most do, its bound does."""
    rng, covered, intervals, trials = np.random.default_rng(9), 0, 0, 60
    for _ in range(trials):
        freedom = np.full((50, 6), 42.0)
        freedom[:10] = rng.uniform(6.0, 30.0, 10)[:, None]
        power = rng.chisquare(freedom) / freedom
        power[rng.permutation(50)[: round(50 * share)]] *= rng.uniform(*times)
        edges = np.arange(51.0)
        weights = np.ones(len(power))
        bands = Bands(edges[:-1], edges[1:], power[:, :, None] * np.eye(6), freedom, weights)
        white = white_floor(bands, 0.0)
        covered += np.count_nonzero((white.low <= 1.0) & (white.high >= 1.0))
        intervals += np.count_nonzero(white.low)
    # 360 intervals of 95 %: one standard deviation is 1.1 %, and what is a little above the floor
    # costs up to 2 %. Standard errors wrong by sqrt(2) hold 83 %.
    assert covered >= 0.895 * 6 * trials
    assert intervals < 0.1 * 6 * trials if hides else intervals > 0.6 * 6 * trials


def test_the_floor_of_white_noise_is_its_density_with_the_scatter_that_is_stated():
    """40 records of 30 s, six axes each: densities are right, and so are their intervals.

    A floor scatters by 2.6 %, the mean of 240 by 0.17 %; a root of a mean is lower by half of its
    relative variance, and the cut at a quantile costs as much again. With a fifth too few degrees
    of freedom the mean was 2 % too high. Of the squares in a band, the relative variance is 2 over
    the degrees of freedom; over 240 records, its mean over 50 bands is known within 2 %.
    """
    rng, n = np.random.default_rng(3), 3000
    edges, powers, floors = band_edges(n / RATE, RATE), [], []
    for _ in range(40):
        bands = cross_spectra(rng.standard_normal((n, 6)), [slice(0, n)], RATE, edges)
        powers.append(bands.density**2 * RATE)
        floors.append(white_floor(bands, 1.0)[:3])
    density, low, high = np.sqrt(RATE) * np.moveaxis(floors, 1, 0)
    resolved = low > 0.0  # else it is a bound
    assert np.mean(resolved) > 0.95
    assert abs(np.mean(density[resolved]) - 1.0) < 0.01
    # 228 intervals of 95 %: one standard deviation is 1.4 %.
    assert np.mean((low <= 1.0) & (high >= 1.0)) > 0.90
    scatter = np.var(powers, axis=(0, 2)) / np.mean(powers, axis=(0, 2)) ** 2
    assert np.mean(scatter * bands.freedom[:, 0] / 2.0) == pytest.approx(1.0, abs=0.08)


def test_bands_above_the_floor_are_found_with_their_coherence():
    rng = np.random.default_rng(8)
    n = 8000
    common = np.fft.irfft(
        np.fft.rfft(rng.standard_normal(n))
        * ((np.fft.rfftfreq(n, 1 / RATE) > 20) & (np.fft.rfftfreq(n, 1 / RATE) < 30)),
        n,
    )
    values = rng.standard_normal((n, 6)) * 0.01
    values[:, 1] += common
    values[:, 5] -= 2.0 * common
    bands = cross_spectra(values, [slice(0, n)], RATE, band_edges(n / RATE, RATE))
    excess = above_floor(bands, white_floor(bands, 1.0))
    band = (excess.low > 20.5) & (excess.high < 29.5)
    assert np.count_nonzero(band) >= 8
    size = excess.density[band]
    np.testing.assert_allclose(size[:, 1].mean(), 1.0 / np.sqrt(RATE), rtol=0.05)
    np.testing.assert_allclose(size[:, 5].mean(), 2.0 / np.sqrt(RATE), rtol=0.05)
    pair = excess.matrix[band][:, 1, 5] / (size[:, 1] * size[:, 5])
    assert np.all(pair.real < -0.99)


def test_lines_are_found_with_their_phases():
    rng = np.random.default_rng(9)
    t = np.arange(6000) / RATE
    values = rng.standard_normal((6000, 6)) * 0.1
    values[:, 0] += 0.05 * np.sin(2.0 * np.pi * 23.417 * t + 0.3)
    values[:, 4] += 0.08 * np.sin(2.0 * np.pi * 23.417 * t + 1.3)
    values[:, 2] += 0.05 * np.sin(2.0 * np.pi * 31.25 * t)
    lines, rest = find_lines(values, RATE)
    np.testing.assert_allclose(lines.frequency, [23.417, 31.25], atol=1e-3)
    assert np.all(np.abs(lines.frequency - [23.417, 31.25]) < 4.0 * lines.frequency_sigma)
    sigma = 0.1 * np.sqrt(2.0 / 6000)  # of an amplitude in white noise
    np.testing.assert_allclose(lines.amplitude_sigma, sigma, rtol=0.3)
    assert abs(lines.amplitude[0, 0] - 0.05) < 4.0 * sigma
    assert abs(lines.amplitude[0, 4] - 0.08) < 4.0 * sigma
    apart = lines.phase[0, 4] - lines.phase[0, 0]
    assert np.angle(np.exp(1j * (apart - 1.0))) == pytest.approx(0.0, abs=4.0 * sigma / 0.035)
    assert rest.std() == pytest.approx(0.1, rel=0.02)


def test_a_rotor_that_changes_its_speed_is_no_line():
    t = np.arange(6000) / RATE
    rng = np.random.default_rng(10)
    values = rng.standard_normal((6000, 6)) * 0.1
    values[:, 0] += 0.3 * np.sin(
        2.0 * np.pi * 25.0 * t + np.cumsum(rng.standard_normal(6000)) * 0.2
    )
    lines, _ = find_lines(values, RATE)
    assert len(lines.frequency) == 0


def test_intensity_that_follows_the_rate_is_recovered():
    rng = np.random.default_rng(11)
    n = 12000
    logs = np.zeros((n, 3))
    logs[:, 0] = 0.7 * np.sin(2.0 * np.pi * np.arange(n) / 3000.0)
    logs[:, 2] = 0.5 * np.cos(2.0 * np.pi * np.arange(n) / 1700.0)
    truth = np.array([[1.5, 0.0, 0.0], [0.0, 0.0, 0.0]])
    values = rng.standard_normal((n, 6)) * factors(truth, logs)
    response = fit_exponents(values, [slice(0, n)], RATE, logs)
    for k in (2, 3):  # 5-20 Hz, and above
        assert abs(response.value[k, 0, 0] - 1.5) < 4.0 * response.sigma[k, 0, 0] + 0.05
        assert response.sigma[k, 0, 0] < 0.1
        assert np.abs(response.value[k, 1]).max() < 0.3
    assert response.value.min() >= 0.0  # nothing gets quieter by moving


def test_a_wandering_clock_is_followed_and_a_steady_one_left_alone():
    rng = np.random.default_rng(12)
    stamps = np.arange(4000) / RATE
    slope = np.concatenate([np.gradient(motion_at(stamps).rate, stamps, axis=0)] * 2, axis=1)
    noise = rng.standard_normal((4000, 6)) * GYRO * np.sqrt(RATE)
    course = 2e-3 * np.sin(2.0 * np.pi * stamps / 40.0)
    offset = clock.wander(stamps, slope * course[:, None] + noise, slope, RATE)
    assert np.std(offset - course) < 2e-4
    assert not clock.wander(stamps, noise, slope, RATE).any()


def test_a_disturbance_is_scaled_down_to_the_usual():
    rng = np.random.default_rng(14)
    values = rng.standard_normal((4000, 6))
    values[2000:2100, 1] *= 10.0
    calm, count = remove_disturbances(values, [slice(0, 4000)], RATE, 20.0, 50.0)
    assert count in (2, 3)  # half-windows that the burst touches
    band = filter_band(calm, [slice(0, 4000)], RATE, 20.0, 50.0)
    usual = np.mean(band[:2000, 1] ** 2)
    # What is left of the burst has the usual energy, known to sqrt(2 / 60) of it.
    assert 0.5 < np.mean(band[2000:2100, 1] ** 2) / usual < 1.6
    np.testing.assert_array_equal(calm[:, 0], values[:, 0])


def poses_at(t, position, q_wb):
    t_ns = np.rint(t * 1e9).astype(np.int64)
    return States.unchecked(t_ns=t_ns, position=position, q_wb=q_wb)


def test_noise_of_poses_is_measured_where_nothing_moves():
    rng = np.random.default_rng(15)
    t = np.arange(4000) / RATE
    angle = np.stack([np.sin(0.9 * t), 0.5 * np.cos(1.3 * t), 0.7 * t], axis=1)
    position = 3.0 * angle[:, ::-1]
    size = np.where(t < 20.0, 1.0, 0.5)[:, None] * [[2e-5, 1e-5, 4e-5, 1e-4, 2e-4, 3e-4]]
    noise = size * rng.standard_normal((4000, 6))
    q_wb = rotation.multiply(rotation.exp(angle), rotation.exp(noise[:, :3]))
    position_noisy = position + rotation.rotate(q_wb, noise[:, 3:])
    centres, differences = scatter(poses_at(t, position_noisy, q_wb))
    # Differences of eighth order that overlap: some 700 free ones in 2000, 3 % of a deviation.
    size_before, size_after = (
        differences[centres < 19.9].std(axis=0),
        differences[centres > 20.1].std(axis=0),
    )
    np.testing.assert_allclose(size_before, size[0], rtol=0.12)
    np.testing.assert_allclose(size_after, size[-1], rtol=0.12)
    ratio = noise_over(centres, differences, (0.0, 19.9), np.array([10.0, 30.0]))
    assert np.all(np.abs(ratio / [[1.0], [0.5]] - 1.0) < 0.5)  # in one second, 12 %
    _, still = scatter(poses_at(t, position, rotation.exp(angle)))
    assert not still.any()
    centres, few = scatter(poses_at(t[:5], position[:5], q_wb[:5]))
    assert len(few) == 0
    np.testing.assert_array_equal(noise_over(centres, few, (0.0, 9.0), t[:3]), 1.0)


def curve(t):
    angle = np.stack([np.sin(0.9 * t), 0.5 * np.cos(1.3 * t), 0.5 * t + np.sin(t)], axis=1)
    return poses_at(t, 3.0 * angle[:, ::-1], rotation.exp(angle))


@pytest.mark.parametrize("digits", [3, 4, 5])
def test_digits_of_poses_are_found_and_their_rounding_drawn(digits):
    smooth, step = curve(np.arange(4000) / RATE), 10.0**-digits
    q_wb = rotation.normalise(np.round(smooth.q_wb, digits))
    noise = noise_of(poses_at(smooth.t, np.round(smooth.position, digits), q_wb), smooth)
    assert noise.quaternion_step == pytest.approx(step)
    assert noise.position_step == pytest.approx(step)
    # The fastest digits are even within a step, their deviation step / sqrt(12); 4000 poses.
    turn, shift = noise.draw(smooth, np.random.default_rng(3))
    np.testing.assert_allclose(shift.std(axis=0), step / np.sqrt(12.0), rtol=0.1)
    np.testing.assert_allclose(turn.std(), 2.0 * step / np.sqrt(12.0), rtol=0.15)
    np.testing.assert_allclose(noise.deviation, [turn.std(), shift.std()], rtol=0.2)


def test_stamps_that_are_not_even_make_no_noise():
    rng = np.random.default_rng(16)
    t = np.sort(np.arange(4000) / RATE + 0.004 * rng.uniform(-1.0, 1.0, 4000))
    smooth = curve(t)
    assert not noise_of(smooth, smooth).is_present
    noisy = replace_fields(smooth, position=smooth.position + 1e-4 * rng.standard_normal((4000, 3)))
    white = noise_of(noisy, smooth).white
    np.testing.assert_allclose(white[3:], 1e-4, rtol=0.12)
    assert np.all(white[:3] < 1e-6)


def test_the_highest_motion_above_noise():
    rng = np.random.default_rng(17)
    t = np.arange(6000) / RATE
    motion = np.stack([np.sin(2.0 * np.pi * f * t) for f in (0.3, 1.1, 4.0)], axis=1)
    noise = 0.05 * rng.standard_normal((3, 6000, 3))
    frequency = highest_motion(motion + noise[0], [motion + noise[0] + n for n in noise[1:]], RATE)
    # A band around 4 Hz; 3 Hz wide at most.
    assert 4.0 <= frequency < 6.0


def test_noise_of_poses_is_taken_out_of_the_normal_equations():
    """Without that gains are too small by the noise's share of the motion."""
    true = flaws(5)
    response = true.response.copy()
    response[:3, :3] = np.eye(3)
    true = true._replace(response=response)
    recording = record(true, 5)
    size = np.array([0.3, 3.0])

    def noisy(seed):
        rng = np.random.default_rng(seed)
        waves = rng.uniform(0.05, 4.0, 40) * 2.0 * np.pi
        phase = rng.uniform(0.0, 2.0 * np.pi, (40, 6))

        def more(t):
            wave = np.sqrt(2.0 / 40) * np.sin(
                waves[:, None, None] * t + phase.T[:, :, None].swapaxes(0, 1)
            )
            total = wave.sum(axis=0).T
            return size[0] * total[:, :3], size[1] * total[:, 3:]

        return more

    real, drawn = noisy(1), [noisy(2), noisy(3)]

    def observed(t, *errors):
        motion = motion_at(t)
        for error in errors:
            rate, force = error(t)
            motion = motion._replace(rate=motion.rate + rate, force=motion.force + force)
        return motion

    start = model.perfect(true.r_ib, true.offset)
    plain = fit(recording, KnownMotion(lambda t: observed(t, real), 8.0), start)
    draws = tuple(lambda t, d=d: observed(t, real, d) for d in drawn)
    fitted = fit(recording, KnownMotion(lambda t: observed(t, real), 8.0, draws), start)
    gain = [np.trace(f.errors.response[:3, :3]) / 3.0 for f in (plain, fitted)]
    sigma = np.sqrt(np.sum(fitted.sigma[model.GYROSCOPE][::4] ** 2)) / 3.0
    assert gain[0] < 1.0 - 4.0 * sigma, gain
    assert abs(gain[1] - 1.0) < 3.0 * sigma, (gain, sigma)
    # What was taken out is more than a standard error of each gain, though bands of much noise
    # weigh little, and is said.
    assert (fitted.noise_shift[model.GYROSCOPE][::4] > 1.0).all(), fitted.noise_shift
    assert not plain.noise_shift.any()


def test_what_is_all_noise_stays_at_the_prior():
    """A direction whose information is negative less the noise: the readings move nothing there."""
    prior = np.array([2.0, 0.5])
    normal = np.diag(prior**-2) + np.diag([3.0, -1.0])
    inverse, projection = _inverse(normal, prior)
    np.testing.assert_allclose(inverse, np.diag([1.0 / (0.25 + 3.0), 0.25]))
    np.testing.assert_allclose(inverse @ projection.T @ [1.0, 100.0], [1.0 / 3.25, 0.0], atol=1e-12)
    inverse, projection = _inverse(np.diag(prior**-2) + np.eye(2), prior)
    np.testing.assert_array_equal(projection, np.eye(2))
    np.testing.assert_allclose(inverse, np.diag([1.0 / 1.25, 1.0 / 5.0]))


def test_densities_have_the_shape_of_the_noise_of_the_poses_within_a_bin():
    """Rates from white attitudes have a density that rises with the square of the frequency."""
    sums = _Sums([slice(0, 4000)], RATE, 2.0, 1)
    for k in range(sums._bins[0].size):
        sums._noise[0][k] = (k + 0.5) ** 2
    bins = sums._bins[0]
    sums.count = np.bincount(bins, minlength=len(sums.count)).astype(float)
    means = np.bincount(bins, sums._noise[0][:, 0], len(sums.count)) / np.maximum(sums.count, 1.0)
    sums.update_shape(np.tile(means[:, None], 6))
    weights, _ = sums.weights_of(0, np.ones((len(sums.count), 6)))
    k = np.arange(20, len(weights) - 4)
    # What is not noise of the poses has a tenth of a bin's mean at least.
    rest = 0.1 * means[bins[k]]
    np.testing.assert_allclose(1.0 / weights[k, 0], (k + 0.5) ** 2 + rest, rtol=0.05)


def test_what_estimated_weights_cost_is_in_the_standard_errors():
    """A mean of six groups of 20, weighted by their own variances (Kenward and Roger 1997).

    20,000 draws: a variance is known to 1 %; the next order in 1 / 20 is some per cent.
    """
    rng = np.random.default_rng(3)
    count, draws = 20, 20_000
    values = rng.standard_normal((draws, 6, count))
    weights = count / values.var(axis=2, ddof=1)
    means = np.sum(weights * values.mean(axis=2), axis=1) / weights.sum(axis=1)
    claimed = np.mean(1.0 / weights.sum(axis=1))
    sums = _Sums([slice(0, 4000)], RATE, 2.0, 1)
    sums.count[:] = 0.0
    sums.count[1] = count - 1
    sums.matrix[1] = count
    inverse = np.array([[1.0 / (6.0 * count)]])
    factor = float(sums.widening_factors(np.ones_like(sums.remaining_share), inverse)[0])
    assert factor**2 == pytest.approx(means.var() / claimed, rel=0.04)
    assert means.var() / claimed > 1.1


def test_jumps_of_a_truth_are_not_its_usual_noise():
    rng = np.random.default_rng(20)
    t = np.arange(4000) / 200.0
    position = 1e-3 * rng.standard_normal((4000, 3))
    position[1000:] += 0.5
    position[2500:] -= 0.3
    q_wb = np.tile([1.0, 0.0, 0.0, 0.0], (4000, 1))
    white = noise_of(poses_at(t, position, q_wb), poses_at(t, 0.0 * position, q_wb)).white
    # 200 differences a second, neighbours alike: a variance is known to some 15 %.
    np.testing.assert_allclose(white[3:], 1e-3, rtol=0.1)


def test_a_floor_is_not_below_what_rest_shows():
    rng = np.random.default_rng(18)
    values = rng.standard_normal((4000, 6)) * np.sqrt(RATE)
    assert not quietest_density(values, RATE).any()  # no second is quieter than the others
    values[300:] *= 5.0
    floor = quietest_density(values, RATE)
    # The lower of two powers of the quietest of five seconds, with some 13 free squares each:
    # chi-square 4.1 of 13 once in a hundred, 0.56 a density, and the mean at most.
    assert np.all((floor > 0.5) & (floor < 1.0))
    bands = cross_spectra(0.3 * values[:300], [slice(0, 300)], RATE, band_edges(3.0, RATE))
    assert np.all(white_floor(bands, 1.0).density < 0.4)
    white = bound_below(white_floor(bands, 1.0), 3.0 * floor)
    assert np.all(white.density >= 3.0 * floor)
    assert np.all(white.high >= 3.0 * floor)


def test_a_hidden_floor_is_not_above_any_band():
    hidden = White(np.full(6, 2.0), np.zeros(6), np.full(6, 3.0), np.zeros((1, 6), dtype=bool))
    assert np.all(bound_above(hidden, np.full(6, 0.5)).density == 0.5)
    assert np.all(bound_above(hidden, np.full(6, 0.5)).high == 3.0)  # as uncertain as before
    assert np.all(bound_above(hidden, np.full(6, 5.0)).density == 2.0)
    visible = hidden._replace(low=np.ones(6))
    assert np.all(bound_above(visible, np.full(6, 0.5)).density == 2.0)


def test_vibration_begins_with_the_rotors():
    rng = np.random.default_rng(19)
    values = rng.standard_normal((6000, 6))
    values[:2000] *= 0.05
    values[700:800] *= 40.0  # a knock is no flight
    values[5500:] *= 0.05
    rows = vibration_mask(values, [slice(0, 6000)], RATE)
    np.testing.assert_array_equal(np.flatnonzero(rows), np.arange(2000, 5500))
    assert vibration_mask(values[2000:5500], [slice(0, 3500)], RATE).all()
    assert vibration_mask(values, [slice(0, 6000)], 20.0).all()  # readings too slow to show rotors


def test_a_classifier_tells_what_differs_and_only_that():
    rng = np.random.default_rng(13)
    a, b = rng.standard_normal((2, 400, 12))
    # 800 windows assigned by chance: 0.5 +- 0.018.
    assert abs(classification_rate(a, b, 400) - 0.5) < 0.08
    assert classification_rate(a, b + 1.0, 400) > 0.9
    # The first 40 windows are alike, all others far apart: of those that are drawn, a tenth of one
    # side, and so a twentieth of all, is assigned wrong: 0.95 +- 0.024.
    later = np.where(np.arange(400)[:, None] < 40, 0.0, 2.0)
    assert classification_rate(a, b + later, 40) > 0.8
    # What was fitted is as like the rest as a twin that reads the same.
    simulated, twin_rate = Windows(a[:40], b + later, (a[:40],)).classification_rates()
    assert simulated == twin_rate


def test_the_white_floor_is_that_before_rounding():
    """Noise of 2e-3 at 100 Hz is one step of 0.02 m/s^2: rounding adds 4.1 % to the density.

    The twin has the step, too, so that rounding was simulated twice. A density's standard error is
    1.5 % here, that of the mean of three axes of two flights 0.6 %; the threshold is five of them.
    """
    imu = {
        "preset": "perfect",
        "gyroscope_noise_density": 1.7e-4,
        "accelerometer_noise_density": 2e-3,
        "accelerometer_resolution": 0.02,
    }
    densities = []
    for seed in range(2):
        flight = ims.simulate(imu=imu, trajectory="figure_eight", duration=30, rate=100, seed=seed)
        twin = ims.twin(flight.readings, flight.truth)
        assert twin.parameters["imu.accelerometer_resolution"] == pytest.approx([0.02] * 3)
        densities += list(twin.parameters["imu.accelerometer_noise_density"])
    assert abs(np.sqrt(np.mean(np.square(densities))) / 2e-3 - 1.0) < 0.03


def test_rounding_that_is_most_of_the_floor_leaves_a_bound():
    rounding = 0.02 / np.sqrt(12 * 100.0)
    white = spectrum.White(*np.full((3, 6), rounding * 1.2), np.zeros((1, 6), dtype=bool))
    floor = spectrum.remove_rounding(white, np.repeat([0.0, 0.02], 3), 100.0)
    assert (floor.low == np.repeat([rounding * 1.2, 0.0], 3)).all()
    assert floor.density[3:] == pytest.approx(rounding * np.sqrt(1.2**2 - 1.0))
    assert (floor.high == white.high).all()


@pytest.mark.parametrize("imu", ["bmi088", "adis16448"])
def test_the_steps_of_readings_in_motion_are_those_of_the_sensor(imu):
    flight = ims.simulate(imu=imu, trajectory="figure_eight", duration=20, seed=0)
    readings = np.hstack([flight.gyro, flight.accel])
    readings[50:80] += 1e-5 * np.arange(30)[:, None]  # as if interpolated
    parameters = flight.parameters.imu
    expected = [*parameters.gyroscope.resolution, *parameters.accelerometer.resolution]
    np.testing.assert_allclose(_steps(readings), expected, rtol=1e-9)
    exact = ims.simulate(imu="perfect", trajectory="figure_eight", duration=20)
    assert not _steps(np.hstack([exact.gyro, exact.accel])).any()


def test_readings_without_a_truth_are_told():
    """Half of them were left out without a word, and 5 s of the others were not counted."""
    flight = ims.simulate(imu="mti3", trajectory="figure_eight", duration=30, rate=100, seed=1)
    true = flight.truth
    half = (column[:1501] for column in (true.t_ns, true.position, true.q_wb))
    truth = States(*half)
    twin = ims.twin(flight.readings, truth)
    content = twin.to_dict()
    assert (content["seconds"], content["readings_s"]) == pytest.approx((14.6, 29.99), abs=0.03)
    assert (
        f"the truth covers {content['seconds']:.4g} of 29.99 s of the readings" in twin.warnings[0]
    )
    whole = ims.twin(flight.readings, flight.truth)
    assert not any("the truth covers" in line for line in whole.warnings)


@pytest.mark.parametrize("triad", ["gyroscope", "accelerometer"])
@pytest.mark.parametrize("axis", [0, 2])
def test_an_inverted_axis_is_that_of_its_triad(triad, axis):
    """Whichever triad was inverted, the gyroscope was said not to be of the same flight."""
    flight = ims.simulate(imu="mpu6000", trajectory="excitation", duration=20, rate=100, seed=1)
    sign = np.where(np.arange(3) == axis, -1.0, 1.0)
    gyro = flight.gyro * (sign if triad == "gyroscope" else 1.0)
    accel = flight.accel * (sign if triad == "accelerometer" else 1.0)
    other_triad = "gyroscope" if triad == "accelerometer" else "accelerometer"
    with pytest.raises(
        InputError, match=f"the {triad} {'xyz'[axis]} is inverted against the {other_triad}"
    ):
        ims.twin(ims.Readings(flight.t_ns, gyro, accel), flight.truth)


def test_two_inverted_axes_are_told():
    flight = ims.simulate(imu="mpu6000", trajectory="excitation", duration=20, rate=100, seed=1)
    accel = flight.accel * [-1.0, -1.0, 1.0]
    with pytest.raises(InputError, match="axes of the accelerometer are turned by 1[78]. deg"):
        ims.twin(ims.Readings(flight.t_ns, flight.gyro, accel), flight.truth)
