# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The covariance of the pose that wheels add up to: closed forms, and errors of many seeds."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import imu_sim_ros as ims
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.wheels.uncertainty import even_normals
from imu_sim_ros.simulation.engine import Body
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


def on_a_line(**overrides: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return how far a vehicle is, and the covariance of its pose."""
    wheels = ims.simulate(
        **LINE, wheels={**NOTHING, "radius": 0.1, "track": TRACK, **overrides}
    ).wheels
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


def test_steering_noise_on_a_circle_turns_the_remaining_way() -> None:
    """Each interval's steering error turns the rest of the path about the place of the interval.

    With ``slope = v (1 + tan^2 d) / L`` its yaw error is ``s slope dt``; the position at the end
    moves by that angle times the vector from the middle of the interval to the end, turned by 90
    degrees; at 100 Hz the middle of the chord is on the arc to 2e-5 m.
    """
    speed, rate, base, sigma, dt = 2.5, 0.5, 2.0, 1e-4, 0.02
    settings = {**LINE, "trajectory": "circle", "duration": 4}
    wheels = {**NOTHING, "model": "ackermann", "wheelbase": base, "steering_noise": sigma}
    odometry = ims.simulate(**settings, wheels={**wheels, "rate": 50}).wheels
    slope = speed * (1.0 + (rate * base / speed) ** 2) / base
    count = len(odometry.t_ns) - 1
    # On a circle of 5 m: places of the ends and middles of intervals in the frame of odometry.
    angle = rate * dt * np.arange(count + 1)
    path = speed / rate * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    rest = path[-1] - 0.5 * (path[1:] + path[:-1])
    moves = np.column_stack([-rest[:, 1], rest[:, 0], np.ones(count)]) * sigma * slope * dt
    expected = moves.T @ moves
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose((odometry.pose_covariance[-1] - expected) / scale, 0.0, atol=5e-3)
    # The twist: forward speed is known, the yaw rate is uncertain by the slope.
    twist = odometry.covariance[-1][2, 2]
    assert twist == pytest.approx((sigma * slope) ** 2, rel=1e-3)


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


@pytest.mark.parametrize("name", files.names("wheels"))
def test_the_stated_covariance_of_every_preset_is_that_of_its_errors(name: str) -> None:
    """NEES of 60 seeds on `yard`, while the heading is known, and of the heading alone at the end.

    Their sums are chi-square with 180 and 60 degrees of freedom; the band leaves out 1e-4 on each
    side, 1.96 to 4.32 and 0.46 to 1.83 for the means: twice or half the variance is outside.
    """
    values = {
        "sensors": ["wheels"], "imu.preset": "perfect", "trajectory.type": "yard", "rate": 50.0,
        "duration": 30.0, "wheels.preset": name,
    }  # fmt: skip
    run = Body(load_simulation(values), sensors={"wheels"})
    errors, stated = [], []
    for seed in range(60):
        odometry = run.with_seed(seed).next(10**6)["wheels"]
        q = odometry.true_pose[:, 3:]
        yaw = np.unwrap(2.0 * np.arctan2(q[:, 3], q[:, 0]))
        errors.append(odometry.pose - np.column_stack([odometry.true_pose[:, :2], yaw]))
        stated.append(odometry.pose_covariance)
    error, covariance = np.stack(errors, axis=1), np.stack(stated, axis=1)
    heading_known = (covariance[:, :, 0, 0] < 1e6).all(axis=1)
    moved = np.sqrt(covariance[:, :, 2, 2].mean(axis=1)) > 0.03
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], 180)
    for k in np.flatnonzero(heading_known & moved)[:: len(error) // 10]:
        nees = np.einsum(
            "si,si->", error[k], np.linalg.solve(covariance[k], error[k][..., None])[..., 0]
        )
        assert low < nees < high, (k, nees / 60)
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], 60)
    assert low < (error[-1, :, 2] ** 2 / covariance[-1, :, 2, 2]).sum() < high
    # Where the heading is lost the place is unknown, and says so to whoever inverts it.
    lost = covariance[covariance[:, :, 2, 2] > 0.3**2]
    assert (lost[:, 0, 0] == 1e6).all()
    assert (lost[:, 1, 1] == 1e6).all()
    assert heading_known.all() == (name in ("husky_a200", "rosbot_xl"))


def test_vehicles_have_the_moments_of_a_standard_normal() -> None:
    """Mean, covariance and skewness by construction; the fourth moment, 3, to 25 %."""
    drawn = even_normals(64, 5)
    np.testing.assert_allclose(drawn.mean(axis=1), 0.0, atol=1e-15)
    np.testing.assert_allclose(drawn @ drawn.T / 128, np.eye(5), atol=1e-12)
    np.testing.assert_allclose((drawn**4).mean(axis=1), 3.0, rtol=0.25)
