# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Noise of six axes with a given density, and given coherence between them, in each band.

The process is a sum of frames that overlap by half. In a frame each frequency has its own complex
normal vector z, coloured by a root of the band's cross-spectral matrix, ``X = S^(1/2) z``; back in
time it is weighted with half a sine wave. Squares of overlapping weights add up to one, so the
process is stationary, and its spectrum is the given one but for two steps of a frame's frequencies.
Frames begin at fixed samples: a value does not depend on the blocks in which it is read.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import BoardVibrationParameters
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.random_streams import axis_generators
from imu_sim_ros.sensor.errors import ChunkedProcess

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_AXES: Final = 6
_FRAME: Final = 20.0
"""[s] length of a frame at least."""
_LONGEST: Final = 1 << 15
"""Samples in a frame."""


def cross_spectra(parameters: BoardVibrationParameters) -> Complex:
    """Return the matrices (bands, 6, 6) of the bands' two-sided densities, squared."""
    density = np.reshape(parameters.band_density, (-1, _AXES))
    result: Complex = density[:, :, None] * parameters.coherence() * density[:, None, :]
    return result


def root(matrices: Complex) -> Complex:
    """Return A with ``A A^H`` the matrices (m, 6, 6), or the nearest possible ones.

    Rounded coherence may belong to no process: negative eigenvalues are taken as zero.
    """
    values, vectors = np.linalg.eigh(matrices)
    result: Complex = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    return result


class BandNoise(ChunkedProcess):
    """The bands of one board; rows of a chunk are six axes for each range of frequencies."""

    def __init__(self, seed: int, parameters: BoardVibrationParameters, rate: float) -> None:
        """Prepare the spectra.

        :param rate: samples per second [Hz].
        """
        frame = min(1 << int(np.ceil(np.log2(max(_FRAME * rate, 64.0)))), _LONGEST)
        streams = [s for t in TRIADS for s in axis_generators(seed, f"{t}.vehicle_vibration")]
        self._all = _AXES * parameters.ranges
        super().__init__(streams, frame // 2, self._all)
        frequency = np.arange(1, frame // 2) * rate / frame
        band = np.searchsorted(parameters.band_low, frequency, side="right") - 1
        inside = band >= 0
        inside[inside] = frequency[inside] < np.asarray(parameters.band_high)[band[inside]]
        self._rows = np.flatnonzero(inside) + 1
        # E |X|^2 = S * frame * rate, half of it in each of real and imaginary part.
        size = np.sqrt(0.5 * frame * rate)
        self._root = size * root(cross_spectra(parameters))[band[inside]]
        range_of = np.searchsorted(parameters.range_edges, frequency[inside], side="right")
        self._ranges = [np.flatnonzero(range_of == k) for k in range(parameters.ranges)]
        self._window = np.sin(np.pi * (np.arange(frame) + 0.5) / frame)
        self._frame = frame
        self._overlap = self._next_frame()[:, frame // 2 :]

    def _next_frame(self) -> Array:
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

    def _make_chunks(self, count: int) -> Array:
        half = self._frame // 2
        values = np.empty((self._all, count * half))
        for first in range(0, count * half, half):
            frame = self._next_frame()
            np.add(self._overlap, frame[:, :half], out=values[:, first : first + half])
            self._overlap = frame[:, half:]
        return values
