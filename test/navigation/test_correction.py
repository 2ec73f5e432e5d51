# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.navigation.initialisation import level
from imu_sim_ros.navigation.parameters import load_integrator
from imu_sim_ros.navigation.state import NO_CORRECTION, Correction, correction_of


def test_correction_solves_the_model_of_the_sensor():
    """omega_m = S_g omega + G f + b_g, f_m = S_a f + b_a."""
    rng = np.random.default_rng(3)
    omega, f = rng.normal(size=(2, 20, 3))
    s_g, s_a = np.eye(3) + 0.1 * rng.normal(size=(2, 3, 3))
    g = 0.01 * rng.normal(size=(3, 3))
    b_g, b_a = rng.normal(size=(2, 3))
    correction = Correction(
        tuple(b_g), tuple(b_a), tuple(s_g.ravel()), tuple(s_a.ravel()), tuple(g.ravel())
    )
    errors = correction.apply(omega @ s_g.T + f @ g.T + b_g, f @ s_a.T + b_a)
    np.testing.assert_allclose(errors, (omega, f), atol=1e-13)


def test_nothing_to_correct_changes_nothing():
    gyro, accel = np.ones((2, 4, 3))
    assert NO_CORRECTION.apply(gyro, accel)[0] is gyro


def test_a_calibration_file_becomes_a_correction(tmp_path):
    path = tmp_path / "calibration.yaml"
    path.write_text(
        "/**:\n  ros__parameters:\n    imu:\n      gyroscope_bias: [0.1, 0.2, 0.3]\n"
        "      accelerometer_scale_misalignment: [2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
    )
    correction = correction_of(load_integrator({"calibration": str(path)}))
    assert correction.gyroscope_bias == (0.1, 0.2, 0.3)
    assert correction.accelerometer_inverse[0] == 0.5


@pytest.mark.parametrize("gravity", [-9.81, 9.81])
def test_levelling_finds_roll_pitch_and_bias(gravity):
    rng = np.random.default_rng(4)
    q_wb = rotation.from_euler([0.3, -0.4, 1.2])
    force = rotation.rotate_inverse(q_wb, [0.0, 0.0, -gravity])
    noise = 0.02 * rng.normal(size=(4000, 3))
    errors = level(
        noise + np.array([0.01, 0.02, -0.03]), noise + force, (0.0, 0.0, gravity), yaw=1.2
    )
    turn = rotation.log(rotation.multiply(rotation.conjugate(q_wb), errors.q_wb))
    # sigma of the mean is 0.02 / sqrt(4000) = 3.2e-4: 4 sigma, over g for the tilt.
    assert np.abs(turn).max() < 1.3e-3 / 9.81
    np.testing.assert_allclose(errors.gyroscope_bias, [0.01, 0.02, -0.03], atol=1.3e-3)


def test_no_rest_no_level():
    with pytest.raises(
        InputError, match=r"force is 12 m/s\^2 and gravity 9.81 m/s\^2: .*not at rest"
    ):
        level(np.zeros((9, 3)), np.tile([0.0, 0.0, 12.0], (9, 1)), (0.0, 0.0, -9.81))
    with pytest.raises(InputError, match="it must be along z"):
        level(np.zeros((9, 3)), np.tile([0.0, 0.0, 9.81], (9, 1)), (1.0, 0.0, -9.81))
    with pytest.raises(InputError, match="no readings"):
        level(np.zeros((0, 3)), np.zeros((0, 3)), (0.0, 0.0, -9.81))


def test_level_takes_a_sensor_as_it_is():
    """10.4 m/s^2 at rest is 6 % off: refused of a good accelerometer, 3 sigma of a cheap one."""
    still = np.zeros((9, 3)), np.tile([0.0, 0.0, 10.4], (9, 1)), (0.0, 0.0, -9.81)
    with pytest.raises(InputError, match="not at rest"):
        level(*still)
    assert level(*still, uncertainty=0.2).q_wb[0] == 1.0
