# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The orientation that a board states beside its readings: ``imu/data`` (REP-145).

That of the IMU's frame in the world, ENU: ``q_wi = q_wb q_bi``; its errors are about the world's
axes, as the covariance of the message is.
"""

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation, timebase
from imu_sim_ros.config import EnvironmentParameters, ImuParameters
from imu_sim_ros.rotation import components
from imu_sim_ros.sensor.auxiliary.magnetic_field import MagneticField
from imu_sim_ros.sensor.auxiliary.magnetometer import Magnetometer
from imu_sim_ros.sensor.auxiliary.orientation_filter import OrientationFilter
from imu_sim_ros.sensor.auxiliary.orientation_model import OrientationModel
from imu_sim_ros.sensor.block import ImuBlock, MagneticBlock, OrientationBlock
from imu_sim_ros.sensor.realised import realised_imu

Array = NDArray[np.float64]


class ModelledOrientation:
    """The truth with errors of known covariance."""

    def __init__(self, imu: ImuParameters, environment: EnvironmentParameters) -> None:
        self._model = OrientationModel(imu.orientation, environment.seed, 1.0 / environment.rate)

    def next(
        self, block: ImuBlock, magnetic: MagneticBlock | None, q_wi: Array
    ) -> tuple[Array, Array]:
        """Return orientations (4, n) and the variances of their errors (3, n) [rad^2]."""
        return self._model.next(q_wi, block.motion.acceleration.T)


class FilteredOrientation:
    """A filter over the board's readings, corrected by a calibration or as they are."""

    def __init__(
        self, imu: ImuParameters, environment: EnvironmentParameters, magnetometer: Magnetometer
    ) -> None:
        p = imu.orientation
        self._magnetometer = magnetometer
        self._filter = OrientationFilter(
            p.time_constant,
            1.0 / environment.rate,
            1.0 / imu.magnetometer.rate,
            MagneticField(environment).earth_w,
        )
        self._variance = np.square(p.stated_sigma)[:, None]
        unit = realised_imu(imu, environment.seed)
        self._corrections = [_Correction(np.eye(3), np.zeros(3))] * 3
        if p.calibrated:
            self._corrections = [
                _Correction(unit.gyroscope.response(), np.array(unit.gyroscope.bias)),
                _Correction(unit.accelerometer.response(), np.array(unit.accelerometer.bias)),
                _Correction(*unit.magnetometer.response_and_bias()),
            ]

    def next(
        self, block: ImuBlock, magnetic: MagneticBlock | None, q_wi: Array
    ) -> tuple[Array, Array]:
        """Return orientations (4, n) and the stated variances (3, n) [rad^2]."""
        assert magnetic is not None
        n = len(block.true_t_ns)
        index, together = self._magnetometer.imu_samples()
        behind = index - block.first
        since = magnetic.true_t_ns - block.true_t_ns[behind] if n else np.empty(0)
        delay: Array = since.astype(np.float64) * 1e-9
        readings = (block.gyro.T, block.accel.T, magnetic.field.T)
        gyro, accel, field = (
            correction.apply(reading)
            for correction, reading in zip(self._corrections, readings, strict=True)
        )
        q = self._filter.next(gyro, accel, field, behind, delay, behind + ~together)
        return q, np.broadcast_to(self._variance, (3, n))


class _Correction:
    """``S^-1 (reading - b)``."""

    def __init__(self, response: Array, bias: Array) -> None:
        self._inverse = np.linalg.inv(response).astype(np.float64)
        self._bias = bias[:, None]

    def apply(self, reading: Array) -> Array:
        return components.transform(self._inverse, reading - self._bias)


class Orientation:
    """Orientations at the IMU's samples, or at every m-th of them."""

    def __init__(
        self,
        imu: ImuParameters,
        environment: EnvironmentParameters,
        magnetometer: Magnetometer | None,
    ) -> None:
        """Set up the model or the filter.

        :param magnetometer: of the board; the filter needs it.
        """
        rate = imu.orientation.rate
        ratio = timebase.exact_rate(environment.rate) / timebase.exact_rate(rate) if rate else 1
        self._every = int(ratio)
        mounting = np.reshape(imu.mounting, (3, 3))
        self._q_bi = rotation.from_matrix(mounting)[:, None]
        self._source: ModelledOrientation | FilteredOrientation
        if magnetometer is None:
            self._source = ModelledOrientation(imu, environment)
        else:
            self._source = FilteredOrientation(imu, environment, magnetometer)

    def read(self, block: ImuBlock, magnetic: MagneticBlock | None) -> OrientationBlock:
        """Return the orientations beside a block of the IMU.

        :param magnetic: what the magnetometer read in the block's window of time.
        """
        q_wb = np.ascontiguousarray(block.motion.q_wb.T)
        truth = components.multiply(q_wb, self._q_bi)
        q, variance = self._source.next(block, magnetic, truth)
        rows = np.flatnonzero((block.first + np.arange(len(block.true_t_ns))) % self._every == 0)
        delivered = block.delivered[(block.first + block.delivered) % self._every == 0]
        return OrientationBlock(
            block.true_t_ns[rows],
            block.t_ns[rows],
            block.release_t_ns[rows],
            np.searchsorted(rows, delivered),
            q.T[rows],
            variance.T[rows],
            truth.T[rows],
            rows,
        )
