# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that many sensors have: rate, stamps and transport, mount on the body."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from imu_sim_ros.core.conventions import ACCEL_UNITS, GYRO_UNITS
from imu_sim_ros.core.rotation import pose_matrix
from imu_sim_ros.core.timebase import LOWEST_RATE
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.kinds import (
    IDENTITY_MATRIX,
    ZERO_VECTOR,
    Matrix,
    Vector,
    choice,
    matrix,
    number,
    text,
    vector,
)

LARGEST_RATE = 20000.0
"""Highest sample rate [Hz]."""
LARGEST_JITTER_SIGMA = 0.25
"""The largest standard deviation of the stamps, in intervals between two samples."""
LARGEST_LATENCY = 10.0
"""Largest latency of a message: the node keeps those under way in memory [s]."""
LONGEST = 1e6
"""Largest time, well within the range of stamps [s]."""


class MountedParameters:
    """Base of the parameters that a sensor's model is made with."""

    lever_arm: Vector = ZERO_VECTOR
    """Position of the sensor in the body frame [m]."""
    mounting: Matrix = IDENTITY_MATRIX
    """Rotation R_bs of the sensor in the body, row by row."""

    @property
    def longest_window(self) -> float:
        """Longest window that may be read at once [s], if samples are large."""
        return math.inf

    def mount(self) -> Array:
        """Return the pose T_bs (4, 4) of ``lever_arm`` and ``mounting``."""
        return pose_matrix(np.reshape(self.mounting, (3, 3)), self.lever_arm)


class RatedParameters(MountedParameters):
    """Base of the parameters of a sensor with a rate of its own."""

    rate: float
    """Samples per second [Hz]."""


@dataclass(frozen=True)
class OwnRateParameters(RatedParameters):
    """Rate and stamp grid of a sensor."""

    rate: float = number(
        100.0,
        "samples per second of this sensor, on a grid of its own",
        unit="Hz",
        minimum=LOWEST_RATE,
        maximum=LARGEST_RATE,
    )
    time_offset: float = number(
        0.0,
        "time from the IMU's first sample to this sensor's first; below 1 / rate",
        unit="s",
        minimum=0.0,
        maximum=1e6,
    )

    @property
    def span(self) -> float:
        """Duration of a sample [s]; it is in the window of time in which it is complete."""
        return 0.0

    def problems(self, prefix: str) -> Iterator[str]:
        """Say whether the first sample comes too late."""
        if self.time_offset * self.rate >= 1.0:
            yield (
                f"{prefix}time_offset = {self.time_offset:g}: must be below 1 / {prefix}rate, "
                f"{1.0 / self.rate:g} s"
            )


@dataclass(frozen=True)
class TimingParameters:
    """Errors of stamps and transport. The samples themselves are taken at the true times."""

    stamp_offset: float = number(
        0.0,
        "constant error of the stamps: stamp = true time + offset",
        unit="s",
        minimum=-LONGEST,
        maximum=LONGEST,
    )
    clock_skew_ppm: float = number(
        0.0,
        "rate error of the sensor's clock at the start; above 0: it runs fast",
        unit="ppm",
        minimum=-10000.0,
        maximum=10000.0,
    )
    clock_drift_ppm_per_hour: float = number(
        0.0, "change of the clock's skew", unit="ppm/h", minimum=-10.0, maximum=10.0
    )
    jitter: float = number(
        0.0,
        "standard deviation of the stamps' error, after the cut-off at 0.45 of the interval that "
        "keeps stamps increasing; at most a quarter of the interval",
        unit="s",
        minimum=0.0,
        live=True,
    )
    latency: float = number(
        0.0,
        "minimum delay from a sample to its message; if it is lowered, messages in transit "
        "arrive at once",
        unit="s",
        minimum=0.0,
        maximum=LARGEST_LATENCY,
        live=True,
    )
    latency_jitter: float = number(
        0.0,
        "mean of the exponentially distributed extra delay of the message; order is kept",
        unit="s",
        minimum=0.0,
        maximum=LARGEST_LATENCY / 10,
        live=True,
    )
    dropout_probability: float = number(
        0.0,
        "probability that a single message is lost",
        unit="1",
        minimum=0.0,
        maximum=1.0,
        live=True,
    )
    dropout_burst_rate: float = number(
        0.0,
        "mean rate of bursts of lost messages",
        unit="1/s",
        minimum=0.0,
        maximum=20000.0,
        live=True,
    )
    dropout_burst_duration: float = number(
        0.0,
        "mean duration of a burst (exponentially distributed)",
        unit="s",
        minimum=0.0,
        maximum=LONGEST,
        live=True,
    )
    duplicate_probability: float = number(
        0.0,
        "probability that a message is delivered twice",
        unit="1",
        minimum=0.0,
        maximum=1.0,
        live=True,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Say whether bursts of losses have no length."""
        if self.dropout_burst_rate > 0.0 and self.dropout_burst_duration == 0.0:
            yield (
                f"{prefix}dropout_burst_duration = 0.0: must be above 0 s "
                f"where {prefix}dropout_burst_rate is"
            )


@dataclass(frozen=True)
class SensorParameters(OwnRateParameters, TimingParameters):
    """Parameters of every sensor that `sensors` names: rate, stamps, transport, frame and mount."""

    type: str = text("", "kind of sensor, if its name in `sensors` is another word")
    frame: str = text(
        "", "frame of its messages; empty: body_frame, or NAME_link if it has another mount"
    )
    lever_arm: Vector = vector(0.0, "position of the sensor in the body frame", unit="m")
    mounting: Matrix = matrix(IDENTITY_MATRIX, "rotation R_bs of the sensor in the body")

    def own_frame(self, name: str, body_frame: str) -> str:
        """Return the frame of its messages.

        A further sensor of a kind that has a usual frame, such as `gps_link`, has its
        name in place of it: `gnss1_link`.

        :param name: name of the sensor.
        """
        usual = type(self).frame
        if self.frame and not (self.type and self.frame == usual):
            return self.frame
        if usual:
            return f"{name}_link" if usual.endswith("_link") else name
        at_the_body = not any(self.lever_arm) and self.mounting == IDENTITY_MATRIX
        return body_frame if at_the_body else f"{name}_link"

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        yield from OwnRateParameters.problems(self, prefix)
        yield from TimingParameters.problems(self, prefix)
        yield from rotation_problems(self.mounting, f"{prefix}mounting")
        if self.jitter * self.rate > LARGEST_JITTER_SIGMA:
            yield (
                f"{prefix}jitter = {self.jitter:g}: must be at most a quarter of the "
                f"interval, {LARGEST_JITTER_SIGMA / self.rate:g} s"
            )


@dataclass(frozen=True)
class LiveReadingParameters:
    """Frame and units of the readings that a node receives."""

    frame: str = text(
        "",
        "frame_id of the readings to use, where a topic has those of several IMUs; empty: that of "
        "the first message",
    )
    gyro_unit: str = choice(
        "rad/s", tuple(GYRO_UNITS), "unit of the gyroscope in the messages, made rad/s"
    )
    accel_unit: str = choice(
        "m/s^2", tuple(ACCEL_UNITS), "unit of the accelerometer in the messages, made m/s^2"
    )


ORTHONORMAL_TOLERANCE = 1e-6
"""Largest element of ``R R.T - 1`` of a rotation matrix."""


def rotation_problems(values: Matrix, name: str) -> Iterator[str]:
    """Yield a line if nine numbers, row by row, are not a rotation matrix.

    :param name: name of the parameter, for the message.
    """
    r = np.reshape(values, (3, 3))
    error = float(np.abs(r @ r.T - np.eye(3)).max())
    if error > ORTHONORMAL_TOLERANCE:
        yield (
            f"{name}: must be a rotation matrix; "
            f"R R^T differs from the identity by {error:.2g}, allowed is {ORTHONORMAL_TOLERANCE:g}"
        )
    elif np.linalg.det(r) < 0:
        yield f"{name}: must be a rotation matrix; this one is a reflection (determinant -1)"
