# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of the calibrations: what is left of the readings, and curves against temperature."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from imu_sim_ros.calibration.deterministic import (
    FACES,
    AxisResponse,
    SixPosition,
    Temperature,
    TriadTemperature,
    Turntable,
    polynomial_sigma,
)
from imu_sim_ros.plots import style

Array = NDArray[np.float64]

_AXES = "xyz"


def draw_six_position(result: SixPosition, gravity: float, path: str | Path) -> None:
    """Write errors before and residuals after the calibration, by the axis that points up."""
    figure, (before, after) = style.panels(1, 2, 11.0, 4.6)
    force = np.zeros((len(result.faces), 3))
    force[np.arange(len(force)), result.faces // 2] = gravity * (1.0 - 2.0 * (result.faces % 2))
    errors = (("before: reading - true force", result.positions.accel - force),
              ("after: reading - fitted model", result.residuals))  # fmt: skip
    for axes, (title, values) in zip((before, after), errors, strict=True):
        for k, name in enumerate(_AXES):
            axes.errorbar(
                result.faces + 0.2 * (k - 1),
                1e3 * values[:, k],
                yerr=2e3 * result.positions.accel_sigma[:, k],
                fmt="o",
                ms=3,
                lw=0.8,
                color=style.AXIS_COLOURS[name],
                label=f"{name}: b = {result.bias[k]:.4f} $\\pm$ {2 * result.bias_sigma[k]:.1g}",
            )
        axes.axhline(0.0, color=style.MUTED_COLOUR, lw=0.8)
        axes.set_xticks(range(6), FACES)
        axes.set_xlabel("axis that points up")
        axes.set_ylabel("mm/s$^2$")
        axes.set_title(title)
    _legend_above(before, "accelerometer: bias in m/s$^2$")
    figure.suptitle(
        f"Six positions: {len(result.faces)} pieces of {result.positions.stretches} rests "
        "(bars: 2 standard errors of the readings; right: without the bias' walk)"
    )
    style.save(figure, path)


def draw_turntable(result: Turntable, path: str | Path) -> None:
    """Write errors before and residuals after the calibration, by the table's rate."""
    figure, (before, after) = style.panels(1, 2, 11.0, 4.6)
    turning = result.rate[np.arange(len(result.rate)), np.argmax(np.abs(result.rate), axis=1)]
    errors = (("before: reading - true rate", result.stretches.gyro - result.rate),
              ("after: reading - fitted model", result.residuals))  # fmt: skip
    for axes, (title, values) in zip((before, after), errors, strict=True):
        for k, name in enumerate(_AXES):
            axes.errorbar(
                turning + 0.02 * (k - 1),
                1e3 * values[:, k],
                yerr=2e3 * result.stretches.gyro_sigma[:, k],
                fmt="o",
                ms=3,
                lw=0.8,
                color=style.AXIS_COLOURS[name],
                label=f"{name}: b = {result.bias[k]:.5f} $\\pm$ {2 * result.bias_sigma[k]:.1g}",
            )
        axes.axhline(0.0, color=style.MUTED_COLOUR, lw=0.8)
        axes.set_xlabel("rate of the table [rad/s]")
        axes.set_ylabel("mrad/s")
        axes.set_title(title)
    _legend_above(before, "gyroscope: bias in rad/s")
    figure.suptitle(
        f"Rate table: {result.stretches.stretches} stretches "
        "(bars: 2 standard errors of the readings; right: without the bias' walk)"
    )
    style.save(figure, path)


def _legend_above(axes: Axes, title: str) -> None:
    """Make room above the points and put the legend there."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.35 * (high - low))
    axes.legend(title=title, loc="upper center", ncol=3, fontsize=7, handletextpad=0.1)


def draw_temperature(result: Temperature, path: str | Path) -> None:
    """Write bias and scale of both triads against temperature, with 95 % bands."""
    figure, panels = style.panels(2, 2, 11.5, 7.5)
    triads = (
        ("gyroscope", result.gyroscope, "rad/s"),
        ("accelerometer", result.accelerometer, "m/s$^2$"),
    )
    for row, (name, triad, unit) in enumerate(triads):
        _draw_bias(panels[2 * row], triad, result.reference)
        panels[2 * row].set_ylabel(f"bias [{unit}]")
        panels[2 * row].set_title(f"{name}: bias")
        _draw_scale(panels[2 * row + 1], triad, result.reference)
        panels[2 * row + 1].set_ylabel("change of scale [ppm]")
        panels[2 * row + 1].set_title(f"{name}: scale against that at {result.reference:g} °C")
    for axes in panels:
        axes.set_xlabel("temperature [°C]")
    figure.suptitle("Temperature: readings (points), fitted polynomials and their 95 % bands")
    style.save(figure, path)


def _draw_bias(axes: Axes, triad: TriadTemperature, reference: float) -> None:
    for k, axis in enumerate(triad.axes):
        grid, powers = _grid(triad.difference, len(axis.bias))
        curve = powers @ axis.bias
        start = len(axis.gain)
        part = axis.covariance[start : start + len(axis.bias), start : start + len(axis.bias)]
        points = _polynomial(axis.bias, triad.difference) + axis.residuals
        _draw_curve(axes, k, reference + triad.difference, points)
        _draw_band(axes, k, reference + grid, curve, polynomial_sigma(powers, part), len(axis.bias))
    axes.legend()


def _draw_scale(axes: Axes, triad: TriadTemperature, reference: float) -> None:
    for k, axis in enumerate(triad.axes):
        if triad.inputs.shape[1] == 0:
            axes.text(0.5, 0.5, "one orientation: not seen", transform=axes.transAxes, ha="center")
            return
        grid, powers = _grid(triad.difference, len(axis.scale) + 1)
        points, at = _scale_points(axis, triad, k)
        _draw_curve(axes, k, reference + at, 1e6 * points)
        curve = powers[:, 1:] @ axis.scale
        start = len(axis.gain) + len(axis.bias)
        sigma = polynomial_sigma(powers[:, 1:], axis.covariance[start:, start:])
        _draw_band(axes, k, reference + grid, 1e6 * curve, 1e6 * sigma, len(axis.scale) + 1)
    axes.legend()


def _scale_points(axis: AxisResponse, triad: TriadTemperature, k: int) -> tuple[Array, Array]:
    """Return the scale that single readings show, where the axis' own input is large."""
    response = triad.inputs @ axis.gain
    large = np.abs(triad.inputs[:, k]) > 0.5 * np.max(np.abs(triad.inputs[:, k]))
    scale = _polynomial(np.concatenate([[0.0], axis.scale]), triad.difference)
    return (scale + axis.residuals / response)[large], triad.difference[large]


def _polynomial(coefficients: Array, x: Array) -> Array:
    result: Array = x[:, None] ** np.arange(len(coefficients)) @ coefficients
    return result


def _grid(difference: Array, terms: int) -> tuple[Array, Array]:
    grid = np.linspace(difference.min(), difference.max(), 200)
    return grid, grid[:, None] ** np.arange(terms)


def _draw_curve(axes: Axes, k: int, x: Array, points: Array) -> None:
    axes.plot(x, points, ".", ms=2, alpha=0.35, color=style.AXIS_COLOURS[_AXES[k]])


def _draw_band(axes: Axes, k: int, x: Array, curve: Array, sigma: Array, terms: int) -> None:
    colour = style.AXIS_COLOURS[_AXES[k]]
    axes.plot(x, curve, color=colour, label=f"{_AXES[k]}: order {terms - 1}")
    axes.fill_between(x, curve - 1.96 * sigma, curve + 1.96 * sigma, color=colour, alpha=0.25, lw=0)
