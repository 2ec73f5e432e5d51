# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A twin beside its sensor: spectra of what the constant errors leave, and half a second of it."""

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from imu_sim_ros.calibration.twin import comparison
from imu_sim_ros.conventions import AXES, TRIADS
from imu_sim_ros.plots import style
from imu_sim_ros.plots.style import Figure

Array = NDArray[np.float64]
Series = tuple[Array, Array]
"""Times (n,) [s] and residuals (n, 6)."""

_SECONDS = 0.5
_UNITS = ("rad/s", "m/s$^2$")


def draw(real: Series, simulated: Series, rate: float, name: str) -> Figure:
    """Return the picture: six spectra, and six pairs of time series side by side."""
    figure, panels = style.panels(4, 3, 12.0, 10.0)
    for axis in range(6):
        label = f"{TRIADS[axis // 3]} {AXES[axis % 3]}"
        _spectrum(panels[axis], real[1], simulated[1], rate, axis, label)
        _series(panels[6 + axis], real, simulated, rate, axis, label)
    panels[0].legend()
    figure.suptitle(f"Digital twin of {name}: what the constant errors do not explain")
    return figure


def _spectrum(
    axes: Axes, real: Array, simulated: Array, rate: float, axis: int, label: str
) -> None:
    for values, colour, who in (
        (real, style.TRUTH_COLOUR, "real"),
        (simulated, style.PALETTE[1], "twin"),
    ):
        frequency, density = comparison.spectrum_of(values, rate)
        axes.loglog(frequency[1:], density[1:, axis], color=colour, label=who, lw=1.0)
    axes.set_title(label)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel(f"{_UNITS[axis // 3]}/sqrt(Hz)")


def _series(
    axes: Axes, real: Series, simulated: Series, rate: float, axis: int, label: str
) -> None:
    count = round(_SECONDS * rate)
    for place, (series, colour) in enumerate(
        ((real, style.TRUTH_COLOUR), (simulated, style.PALETTE[1]))
    ):
        values = series[1]
        middle = max(len(values) // 2 - count // 2, 0)
        rows = values[middle : middle + count, axis]
        t = np.arange(len(rows)) / rate + place * 1.1 * _SECONDS
        axes.plot(t, rows, color=colour, lw=0.8)
    axes.set_title(f"{label}: real, then twin")
    axes.set_xlabel("time [s]")
    axes.set_ylabel(_UNITS[axis // 3])
