# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An orientation as the truth and an error of known covariance."""

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config.auxiliary import OrientationParameters
from imu_sim_ros.random_streams import axis_generators
from imu_sim_ros.rotation import components
from imu_sim_ros.sensor.errors import GaussMarkovBank

Array = NDArray[np.float64]


class OrientationModel:
    """``q = exp(e) q_wi`` with a normal error e about the world's axes.

    ``e = e_on + drift + noise + k |a| u``: constant, first-order Gauss-Markov, white, and, with a
    Gauss-Markov u of unit variance, an error that grows with the acceleration a of the body, like
    that of a filter that takes the specific force for the vertical. Its covariance, diagonal about
    the world's axes, is exact: ``turn_on^2 + drift^2 + noise^2 + (k |a|)^2``.
    """

    def __init__(self, parameters: OrientationParameters, seed: int, dt: float) -> None:
        """Draw the constant error and the initial states.

        :param dt: time between two samples [s].
        """
        p = parameters
        turn_on = [s.standard_normal() for s in axis_generators(seed, "orientation.turn_on")]
        self._constant = (np.array(turn_on) * p.turn_on_sigma)[:, None]
        self._constant_variance = np.square(p.turn_on_sigma)[:, None]
        self._noise = np.array(p.noise)[:, None]
        self._streams = axis_generators(seed, "orientation.noise")
        self._drift_sigma = np.array(p.drift_sigma)[:, None]
        self._drift = GaussMarkovBank(
            axis_generators(seed, "orientation.drift"), np.full((3, 1), p.drift_time), dt
        )
        self._per_acceleration = np.array(p.acceleration_sensitivity)[:, None]
        self._dynamic = GaussMarkovBank(
            axis_generators(seed, "orientation.acceleration"),
            np.full((3, 1), p.acceleration_time),
            dt,
        )

    def next(self, q_wi: Array, acceleration: Array) -> tuple[Array, Array]:
        """Return the orientations (4, n) and the variances of their errors (3, n) [rad^2].

        :param q_wi: (4, n) true ones of the next n samples.
        :param acceleration: (3, n) of the body [m/s^2].
        """
        n = q_wi.shape[1]
        error = np.repeat(self._constant, n, axis=1)
        variance = np.repeat(np.zeros((3, 1)), n, axis=1)
        variance += self._constant_variance
        if self._drift_sigma.any():
            error += self._drift_sigma * self._drift.next_block(n)
            variance += self._drift_sigma**2
        if self._noise.any():
            numbers = np.stack([stream.standard_normal(n) for stream in self._streams])
            error += self._noise * numbers
            variance += self._noise**2
        if self._per_acceleration.any():
            x, y, z = acceleration
            sigma = self._per_acceleration * np.sqrt(x * x + y * y + z * z)
            error += sigma * self._dynamic.next_block(n)
            variance += sigma * sigma
        return components.multiply(components.exp(error), q_wi), variance
