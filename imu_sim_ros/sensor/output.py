"""The end of a triad's chain: low-pass, saturation, quantisation."""

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config.imu import ImuParameters
from imu_sim_ros.sensor.noise import axis_values

Array = NDArray[np.float64]


class LowPass:
    """A Butterworth low-pass on each axis that has a cut-off.

    The bilinear transform with the cut-off matched: -3 dB exactly at the cut-off. The filter starts
    settled on the first sample.
    """

    def __init__(self, triad: str, imu: ImuParameters, rate: float) -> None:
        cutoffs = axis_values(imu, triad, "bandwidth")
        self._sections: dict[int, Array] = {}
        self._states: dict[int, Array] = {}
        if cutoffs.any():
            from scipy import signal  # a second of import that only a low-pass costs

            self._filter = signal.sosfilt
            for axis in np.flatnonzero(cutoffs):
                self._sections[int(axis)] = signal.butter(
                    imu.bandwidth_order, cutoffs[axis], fs=rate, output="sos"
                )
            self._settled = {k: signal.sosfilt_zi(s) for k, s in self._sections.items()}

    def apply(self, values: Array) -> None:
        """Filter the next n samples (3, n) in place."""
        if values.shape[1] == 0:
            return
        for axis, sections in self._sections.items():
            state = self._states.get(axis)
            if state is None:
                state = self._settled[axis] * values[axis, 0]
            values[axis], self._states[axis] = self._filter(sections, values[axis], zi=state)


class Digitiser:
    """Saturation at the range, then rounding to whole steps."""

    def __init__(self, triad: str) -> None:
        self._triad = triad
        self._range = np.zeros(3)
        self._resolution = np.zeros(3)

    def configure(self, imu: ImuParameters) -> None:
        """Take range and resolution; 0 is none."""
        self._range = axis_values(imu, self._triad, "range")
        self._resolution = axis_values(imu, self._triad, "resolution")

    def apply(self, values: Array) -> None:
        """Saturate and round values (3, n) in place."""
        for row, limit, step in zip(values, self._range, self._resolution, strict=True):
            if limit:
                np.clip(row, -limit, limit, out=row)
            if step:
                row /= step
                np.rint(row, out=row)
                row *= step


def noise_gain(cutoff: float, order: int, rate: float) -> float:
    """Return what a low-pass leaves of the variance of white noise, 0 to 1.

    The mean of ``|H|^2 = 1 / (1 + u^(2 n))`` over all frequencies up to half the rate, with
    ``u = tan(pi f / rate) / tan(pi cutoff / rate)``, the bilinear transform's frequency.

    :param cutoff: [Hz]; 0: no low-pass.
    """
    if not cutoff:
        return 1.0
    t = np.tan(np.pi * cutoff / rate)
    # In s = ln u the integrand is smooth and dies out at both ends: the trapezoid rule is exact to
    # rounding.
    s, step = np.linspace(-30.0, 30.0, 1201, retstep=True)
    u = np.exp(s)
    density = 2.0 / np.pi * t * u / ((1.0 + (t * u) ** 2) * (1.0 + u ** (2 * order)))
    return float(density.sum() * step)
