# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blocks of samples: what an IMU and the sensors with it report, and the truth of it."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.trajectory.motion import Motion
from imu_sim_ros.types import Array, Times, shapes


class ImuBlock(NamedTuple):
    """n consecutive samples of one IMU; all arrays but ``delivered`` have n rows.

    A reading is the digital output (rounding and saturation) of the sum ``ideal + response_error +
    bias + noise + low_pass + vibration``, for each triad.
    """

    first: int
    """Index of the first sample."""
    true_t_ns: Times
    """(n,) true times of the samples [ns]."""
    t_ns: Times
    """(n,) the stamps of the messages, with the errors of the sensor's clock [ns]."""
    release_t_ns: Times
    """(n,) when a message leaves the driver: true time and transport latency [ns]."""
    delivered: Times
    """(m,) rows that are delivered, in order: dropped ones are missing, duplicates occur twice."""
    gyro: Array
    """(n, 3) reading of the gyroscope [rad/s]."""
    accel: Array
    """(n, 3) reading of the accelerometer [m/s^2]."""
    temperature: Array
    """(n,) temperature of the sensor [degC]."""
    ideal_gyro: Array
    """(n, 3) angular rate of the IMU in its own frame, without any error [rad/s]."""
    ideal_accel: Array
    """(n, 3) specific force at the IMU in its own frame, without any error [m/s^2]."""
    gyro_bias: Array
    """(n, 3) sum of all bias terms of the gyroscope [rad/s]."""
    accel_bias: Array
    """(n, 3) sum of all bias terms of the accelerometer [m/s^2]."""
    gyro_scale: Array
    """(n, 3) scale factor of the gyroscope from turn-on, temperature and age; 1 without error."""
    accel_scale: Array
    """(n, 3) scale factor of the accelerometer, likewise."""
    gyro_noise: Array
    """(n, 3) white noise of the gyroscope, before its low-pass [rad/s]."""
    accel_noise: Array
    """(n, 3) white noise of the accelerometer, before its low-pass [m/s^2]."""
    gyro_response_error: Array
    """(n, 3) what scale factors, misalignment, non-linearity and g-sensitivity add [rad/s]:
    ``gyro_scale * (S x + q x^2 + G f + H f^2) - x``, with x the ideal reading."""
    accel_response_error: Array
    """(n, 3) the same of the accelerometer, without G and H [m/s^2]."""
    gyro_low_pass: Array
    """(n, 3) what the low-pass of the gyroscope adds: its output minus its input [rad/s]."""
    accel_low_pass: Array
    """(n, 3) what the low-pass of the accelerometer adds [m/s^2]."""
    gyro_vibration: Array
    """(n, 3) vibration of the vehicle in the gyroscope, ``imu.vibration`` [rad/s]."""
    accel_vibration: Array
    """(n, 3) vibration of the vehicle in the accelerometer [m/s^2]."""
    motion: Motion
    """The body's motion at ``true_t_ns``."""
    sensors: Mapping[str, Any] = MappingProxyType({})
    """Samples of the other sensors in the same window of time, by name."""

    def __repr__(self) -> str:
        return shapes(self)


class SensorBlock(NamedTuple):
    """n samples of another sensor in the window of an IMU's block.

    ``block.NAME`` is ``block.values["NAME"]``.
    """

    true_t_ns: Times
    """(n,) true times [ns]."""
    t_ns: Times
    """(n,) the stamps of the messages, with the errors of its clock [ns]."""
    release_t_ns: Times
    """(n,) when a message leaves the driver [ns]."""
    delivered: Times
    """(m,) rows that are delivered, in order."""
    values: Mapping[str, NDArray[Any]]
    """(n,) or (n, m) by name: readings and their truth."""
    span_ns: int = 0
    """How long after its true time a sample is complete [ns]."""

    def __getattr__(self, name: str) -> Any:
        """Return one of the values."""
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(f"no {name} was measured") from None

    def at(self, begin: int, end: int) -> "SensorBlock":
        """Return the samples ``begin .. end - 1``."""
        rows = slice(begin, end)
        sent = self.delivered[(self.delivered >= begin) & (self.delivered < end)] - begin
        true_t_ns, t_ns, release_t_ns = (
            self.true_t_ns[rows],
            self.t_ns[rows],
            self.release_t_ns[rows],
        )
        values = {name: one[rows] for name, one in self.values.items()}
        return SensorBlock(true_t_ns, t_ns, release_t_ns, sent, values, self.span_ns)


def joined_blocks(blocks: Sequence[SensorBlock]) -> SensorBlock:
    """Return the samples of blocks, one at least, as one."""
    if len(blocks) == 1:
        return blocks[0]
    first = np.cumsum([0, *(len(one.true_t_ns) for one in blocks)])
    sent = [one.delivered + begin for one, begin in zip(blocks, first, strict=False)]
    return SensorBlock(
        np.concatenate([one.true_t_ns for one in blocks]),
        np.concatenate([one.t_ns for one in blocks]),
        np.concatenate([one.release_t_ns for one in blocks]),
        np.concatenate(sent),
        {name: np.concatenate([one.values[name] for one in blocks]) for name in blocks[0].values},
        blocks[0].span_ns,
    )
