# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vibration of the vehicle in a board's readings: lines, bands, and how they follow the motion.

The intensity of a range of frequencies is a product of powers of the body's rate, acceleration and
speed, each as a running mean square m with the floor c of the reference r::

    a = prod_i ((m_i + (c r_i)^2) / (r_i^2 + (c r_i)^2))^(p_i / 2)
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import BoardVibrationParameters
from imu_sim_ros.conventions import Vector
from imu_sim_ros.random_streams import generator
from imu_sim_ros.sensor.vehicle.bands import BandNoise
from imu_sim_ros.trajectory import Motion

Array = NDArray[np.float64]

_AXES: Final = 6


class MotionSize:
    """Rate, acceleration and speed of a body as running means, relative to a reference."""

    def __init__(self, rate: float, reference: Vector, floor: float, time: float) -> None:
        """Start settled on the first sample.

        :param rate: samples per second [Hz].
        :param reference: rate [rad/s], acceleration [m/s^2] and speed [m/s].
        :param floor: share of the reference that is added, as squares.
        :param time: constant of the running means [s].
        """
        self._decay = float(np.exp(-1.0 / (rate * time)))
        self._reference = np.square(reference)[:, None]
        self._floor = floor**2 * self._reference
        self._state: Array | None = None

    def logs(self, motion: Motion) -> Array:
        """Return ``ln sqrt((m + c^2 r^2) / (r^2 + c^2 r^2))`` (3, n) of the next n samples."""
        from scipy import signal

        vectors = (motion.angular_velocity, motion.acceleration, motion.velocity)
        squares = np.stack([np.einsum("na,na->n", v, v) for v in vectors])
        if self._state is None:
            self._state = self._decay * squares[:, :1]
        mean, self._state = signal.lfilter(
            [1.0 - self._decay], [1.0, -self._decay], squares, axis=1, zi=self._state
        )
        result: Array = 0.5 * np.log((mean + self._floor) / (self._reference + self._floor))
        return result


class BoardVibration:
    """The vibration that one board reads; its samples are read in order."""

    def __init__(self, seed: int, parameters: BoardVibrationParameters, rate: float) -> None:
        """Start at sample 0.

        :param rate: samples per second [Hz].
        """
        self._parameters, self._rate = parameters, rate
        self._bands = BandNoise(seed, parameters, rate) if any(parameters.band_density) else None
        common = generator(seed, "vehicle_vibration.line_phase")
        self._phases = 2.0 * np.pi * common.random(len(parameters.line_frequency))
        exponents = [parameters.gyroscope_exponents, parameters.accelerometer_exponents]
        self._exponents = np.stack(
            [np.reshape(e or (0.0,) * (3 * parameters.ranges), (-1, 3)) for e in exponents]
        )
        self._size = MotionSize(
            rate, parameters.reference_motion, parameters.motion_floor, parameters.motion_time
        )

    def read(self, first: int, motion: Motion) -> Array:
        """Return the next n samples (6, n): gyroscope [rad/s], accelerometer [m/s^2].

        :param first: index of the first of them.
        :param motion: of the body at the samples.
        """
        count, ranges = len(motion.position), self._parameters.ranges
        parts = np.zeros((ranges, _AXES, count))
        if self._bands is not None:
            parts += self._bands.next_block(count).reshape(ranges, _AXES, count)
        self._add_lines(first, parts)
        if self._exponents.any() and count:
            parts *= self._intensity(motion)
        # One range after the other, so that a sum does not depend on the number of samples.
        result: Array = parts[0]
        for part in parts[1:]:
            result += part
        return result

    def _add_lines(self, first: int, parts: Array) -> None:
        p = self._parameters
        index = np.arange(first, first + parts.shape[2])
        amplitudes = np.reshape(p.line_amplitude, (-1, _AXES))
        phases = np.reshape(p.line_phase or (0.0,) * amplitudes.size, (-1, _AXES))
        where = np.searchsorted(p.range_edges, p.line_frequency, side="right")
        lines = zip(p.line_frequency, amplitudes, phases, self._phases, where, strict=True)
        for frequency, amplitude, phase, common, k in lines:
            if frequency < 0.5 * self._rate:
                angle = 2.0 * np.pi * np.mod(index * (frequency / self._rate), 1.0)
                for axis in np.flatnonzero(amplitude):
                    parts[k, axis] += amplitude[axis] * np.sin(angle + (phase[axis] + common))

    def _intensity(self, motion: Motion) -> Array:
        """Return the factors (ranges, 6, n)."""
        logs = self._size.logs(motion)
        triads = []
        for exponents in self._exponents:  # (ranges, 3)
            total = exponents[:, 0, None] * logs[0]
            for k in (1, 2):
                total += exponents[:, k, None] * logs[k]
            triads.append(np.repeat(np.exp(total)[:, None], 3, axis=1))
        result: Array = np.concatenate(triads, axis=1)
        return result
