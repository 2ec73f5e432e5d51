# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated sensor's noise in gtsam's terms, for ``gtsam_vio.py``.

gtsam models white noise and biases that walk. Scale, misalignment, g-sensitivity and 1/f noise
become faster walks: conservative, as one configures an estimator for a sensor that has errors which
it does not model. Needs gtsam (pip install gtsam).
"""

import gtsam
import numpy as np

from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.simulation.parameters import SimulationParameters

# Changes of angular rate and specific force in a second, twice the RMS of figure_eight:
RATE_CHANGE = 0.5  # rad/s
FORCE_CHANGE = 4.0  # m/s^2


def imu_noise(parameters: SimulationParameters) -> gtsam.PreintegrationCombinedParams:
    """Return the noise of a simulated sensor, conservative where gtsam does not model an error."""
    imu = parameters.imu
    noise = gtsam.PreintegrationCombinedParams(np.asarray(parameters.gravity))
    noise.setAccelerometerCovariance(np.diag(np.square(imu.accelerometer.noise_density)))
    noise.setGyroscopeCovariance(np.diag(np.square(imu.gyroscope.noise_density)))
    tiny = 1e-12 * np.eye(3)  # a covariance that gtsam inverts must not be zero
    accel, gyro = _slow_errors(imu, RATE_CHANGE, FORCE_CHANGE)
    noise.setBiasAccCovariance(np.diag(_walk(imu.accelerometer, accel)) + tiny)
    noise.setBiasOmegaCovariance(np.diag(_walk(imu.gyroscope, gyro)) + tiny)
    noise.setIntegrationCovariance(1e-10 * np.eye(3))
    pose = gtsam.Pose3(gtsam.Rot3(np.reshape(imu.mounting, (3, 3))), np.asarray(imu.lever_arm))
    noise.setBodyPSensor(pose)
    return noise


def _slow_errors(imu: ImuParameters, rate: float, force: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how large (3,) the errors are that gtsam does not know: accelerometer, gyroscope.

    An unknown scale or misalignment E turns the motion x into an error E x: a bias that is constant
    for as long as the motion is.

    :param rate: size of the angular rate [rad/s].
    :param force: size of the specific force [m/s^2].
    """
    accel = force * np.hypot(*_response_sigmas(imu.accelerometer))
    gyro = rate * np.hypot(*_response_sigmas(imu.gyroscope))
    return accel, np.hypot(gyro, force * np.array(imu.gyroscope.g_sensitivity_sigma))


def _response_sigmas(triad: TriadParameters) -> tuple[np.ndarray, np.ndarray]:
    return np.array(triad.turn_on_scale_sigma), np.array(triad.misalignment_sigma)


def _walk(triad: TriadParameters, change: np.ndarray) -> np.ndarray:
    """Return the density squared (3,) of a walk that is at least as large as all slow errors.

    :param change: of the errors that gtsam does not know, in a second.
    """
    # The Allan deviations of a walk K and of 1/f noise B, K sqrt(t / 3) and 0.664 B, meet at 1 s.
    flicker = 0.664 * np.sqrt(3.0) * np.array(triad.bias_instability)
    return np.square(triad.random_walk) + np.square(flicker) + np.square(change)


def _variance_of_mean(triad: TriadParameters, seconds: float) -> np.ndarray:
    """Return the variance (3,) of a mean over so many seconds as the bias at their end."""
    walk = np.square(triad.random_walk) * seconds / 3.0
    flicker = np.square(triad.bias_instability)
    return np.square(triad.noise_density) / seconds + walk + flicker


def bias_sigma(parameters: SimulationParameters) -> np.ndarray:
    """Return how well the biases (6,) are known at the start: accelerometer, gyroscope."""
    imu = parameters.imu
    turn_on = (imu.accelerometer.turn_on_bias_sigma, imu.gyroscope.turn_on_bias_sigma)
    slow_errors = _slow_errors(imu, RATE_CHANGE, float(np.linalg.norm(parameters.gravity)))
    return np.maximum(np.hypot(np.concatenate(turn_on), np.concatenate(slow_errors)), 1e-6)


def biases_of_rest(
    parameters: SimulationParameters, r_wb: np.ndarray, readings: np.ndarray, tilt: float
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return the biases that a rest in a known attitude shows, and how well (6,) they are known.

    :param readings: (n, 6) gyroscope, accelerometer.
    :param tilt: uncertainty of the attitude [rad].
    :returns: (accelerometer, gyroscope), and the standard deviations of both.
    """
    imu, mean = parameters.imu, readings.mean(axis=0)
    r_wi = r_wb @ np.reshape(imu.mounting, (3, 3))
    force = -r_wi.T @ np.asarray(parameters.gravity)
    seconds = len(readings) / parameters.rate
    accel = (tilt * np.linalg.norm(force)) ** 2 + _variance_of_mean(imu.accelerometer, seconds)
    gyro = 1e-12 + _variance_of_mean(imu.gyroscope, seconds)
    return (mean[3:] - force, mean[:3]), np.sqrt(np.concatenate([accel, gyro]))
