# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The covariance of the pose that wheels add up to: closed forms, and errors of many seeds."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import imu_sim_ros as ims
from imu_sim_ros.simulation.engine import Simulation
from imu_sim_ros.simulation.parameters import load_simulation

LINE: dict[str, Any] = {
    "imu": "perfect",
    "trajectory": {"type": "harmonic", "x": {"polynomial": [0.0, 2.0]}},
    "duration": 10,
    "rate": 100,
    "sensors": ["wheels"],
}
NOTHING: dict[str, Any] = {"encoder_noise": 0.0, "slip_noise": 0.0, "ticks": 0}
TRACK = 0.5


def on_a_line(**own: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return how far a vehicle is, and the covariance of its pose."""
    wheels = ims.simulate(**LINE, wheels={**NOTHING, "radius": 0.1, "track": TRACK, **own}).wheels
    return wheels.ideal_twist[:, 0].cumsum() * 0.02 - 0.04, wheels.pose_covariance


def test_random_slip_on_a_line() -> None:
    """Both wheels' ways have the variance s^2 D; heading from their difference over the track.

    ``x: s^2 D / 2, yaw: 2 s^2 D / b^2``, and y is the integral of the heading over the way:
    ``D^3 / 3`` and with yaw ``D^2 / 2`` times its rate. The sum over n steps is off the integral by
    1 / (4 n^2). The heading as read turns the long side of this ellipse by 4e-6, which is 1e-4 of
    its short side.
    """
    s = 1e-7
    way, covariance = on_a_line(slip_noise=s)
    d, rate = way[-1], 2.0 * s**2 / TRACK**2
    expected = np.array(
        [
            [s**2 * d / 2, 0.0, 0.0],
            [0.0, rate * d**3 / 3, rate * d**2 / 2],
            [0.0, rate * d**2 / 2, rate * d],
        ]
    )
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose((covariance[-1] - expected) / scale, 0.0, atol=1e-3)
    assert np.array_equal(covariance[0], np.zeros((3, 3)))


def test_errors_of_angles_do_not_add_up() -> None:
    """Two angles, the first and the last, in x and yaw: ``r^2 s^2`` and ``4 r^2 s^2 / b^2``.

    y is the sum of the headings, whose errors are those of each angle minus the first one's:
    ``4 r^2 s^2 / b^2 (D^2 + D dx)`` but for terms of dx^2 over D^2, 4e-6.
    """
    s = 1e-3
    way, covariance = on_a_line(encoder_noise=s)
    yaw = 4.0 * (0.1 * s / TRACK) ** 2
    np.testing.assert_allclose(covariance[1:, 0, 0], (0.1 * s) ** 2, rtol=1e-3)
    np.testing.assert_allclose(covariance[1:, 2, 2], yaw, rtol=1e-9)
    d = way[-1]
    assert covariance[-1, 1, 1] == pytest.approx(0.5 * yaw * (d**2 + d * 0.04), rel=5e-3)


def test_radii_last() -> None:
    """A share g of each radius: ``x = g D / sqrt(2)``, yaw = sqrt(2) g D / b, y = yaw D / 2."""
    way, covariance = on_a_line(radius_sigma_percent=1e-6)
    g = 1e-8
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))[1:]
    d = way[1:]
    expected = np.column_stack(
        [g * d / np.sqrt(2), g * d**2 / np.sqrt(2) / TRACK, np.sqrt(2) * g * d / TRACK]
    )
    np.testing.assert_allclose(deviation, expected, rtol=1e-6)


@pytest.mark.parametrize("model", ["differential", "ackermann", "omnidirectional"])
def test_the_stated_covariance_is_that_of_the_pose_errors(model: str) -> None:
    """NEES of the last pose of each of 300 seeds, after 40 m in curves, with all known errors.

    Their sum is chi-square with 900 degrees of freedom; the band leaves out 1e-4 on each side.
    Headings are off by 0.02, whose squares, left out, move the end by a tenth of its deviation.
    """
    own = {
        "model": model, "radius_sigma_percent": 0.05, "base_sigma_percent": 0.1, "ticks": 500,
        "steering_offset_sigma": 5e-4, "slip_noise": 0.002, "radius": 0.3, "track": 2.0,
        "wheelbase": 2.0, "steering_noise": 0.001,
    }  # fmt: skip
    values = {
        "sensors": ["wheels"], "imu.preset": "perfect", "trajectory.type": "drive",
        "trajectory.positions": [0.0, 0.0, 20.0, 0.0, 20.0, 20.0], "rate": 50.0,
        **{f"wheels.{k}": v for k, v in own.items()},
    }  # fmt: skip
    run = Simulation(load_simulation(values), sensors={"wheels"})
    total = 0.0
    for seed in range(300):
        read = run.with_seed(seed).next_block(10**6).auxiliary["wheels"]
        q = read.true_pose[-1, 3:]
        yaw = 2.0 * np.arctan2(q[3], q[0])
        error = read.pose[-1] - np.array([*read.true_pose[-1, :2], yaw])
        error[2] = (error[2] + np.pi) % (2.0 * np.pi) - np.pi
        total += error @ np.linalg.solve(read.pose_covariance[-1], error)
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], 900)
    assert low < total < high, total / 300
