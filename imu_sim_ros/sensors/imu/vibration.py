# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vibration of the vehicle in a board's readings: lines, bands, and how they follow the motion."""

from typing import Final

import numpy as np

from imu_sim_ros.core.conventions import TRIADS, Vector
from imu_sim_ros.core.random_streams import Units, axis_generators, generator
from imu_sim_ros.core.types import Array, Complex
from imu_sim_ros.sensors.errors.processes import ChunkedProcess
from imu_sim_ros.sensors.imu.parameters import BoardVibrationParameters
from imu_sim_ros.trajectory.motion import Motion

_AXES: Final = 6
"""Number of axes: gyroscope x y z, accelerometer x y z."""
_FRAME: Final = 20.0
"""Shortest length of a frame [s]."""
_LONGEST: Final = 1 << 15
"""Samples in a frame."""


def cross_spectra(parameters: BoardVibrationParameters) -> Complex:
    """Return the matrices (bands, 6, 6) of the bands' two-sided densities, squared."""
    density = np.reshape(parameters.band_density, (-1, _AXES))
    return density[:, :, None] * parameters.coherence() * density[:, None, :]


def root(matrices: Complex) -> Complex:
    """Return A with ``A A^H`` the matrices (m, 6, 6), or the nearest possible ones.

    Rounded coherence may belong to no process: negative eigenvalues are taken as zero.
    """
    values, vectors = np.linalg.eigh(matrices)
    return vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]


class BandNoise(ChunkedProcess):
    """The bands of one board; columns of a chunk are six axes for each range of frequencies."""

    def __init__(self, seed: int, parameters: BoardVibrationParameters, rate: float) -> None:
        """Prepare the spectra.

        :param rate: samples per second [Hz].
        """
        frame = min(1 << int(np.ceil(np.log2(max(_FRAME * rate, 64.0)))), _LONGEST)
        self._all = _AXES * parameters.ranges
        super().__init__(frame // 2, (self._all,))
        self._streams = [
            stream for t in TRIADS for stream in axis_generators(seed, f"{t}.vehicle_vibration")
        ]
        frequency = np.arange(1, frame // 2) * rate / frame
        band = np.searchsorted(parameters.band_low, frequency, side="right") - 1
        in_band = band >= 0
        in_band[in_band] = frequency[in_band] < np.asarray(parameters.band_high)[band[in_band]]
        self._rows = np.flatnonzero(in_band) + 1
        # E |X|^2 = S * frame * rate, half of it in each of real and imaginary part.
        size = np.sqrt(0.5 * frame * rate)
        self._root = size * root(cross_spectra(parameters))[band[in_band]]
        range_of = np.searchsorted(parameters.range_edges, frequency[in_band], side="right")
        self._ranges = [np.flatnonzero(range_of == k) for k in range(parameters.ranges)]
        self._window = np.sin(np.pi * (np.arange(frame) + 0.5) / frame)
        self._frame = frame
        self._overlap = self._next_frame()[:, frame // 2 :]

    def _next_frame(self) -> Array:
        """Return the next frame of coloured noise in a window."""
        numbers = np.stack([s.standard_normal((2, self._frame // 2 - 1)) for s in self._streams])
        z = (numbers[:, 0] + 1j * numbers[:, 1])[:, self._rows - 1]
        coloured = np.einsum("fij,jf->if", self._root, z)
        result = np.zeros((self._all, self._frame))
        for k, rows in enumerate(self._ranges):
            if len(rows):
                spectrum = np.zeros((_AXES, self._frame // 2 + 1), dtype=np.complex128)
                spectrum[:, self._rows[rows]] = coloured[:, rows]
                part = slice(_AXES * k, _AXES * (k + 1))
                result[part] = np.fft.irfft(spectrum, self._frame, axis=1) * self._window
        return result

    def _make_chunks(self, count: int, units: Units) -> Array:
        """Return the next chunks: overlapping frames, added."""
        half = self._frame // 2
        values = np.empty((self._all, count * half))
        for first in range(0, count * half, half):
            frame = self._next_frame()
            np.add(self._overlap, frame[:, :half], out=values[:, first : first + half])
            self._overlap = frame[:, half:]
        return values.T


class MotionSize:
    """Rate, acceleration and speed of a body as running means, relative to a reference."""

    def __init__(
        self,
        rate: float,
        reference: Vector,
        floor: float,
        time: float,
        ceiling: Vector = (0.0, 0.0, 0.0),
    ) -> None:
        """Start settled on the first sample.

        :param rate: samples per second [Hz].
        :param reference: rate [rad/s], acceleration [m/s^2] and speed [m/s].
        :param floor: share of the reference that is added, as squares.
        :param time: constant of the running means [s].
        :param ceiling: upper limit of the result, relative to the reference; 0: none.
        """
        self._decay = float(np.exp(-1.0 / (rate * time)))
        self._reference = np.square(reference)
        self._floor = floor**2 * self._reference
        highest = np.asarray(ceiling, dtype=np.float64)
        self._highest = np.log(highest, out=np.full(3, np.inf), where=highest > 0.0)
        self._state: Array | None = None

    def logs(self, motion: Motion) -> Array:
        """Return ``ln sqrt((m + c^2 r^2) / (r^2 + c^2 r^2))`` (n, 3) of the next n samples.

        No more than the logarithm of the ceiling.
        """
        from scipy import signal

        vectors = (motion.angular_velocity, motion.acceleration, motion.velocity)
        squares = np.stack([np.einsum("na,na->n", v, v) for v in vectors]).T
        if self._state is None:
            self._state = self._decay * squares[:1]
        mean, self._state = signal.lfilter(
            [1.0 - self._decay], [1.0, -self._decay], squares, axis=0, zi=self._state
        )
        logs = 0.5 * np.log((mean + self._floor) / (self._reference + self._floor))
        return np.minimum(logs, self._highest)


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
            rate,
            parameters.reference_motion,
            parameters.motion_floor,
            parameters.motion_time,
            parameters.motion_ceiling,
        )

    def read(self, first: int, motion: Motion) -> Array:
        """Return the next n samples (n, 6): gyroscope [rad/s], accelerometer [m/s^2].

        :param first: index of the first of them.
        :param motion: motion of the body at the samples.
        """
        count, ranges = len(motion.position), self._parameters.ranges
        bands = None if self._bands is None else self._bands.next_block(count)
        parts = [np.empty((count, _AXES), order="F") for _ in range(ranges)]
        for k, part in enumerate(parts):
            part[...] = 0.0
            if bands is not None:
                part += bands[:, _AXES * k : _AXES * (k + 1)]
        self._add_lines(first, parts)
        if self._exponents.any() and count:
            for part, factor in zip(parts, self._intensity(motion), strict=True):
                part *= factor
        # One range after the other, so that a sum does not depend on the number of samples.
        result = parts[0]
        for part in parts[1:]:
            result += part
        return result

    def _add_lines(self, begin: int, parts: list[Array]) -> None:
        """Add the sinusoidal lines to parts of the samples."""
        p = self._parameters
        index = np.arange(begin, begin + len(parts[0]))
        amplitudes = np.reshape(p.line_amplitude, (-1, _AXES))
        phases = np.reshape(p.line_phase or (0.0,) * amplitudes.size, (-1, _AXES))
        where = np.searchsorted(p.range_edges, p.line_frequency, side="right")
        lines = zip(p.line_frequency, amplitudes, phases, self._phases, where, strict=True)
        for frequency, amplitude, phase, common, k in lines:
            if frequency < 0.5 * self._rate:
                angle = 2.0 * np.pi * np.mod(index * (frequency / self._rate), 1.0)
                for axis in np.flatnonzero(amplitude):
                    parts[k][:, axis] += amplitude[axis] * np.sin(angle + (phase[axis] + common))

    def _intensity(self, motion: Motion) -> list[Array]:
        """Return the factors (n, 6) of each range."""
        logs = self._size.logs(motion)
        factors = []
        for exponents in self._exponents.swapaxes(0, 1):  # (2, 3)
            factor = np.empty((len(logs), _AXES), order="F")
            for triad, (x, y, z) in enumerate(exponents):
                total = x * logs[:, 0]
                total += y * logs[:, 1]
                total += z * logs[:, 2]
                factor[:, 3 * triad : 3 * triad + 3] = np.exp(total)[:, None]
            factors.append(factor)
        return factors
