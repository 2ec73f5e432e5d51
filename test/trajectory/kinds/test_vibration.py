# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.simulation.parameters import load_simulation

RATE = 400.0  # Hz; lines are below 80 Hz, the fourth powers of their sums below 320 Hz


def shaken(build, seconds=200.0, **values):
    parameters = {f"vibration__{name}": value for name, value in values.items()}
    return build(type="static", **parameters).sample(np.arange(0.0, seconds, 1 / RATE))


def test_noise_has_its_rms_on_each_axis(build):
    """The mean square of 32 lines of equal power over 200 s is right within 1 %.

    Over T seconds two neighbouring lines that are d apart leave a relative error of about
    1 / (2 pi d T) each; d is 60 / 32 Hz.
    """
    rms = [0.5, 1.0, 2.0]
    m = shaken(build, noise_rms=rms)
    actual = np.sqrt(np.mean(m.acceleration**2, axis=0))
    np.testing.assert_allclose(actual, rms, rtol=0.01)


def test_noise_stays_in_its_band_and_fills_it(build):
    m = shaken(build, noise_rms=1.0, noise_low=20.0, noise_high=80.0)
    x = m.acceleration[:, 0] * np.hanning(len(m.acceleration))
    power = np.abs(np.fft.rfft(x)) ** 2
    frequency = np.fft.rfftfreq(len(x), 1 / RATE)
    band = (frequency > 19.9) & (frequency < 80.1)
    assert power[~band].sum() < 1e-6 * power.sum()
    shares = [
        power[(frequency >= low) & (frequency < low + 15)].sum() / power.sum()
        for low in (20, 35, 50, 65)
    ]
    np.testing.assert_allclose(shares, 0.25, rtol=0.02)  # eight of 32 lines each


def test_noise_is_nearly_gaussian_and_its_axes_are_independent(build):
    a = shaken(build, noise_rms=1.0).acceleration
    # The kurtosis of n sinusoids of equal power is 3 - 3 / (2 n).
    kurtosis = np.mean(a**4, axis=0) / np.mean(a**2, axis=0) ** 2
    np.testing.assert_allclose(kurtosis, 3 - 1.5 / 32, atol=0.15)
    assert np.max(np.abs(np.corrcoef(a.T) - np.eye(3))) < 0.02


def test_the_seed_decides(build):
    seed_1, again, seed_2 = (
        shaken(build, 1.0, noise_rms=1.0, seed=seed).acceleration for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(seed_1, again)
    assert np.max(np.abs(seed_1 - seed_2)) > 0.1


def test_sinusoids_are_exact(build):
    t = np.arange(0.0, 1.0, 1 / RATE)
    m = shaken(
        build, 1.0, frequency=[50.0, 120.0], phase=[0.3, 0.0],
        acceleration=[1.0, 0.0, 0.0, 0.0, 2.0, 3.0],
    )  # fmt: skip
    w, u = 100 * np.pi, 240 * np.pi
    np.testing.assert_allclose(m.acceleration[:, 0], np.sin(w * t + 0.3), atol=1e-11)
    np.testing.assert_allclose(m.acceleration[:, 2], 3 * np.sin(u * t), atol=1e-11)
    np.testing.assert_allclose(m.velocity[:, 0], -np.cos(w * t + 0.3) / w, atol=1e-13)
    np.testing.assert_allclose(m.position[:, 1], -2 * np.sin(u * t) / u**2, atol=1e-15)


def test_it_shakes_along_the_body_s_axes(build):
    """On its side the body shakes along the world's z when it shakes along its own y."""
    trajectory = build(
        type="static", roll_pitch_yaw=[np.pi / 2, 0.0, 0.0],
        vibration__frequency=[5.0], vibration__acceleration=[0.0, 1.0, 0.0],
    )  # fmt: skip
    a = trajectory.sample(np.array([0.05])).acceleration
    np.testing.assert_allclose(a, [[0.0, 0.0, 1.0]], rtol=0, atol=1e-15)


def test_a_turning_body_feels_what_a_displaced_mass_feels(build):
    """Spin w about z, displacement d(t) along x: a_b = (d'' - w^2 d, 2 w d', 0)."""
    t = np.linspace(0.0, 2.0, 401)
    m = build(
        type="spin", vibration__frequency=[2.0], vibration__acceleration=[1.0, 0.0, 0.0]
    ).sample(t)
    w = 4 * np.pi
    d, d_dot = -np.sin(w * t) / w**2, -np.cos(w * t) / w
    in_body = rotation.rotate_inverse(m.q_wb, m.acceleration)
    np.testing.assert_allclose(in_body[:, 0], np.sin(w * t) - d, rtol=0, atol=1e-12)
    np.testing.assert_allclose(in_body[:, 1], 2 * d_dot, rtol=0, atol=1e-12)


@pytest.mark.parametrize("size", [0.05, 30.0])
def test_turning_has_exact_derivatives(build, assert_exact_derivatives, size):
    """Small turns, and turns of a radian, where the series are left for the closed forms."""
    trajectory = build(
        type="lecture", vibration__frequency=[3.0, 7.0],
        vibration__acceleration=[1.0, 0.0, 2.0, 0.0, 1.0, 0.0],
        vibration__angular_rate=[size, 0.0, 0.5 * size, 0.0, size, 0.2 * size],
        vibration__angular_phase=[0.4, 0.0],
    )  # fmt: skip
    assert_exact_derivatives(trajectory, np.linspace(0.5, 2.0, 61), tolerance=3e-8)


def test_turning_at_rest_is_the_given_rate(build):
    """About one axis the rate is the sum of the lines, and the angle its integral."""
    t = np.arange(0.0, 1.0, 1 / RATE)
    m = shaken(build, 1.0, frequency=[50.0], angular_rate=[0.0, 2.0, 0.0])
    w = 100 * np.pi
    np.testing.assert_allclose(m.angular_velocity[:, 1], 2 * np.sin(w * t), atol=1e-13)
    np.testing.assert_allclose(m.angular_acceleration[:, 1], 2 * w * np.cos(w * t), atol=1e-10)
    np.testing.assert_allclose(rotation.log(m.q_wb)[:, 1], -2 / w * np.cos(w * t), atol=1e-15)
    assert not m.position.any()


def test_turning_noise_has_its_rms_and_leaves_the_shaking_as_it_was(build):
    both = shaken(build, noise_rms=1.0, angular_noise_rms=[0.1, 0.2, 0.3])
    actual = np.sqrt(np.mean(both.angular_velocity**2, axis=0))
    np.testing.assert_allclose(actual, [0.1, 0.2, 0.3], rtol=0.01)
    alone = shaken(build, noise_rms=1.0)
    np.testing.assert_array_equal(both.acceleration, alone.acceleration)


def test_bad_vibration_is_reported_together():
    with pytest.raises(ConfigurationError) as caught:
        load_simulation(
            {
                "trajectory.vibration.frequency": [10.0],
                "trajectory.vibration.phase": [0.0, 1.0],
                "trajectory.vibration.noise_low": 90.0,
                "trajectory.vibration.angular_phase": [0.0, 1.0],
            }
        )
    text = str(caught.value)
    for name in ("vibration.acceleration = []", "vibration.phase", "vibration.noise_high = 80"):
        assert name in text
    assert len(caught.value.problems) == 4
    with pytest.raises(ConfigurationError, match="angular_rate = .* three entries for each of"):
        load_simulation(
            {
                "trajectory.vibration.frequency": [10.0, 20.0],
                "trajectory.vibration.angular_rate": [1.0, 0.0, 0.0],
            }
        )
