# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of calibrations, and of a twin compared with its sensor."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from numpy.typing import NDArray

from imu_sim_ros.calibration.deterministic.ellipsoid import Ellipsoid
from imu_sim_ros.calibration.deterministic.positions import FACES, SixPosition
from imu_sim_ros.calibration.deterministic.response import AxisResponse
from imu_sim_ros.calibration.deterministic.temperature import (
    Temperature,
    TriadTemperature,
    polynomial_sigma,
)
from imu_sim_ros.calibration.deterministic.turntable import Turntable
from imu_sim_ros.calibration.twin import comparison
from imu_sim_ros.core.conventions import AXES, AXIS_COLOURS, SERIES_COLOURS, TRIADS, TRUTH_COLOUR
from imu_sim_ros.core.digits import plus_minus
from imu_sim_ros.core.types import Array
from imu_sim_ros.plots import style
from imu_sim_ros.plots.style import Figure

_AXES = "xyz"
_BAR_COLOUR = "#E4E4E4"


def six_position(result: SixPosition, gravity: float, source: str = "") -> Figure:
    """Return errors before and residuals after the calibration, by the axis that points up.

    :param source: name of the bag, for the title.
    """
    force = np.zeros((len(result.faces), 3))
    force[np.arange(len(force)), result.faces // 2] = gravity * (1.0 - 2.0 * (result.faces % 2))
    figure = _residuals(
        ("before: reading - true force", result.positions.accel - force),
        ("after: reading - fitted model", result.residuals),
        result.positions.accel_sigma,
        (result.faces, FACES),
        ("axis that points up", "error [mm/s$^2$]", "2 standard errors of a piece"),
    )
    bias = _values("b", result.bias, result.bias_sigma)
    style.add_legend_above(figure.axes[0], 3, f"accelerometer, bias in m/s$^2$: {bias}")
    style.draw_heading(
        figure,
        f"{_source_title(source)}accelerometer in {result.positions.stretches} rests, "
        f"{len(result.faces)} pieces",
    )
    return figure


def turntable(result: Turntable, source: str = "") -> Figure:
    """Return errors before and residuals after the calibration, by the table's axis and rate.

    :param source: name of the bag, for the title.
    """
    axis = np.argmax(np.abs(result.rate), axis=1)
    rate = result.rate[np.arange(len(axis)), axis]
    turns = zip(axis.tolist(), rate.tolist(), strict=True)
    names = np.array([f"{_AXES[a]} {r:+.3g}" if r else "rest" for a, r in turns])
    order = sorted(range(len(names)), key=lambda k: (bool(rate[k]), axis[k], rate[k]))
    labels = list(dict.fromkeys(names[order].tolist()))
    groups = np.array([labels.index(word) for word in names.tolist()])
    figure = _residuals(
        ("before: reading - true rate", result.stretches.gyro - result.rate),
        ("after: reading - fitted model", result.residuals),
        result.stretches.gyro_sigma,
        (groups, labels),
        ("axis and rate of the table [rad/s]", "error [mrad/s]", "2 standard errors of a stretch"),
    )
    bias = _values("b", result.bias, result.bias_sigma)
    style.add_legend_above(figure.axes[0], 3, f"gyroscope, bias in rad/s: {bias}")
    style.draw_heading(
        figure,
        f"{_source_title(source)}gyroscope in {result.stretches.stretches} stretches "
        "on a rate table",
    )
    return figure


def _source_title(source: str) -> str:
    """Return the name of a source in front of a title."""
    return f"{source}: " if source else ""


def _values(symbol: str, values: Array, sigma: Array) -> str:
    """Return values with twice their standard errors as text."""
    parts = (plus_minus(v, 2 * s) for v, s in zip(values, sigma, strict=True))
    return f"{symbol} = " + ", ".join(parts) + " (2 sigma)"


def _residuals(
    uncalibrated: tuple[str, Array],
    calibrated: tuple[str, Array],
    sigma: Array,
    poses: tuple[NDArray[np.intp], Sequence[str]],
    names: tuple[str, str, str],
) -> Figure:
    """Draw errors (n, 3) in two panels, a column for each pose, divided by axis.

    :param uncalibrated: title and errors before the calibration; ``calibrated``: after it.
    :param sigma: (n, 3) standard errors.
    :param poses: (n,) pose of each piece, and the names of the poses.
    :param names: labels of the axes, whose errors are shown in thousandths, and of the grey bars.
    """
    groups, labels = poses
    figure, panels = style.panels(2, 1, 11.0, 7.6, sharex=True)
    for axes, (title, values) in zip(panels, (uncalibrated, calibrated), strict=True):
        for k, name in enumerate(_AXES):
            colour = AXIS_COLOURS[name]
            for group in range(len(labels)):
                rows = np.flatnonzero(groups == group)
                if not len(rows):
                    continue
                middle = group + 0.28 * (k - 1)
                spread = np.linspace(-0.1, 0.1, len(rows)) if len(rows) > 1 else np.zeros(1)
                if title == calibrated[0]:
                    reach = 2e3 * float(np.sqrt(np.mean(sigma[rows, k] ** 2)))
                    axes.bar(middle, 2 * reach, 0.25, -reach, color=_BAR_COLOUR, zorder=0.5)
                axes.plot(middle + spread, 1e3 * values[rows, k], ".", ms=4.5, color=colour)
            axes.plot([], [], "o", ms=4, color=colour, label=name)
        axes.axhline(0.0, color=style.MUTED_COLOUR, lw=0.8)
        axes.set_ylabel(names[1])
        style.title(axes, title)
        axes.grid(False, axis="x")
        for group in range(1, len(labels)):
            axes.axvline(group - 0.5, color="#DDDDDD", lw=0.6)
    style.add_legend_above(panels[1], 1, handles=[Patch(color=_BAR_COLOUR, label=names[2])])
    crowded = len(labels) > 12
    panels[1].set_xticks(range(len(labels)), labels, rotation=60 if crowded else 0)
    panels[1].set_xlim(-0.5, len(labels) - 0.5)
    panels[1].set_xlabel(names[0])
    return figure


def ellipsoid(result: Ellipsoid, readings: Array, source: str) -> Figure:
    """Return the field's strength before and after, and the residuals over the directions.

    :param readings: (n, 3) readings [T].
    :param source: contents and name of the bag, for the title.
    """
    corrected = np.linalg.solve(result.soft_iron, (readings - result.hard_iron).T).T
    thin = slice(None, None, max(len(readings) // 4000, 1))
    figure, (strength_axes, direction_axes) = style.panels(1, 2, 9.0, 4.5)
    number = np.arange(len(readings))
    for values, colour, label in (
        (readings, SERIES_COLOURS[1], "readings"),
        (corrected, SERIES_COLOURS[0], "corrected readings"),
    ):
        strength = np.linalg.norm(values, axis=1) * 1e6
        strength_axes.plot(number[thin], strength[thin], ".", ms=2, color=colour, label=label)
    strength_axes.set_ylim(bottom=0.0)
    strength_axes.set_xlabel("number of the reading")
    strength_axes.set_ylabel("strength of the field [µT]")
    style.add_legend_above(strength_axes, 2)
    direction = corrected / np.linalg.norm(corrected, axis=1)[:, None]
    azimuth = np.degrees(np.arctan2(direction[:, 1], direction[:, 0]))
    shown = direction_axes.scatter(
        azimuth[thin], direction[thin, 2], c=result.residuals[thin] * 1e6, s=4, cmap="coolwarm"
    )
    direction_axes.set_xlabel("azimuth of the field in the sensor [deg]")
    direction_axes.set_xticks(np.arange(-180, 181, 90))
    direction_axes.set_ylabel("z of the field's direction")
    bar = figure.colorbar(shown, ax=direction_axes)
    bar.set_label(
        "residual of the strength [µT]", fontsize=direction_axes.xaxis.label.get_fontsize()
    )
    bar.ax.tick_params(labelsize=direction_axes.xaxis.label.get_fontsize())
    style.draw_heading(figure, f"{source}, {len(readings)} readings")
    return figure


def temperature(result: Temperature, source: str = "") -> Figure:
    """Return bias and scale of both triads against temperature, with 95 % bands.

    :param source: name of the bag, for the title.
    """
    figure, panels = style.panels(2, 2, 11.5, 7.5)
    units = ("rad/s", "m/s$^2$")
    for row, ((name, triad), unit) in enumerate(zip(result.triads.items(), units, strict=True)):
        _draw_bias(panels[2 * row], triad, result.reference)
        panels[2 * row].set_ylabel(f"bias [{unit}]")
        style.title(panels[2 * row], f"{name}: bias")
        _draw_scale(panels[2 * row + 1], triad, result.reference)
        panels[2 * row + 1].set_ylabel(f"scale - scale at {result.reference:g} °C [ppm]")
        style.title(panels[2 * row + 1], f"{name}: scale")
    for axes in panels:
        axes.set_xlabel("temperature [°C]")
    style.draw_heading(
        figure,
        f"{_source_title(source)}readings against temperature (points), fitted polynomials and "
        "their 95 % bands",
    )
    return figure


def _draw_bias(axes: Axes, triad: TriadTemperature, reference: float) -> None:
    """Draw the bias of a triad against temperature."""
    for k, axis in enumerate(triad.axes):
        grid, powers = _grid(triad.difference, len(axis.bias))
        curve = powers @ axis.bias
        start = len(axis.gain)
        part = axis.covariance[start : start + len(axis.bias), start : start + len(axis.bias)]
        points = _polynomial(axis.bias, triad.difference) + axis.residuals
        _draw_curve(axes, k, reference + triad.difference, points)
        _draw_band(axes, k, reference + grid, curve, polynomial_sigma(powers, part), len(axis.bias))
    style.add_legend_above(axes, 3)


def _draw_scale(axes: Axes, triad: TriadTemperature, reference: float) -> None:
    """Draw the scale of a triad against temperature."""
    for k, axis in enumerate(triad.axes):
        if triad.inputs.shape[1] == 0:
            note = "one orientation, at rest: the scale is not observable"
            axes.text(0.5, 0.5, note, transform=axes.transAxes, ha="center")
            axes.set_axis_off()
            return
        grid, powers = _grid(triad.difference, len(axis.scale) + 1)
        points, offsets = _scale_points(axis, triad, k)
        _draw_curve(axes, k, reference + offsets, 1e6 * points)
        curve = powers[:, 1:] @ axis.scale
        start = len(axis.gain) + len(axis.bias)
        sigma = polynomial_sigma(powers[:, 1:], axis.covariance[start:, start:])
        _draw_band(axes, k, reference + grid, 1e6 * curve, 1e6 * sigma, len(axis.scale) + 1)
    style.add_legend_above(axes, 3)


def _scale_points(axis: AxisResponse, triad: TriadTemperature, k: int) -> tuple[Array, Array]:
    """Return the scale errors (m,) of single readings of axis k, and their T - T0 (m,) [K].

    Readings with a small input along the axis show nothing of its scale, and are left out.
    """
    response = triad.inputs @ axis.gain
    inputs = np.abs(triad.inputs[:, k])
    rows = inputs > 0.5 * np.max(inputs)
    fitted_scale = _polynomial(np.concatenate([[0.0], axis.scale]), triad.difference)
    scale = fitted_scale[rows] + axis.residuals[rows] / response[rows]
    return scale, triad.difference[rows]


def _polynomial(coefficients: Array, x: Array) -> Array:
    """Return the values (n,) of a polynomial, lowest order first."""
    return x[:, None] ** np.arange(len(coefficients)) @ coefficients


def _grid(difference: Array, terms: int) -> tuple[Array, Array]:
    """Return temperatures (200,) over the range, and their powers (200, terms)."""
    grid = np.linspace(difference.min(), difference.max(), 200)
    return grid, grid[:, None] ** np.arange(terms)


def _draw_curve(axes: Axes, k: int, x: Array, points: Array) -> None:
    """Draw the points of axis k."""
    axes.plot(x, points, ".", ms=2, alpha=0.35, color=AXIS_COLOURS[_AXES[k]])


def _draw_band(axes: Axes, k: int, x: Array, curve: Array, sigma: Array, terms: int) -> None:
    """Draw the fitted curve of axis k with its 95 % band."""
    colour = AXIS_COLOURS[_AXES[k]]
    axes.plot(x, curve, color=colour, label=f"{_AXES[k]}: order {terms - 1}")
    axes.fill_between(x, curve - 1.96 * sigma, curve + 1.96 * sigma, color=colour, alpha=0.25, lw=0)


Series = tuple[Array, Array]
"""Times (n,) [s] and residuals (n, 6)."""

_SECONDS = 0.5
"""Length of the shown part of a residual [s]."""
_UNITS = ("rad/s", "m/s$^2$")


def draw_spectra(real: Series, simulated: Series, rate: float, name: str) -> Figure:
    """Return the picture: six spectra, and six pairs of time series side by side."""
    figure, panels = style.panels(4, 3, 12.0, 10.0)
    for axis in range(6):
        label = f"{TRIADS[axis // 3]} {AXES[axis % 3]}"
        _spectrum(panels[axis], real[1], simulated[1], rate, axis, label)
        _series(panels[6 + axis], real, simulated, rate, axis, label)
    style.add_legend_above(panels[2], 2)
    style.draw_heading(figure, f"Digital twin of {name}: residuals of the fitted constant errors")
    return figure


def _spectrum(
    axes: Axes, real: Array, simulated: Array, rate: float, axis: int, label: str
) -> None:
    """Draw the spectra of real and simulated readings of one axis."""
    for values, colour, who in (
        (real, TRUTH_COLOUR, "real"),
        (simulated, SERIES_COLOURS[1], "twin"),
    ):
        frequency, density = comparison.spectrum_of(values, rate)
        axes.loglog(frequency[1:], density[1:, axis], color=colour, label=who, lw=1.0)
    style.title(axes, label)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel(f"{_UNITS[axis // 3]}/sqrt(Hz)")


def _series(
    axes: Axes, real: Series, simulated: Series, rate: float, axis: int, label: str
) -> None:
    """Draw some seconds of real and simulated readings of one axis."""
    count = round(_SECONDS * rate)
    for panel, (series, colour) in enumerate(
        ((real, TRUTH_COLOUR), (simulated, SERIES_COLOURS[1]))
    ):
        values = series[1]
        middle = max(len(values) // 2 - count // 2, 0)
        rows = values[middle : middle + count, axis]
        t = np.arange(len(rows)) / rate + panel * 1.1 * _SECONDS
        axes.plot(t, rows, color=colour, lw=0.8)
    style.title(axes, f"{label}: real, then twin")
    axes.set_xlabel("time [s]")
    axes.set_ylabel(_UNITS[axis // 3])
