# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The orientation that an IMU states with its readings: ``imu/data`` (REP-145)."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation, timebase
from imu_sim_ros.core.random_streams import Streams
from imu_sim_ros.core.types import Array
from imu_sim_ros.sensors.declaration import Model, Mounted
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.processes import GaussMarkovBank
from imu_sim_ros.sensors.errors.realised import realise_imu
from imu_sim_ros.sensors.imu.model import Imu
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.magnetometer.model import Magnetometer
from imu_sim_ros.sensors.model import FixedModel
from imu_sim_ros.sensors.orientation.filter import OrientationFilter
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import Window, World

EXACT: Final = 1e-12
"""Stated variance of an exact orientation [rad^2]: 0 would mean that it is unknown."""


class ModelledOrientation:
    """The truth with errors of known covariance.

    ``q = exp(e) q_wi`` with a normal error e about the world's axes.
    ``e = e_on + drift + noise + k |a| u``: constant, first-order Gauss-Markov, white, and, with a
    Gauss-Markov u of unit variance, an error that grows with the acceleration a of the body, like
    that of a filter that takes the specific force for the vertical. Its covariance, diagonal about
    the world's axes, is exact: ``turn_on^2 + drift^2 + noise^2 + (k |a|)^2``. If all of it is 0,
    ``EXACT`` is stated.
    """

    def __init__(self, imu: ImuParameters, environment: EnvironmentParameters) -> None:
        """Draw the constant error and the initial states."""
        p, seed, dt = imu.orientation, environment.seed, 1.0 / environment.rate
        self._constant = Streams(seed, "orientation.turn_on").next(1)[0] * p.turn_on_sigma
        self._constant_variance = np.square(p.turn_on_sigma)
        self._noise = np.array(p.noise)
        self._streams = Streams(seed, "orientation.noise")
        self._drift_sigma = np.array(p.drift_sigma)
        self._drift = GaussMarkovBank(seed, "orientation.drift", p.drift_time, dt)
        self._per_acceleration = np.array(p.acceleration_sensitivity)
        self._dynamic = GaussMarkovBank(seed, "orientation.acceleration", p.acceleration_time, dt)

    def next(self, block: Samples, q_wi: Array) -> tuple[Array, Array]:
        """Return orientations (n, 4) and the variances of their errors (n, 3) [rad^2].

        :param q_wi: (n, 4) true orientations.
        """
        n = len(q_wi)
        error, variance = (np.empty((n, 3), order="F") for _ in range(2))
        error[:] = self._constant
        variance[:] = self._constant_variance
        if self._drift_sigma.any():
            error += self._drift_sigma * self._drift.next_block(n)
            variance += self._drift_sigma**2
        if self._noise.any():
            error += self._noise * self._streams.next(n)
            variance += self._noise**2
        if self._per_acceleration.any():
            x, y, z = block.motion.acceleration.T
            sigma = self._per_acceleration * np.sqrt(x * x + y * y + z * z)[:, None]
            error += sigma * self._dynamic.next_block(n)
            variance += sigma * sigma
        variance[np.all(variance == 0.0, axis=1)] = EXACT
        return rotation.multiply(rotation.exp(error), q_wi), variance


class FilteredOrientation:
    """Filter over the IMU's readings, calibrated or not."""

    def __init__(
        self, imu: ImuParameters, environment: EnvironmentParameters, field: Magnetometer
    ) -> None:
        """Initialise the filter at its start.

        :param field: magnetometer whose readings give the heading.
        """
        p = imu.orientation
        self._field = field
        self._filter = OrientationFilter(
            p.time_constant, 1.0 / environment.rate, 1.0 / imu.magnetometer.rate, field.earth_w
        )
        self._variance = np.square(p.stated_sigma)
        self._last_ns = np.empty(0, np.int64)
        unit = realise_imu(imu, environment.seed)
        self._corrections = [_Correction(np.eye(3), np.zeros(3))] * 3
        if p.calibrated:
            self._corrections = [
                _Correction(unit.gyroscope.response(), np.array(unit.gyroscope.bias)),
                _Correction(unit.accelerometer.response(), np.array(unit.accelerometer.bias)),
                _Correction(*unit.magnetometer.response_and_bias()),
            ]

    def next(self, block: Samples, q_wi: Array) -> tuple[Array, Array]:
        """Return orientations (n, 4) and the stated variances (n, 3) [rad^2]."""
        magnetic = self._field.latest
        n = len(block.true_t_ns)
        t_ns = np.concatenate([self._last_ns, block.true_t_ns])
        self._last_ns = t_ns[-1:]
        behind = np.searchsorted(block.true_t_ns, magnetic.true_t_ns, side="right") - 1
        since = magnetic.true_t_ns - t_ns[behind + len(t_ns) - n]
        delay: Array = since.astype(np.float64) * 1e-9
        readings = (block.gyro, block.accel, magnetic.field)
        gyro, accel, field = (
            correction.apply(reading)
            for correction, reading in zip(self._corrections, readings, strict=True)
        )
        q = self._filter.next(gyro, accel, field, behind, delay, behind + (since > 0))
        return q, np.broadcast_to(self._variance, (n, 3))


class _Correction:
    """``S^-1 (reading - b)``."""

    def __init__(self, response: Array, bias: Array) -> None:
        self._inverse = np.linalg.inv(response).astype(np.float64)
        self._bias = bias

    def apply(self, reading: Array) -> Array:
        """Return a reading without bias, scale and misalignment."""
        return rotation.transform(self._inverse, reading - self._bias)


class Orientation(FixedModel):
    """Orientations at the IMU's samples, or at every m-th of them."""

    def __init__(
        self, mounted: Mounted[ImuParameters], _: int, models: Mapping[str, Model]
    ) -> None:
        """Set up the model or the filter.

        :param models: the IMU, and for the filter its magnetometer; they are read
                before this sensor.
        """
        imu, environment, rate = (
            mounted.parameters,
            mounted.environment,
            mounted.parameters.orientation.rate,
        )
        ratio = timebase.exact_rate(environment.rate) / timebase.exact_rate(rate) if rate else 1
        imu_model = models["imu"]
        assert isinstance(imu_model, Imu)
        self._every, self._imu = int(ratio), imu_model
        self._q_bi = rotation.from_matrix(np.reshape(imu.mounting, (3, 3)))
        self._source: ModelledOrientation | FilteredOrientation
        if imu.orientation.source == "filter":
            field = models["magnetic_field"]
            assert isinstance(field, Magnetometer)
            self._source = FilteredOrientation(imu, environment, field)
        else:
            self._source = ModelledOrientation(imu, environment)

    def read(self, window: Window, world: World) -> Samples:
        """Return the orientations of the last samples of the IMU and of the magnetometer."""
        block = self._imu.latest
        truth = rotation.multiply(block.motion.q_wb, self._q_bi)
        q, variance = self._source.next(block, truth)
        rows = np.flatnonzero((block.first + np.arange(len(block.true_t_ns))) % self._every == 0)
        delivered = block.delivered[(block.first + block.delivered) % self._every == 0]
        return Samples(
            true_t_ns=block.true_t_ns[rows],
            t_ns=block.t_ns[rows],
            release_t_ns=block.release_t_ns[rows],
            delivered=np.searchsorted(rows, delivered),
            values={
                "q_wi": q[rows],
                "variance": variance[rows],
                "ideal_q_wi": truth[rows],
                "gyro": block.gyro[rows],
                "accel": block.accel[rows],
            },
        )
