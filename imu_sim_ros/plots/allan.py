# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Allan deviation with its band and the fitted terms."""

from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from imu_sim_ros.calibration.noise.analysis import AllanResult
from imu_sim_ros.calibration.noise.estimate import RAMP
from imu_sim_ros.calibration.noise.gauss_markov import CORRELATION_TIME, SIGMA
from imu_sim_ros.calibration.noise.terms import (
    QUANTITIES,
    TERMS,
    gauss_markov_deviation,
    ramp_deviation,
)
from imu_sim_ros.core.conventions import AXIS_COLOURS, TRIADS, TRUTH_COLOUR
from imu_sim_ros.core.digits import plus_minus, upper_bound
from imu_sim_ros.core.types import Array
from imu_sim_ros.plots import style
from imu_sim_ros.plots.style import Figure

_SHORT_UNITS: Final = {"gyroscope": "rad/s", "accelerometer": "m/s$^2$"}
_LINES: Final = {"Q": ":", "N": "--", "B": "-.", "K": "--", "R": ":", "sigma": "-."}
_DRAWN: Final = (
    Patch(color=style.MUTED_COLOUR, alpha=0.3, label="95 %"),
    Line2D([], [], color=TRUTH_COLOUR, lw=1.0, label="model (mean axis)"),
    Line2D([], [], color=style.MUTED_COLOUR, ls="--", lw=1.0, label="its terms"),
)
"""Entries of the legend above the panels."""


def draw(result: AllanResult, path: str | Path, source: str = "") -> None:
    """Write the picture of :func:`figure`."""
    style.save(figure(result, source), path)


def figure(result: AllanResult, source: str = "") -> Figure:
    """Return the picture: a panel for each triad; dashed lines are the terms, of the mean axis.

    :param source: name of the bag or the sensor, for the title.
    """
    picture, panels = style.panels(1, 2, 10.0, 5.6)
    for triad, axes in enumerate(panels):
        _draw_triad(result, triad, axes)
    prefix = f"{source}: o" if source else "O"
    style.draw_heading(picture, f"{prefix}verlapping Allan deviation, {result.record}")
    return picture


def _draw_triad(result: AllanResult, triad: int, axes: Axes) -> None:
    """Draw the Allan deviation of one triad with its band and the fitted terms."""
    deviation = result.deviation
    tau = deviation.tau
    for k, name in enumerate("xyz"):
        column = 3 * triad + k
        if result.noise[column] is None:
            continue
        colour = AXIS_COLOURS[name]
        axes.fill_between(
            tau, deviation.low[:, column], deviation.high[:, column], color=colour, alpha=0.15, lw=0
        )
        axes.loglog(tau, deviation.deviation[:, column], color=colour, label=_label(result, column))
    _draw_model(result, triad, axes)
    axes.set_xscale("log")
    axes.set_yscale("log")
    curves = deviation.deviation[:, 3 * triad : 3 * triad + 3]
    positive = curves[curves > 0.0]
    if len(positive):
        axes.set_ylim(positive.min() / 3.0, positive.max() * 2.0)
    style.small_ticks(axes)
    axes.set_xlabel("cluster time [s]")
    axes.set_ylabel(f"Allan deviation [{_SHORT_UNITS[TRIADS[triad]]}]")
    style.title(axes, TRIADS[triad])
    if axes.get_legend_handles_labels()[0]:
        axes.add_artist(style.add_legend_above(axes, 3, handles=_DRAWN))
        axes.legend(
            loc="upper center",
            bbox_to_anchor=(0.5, -0.1),  # below the panel: inside it would hide a curve
            frameon=False,
            title=_units(result, triad),
            fontsize=8.5,
            title_fontsize=8.5,
        )


def _units(result: AllanResult, triad: int) -> str:
    """Return the units of the terms that the legend has."""
    units = []
    for key in result.keys:
        q = QUANTITIES[TRIADS[triad], key]
        estimates = [result.estimate(3 * triad + k, key) for k in range(3)]
        if key == "random_walk" or any(estimate.value is not None for estimate in estimates):
            units.append(f"{q.symbol} [{q.unit}]")
    return f"{', '.join(units)}; ± half the 95 % interval"


def _label(result: AllanResult, column: int) -> str:
    """Return the legend of an axis: its terms with their values."""
    terms = []
    for key in result.keys:
        estimate = result.estimate(column, key)
        symbol = QUANTITIES[TRIADS[column // 3], key].symbol
        if estimate.value is not None:
            terms.append(
                f"{symbol} = {plus_minus(estimate.value, 0.5 * (estimate.high - estimate.low))}"
            )
        elif key == "random_walk":
            terms.append(f"{symbol} {upper_bound(estimate.high)}")
    return f"{'xyz'[column % 3]}: " + ", ".join(terms)


def _draw_model(result: AllanResult, triad: int, axes: Axes) -> None:
    """Draw the terms of the mean axis as grey lines and their sum in black."""
    tau = result.deviation.tau
    parts = [line for line in _terms(result, triad, tau) if np.any(line[1] > 0.0)]
    if not parts:
        return
    for symbol, line in parts:
        axes.loglog(tau, line, color=style.MUTED_COLOUR, linestyle=_LINES[symbol], lw=1.0)
        end = 0 if line[0] > line[-1] else -1
        axes.annotate(
            symbol,
            (tau[end], line[end]),
            color=style.MUTED_COLOUR,
            xytext=(-12 if end == 0 else 4, -3),
            textcoords="offset points",
        )
    total = np.sqrt(np.sum([line**2 for _, line in parts], axis=0))
    axes.loglog(tau, total, color=TRUTH_COLOUR, lw=1.0)


def _terms(result: AllanResult, triad: int, tau: Array) -> list[tuple[str, Array]]:
    """Return the lines of the fitted terms and of their sum."""
    lines = []
    for term in TERMS:
        symbol = QUANTITIES[TRIADS[triad], term.key].symbol
        lines.append((symbol, term.deviation(tau) * _mean(result, triad, term.key)))
    if RAMP in result.keys:
        lines.append(("R", ramp_deviation(tau) * _mean(result, triad, RAMP)))
    if SIGMA in result.keys:
        time = _mean(result, triad, CORRELATION_TIME)
        if time > 0.0:
            shape = gauss_markov_deviation(tau, time)
            lines.append(("sigma", shape * _mean(result, triad, SIGMA)))
    return lines


def _mean(result: AllanResult, triad: int, key: str) -> float:
    """Return the root mean square of the axes that have a value, 0 if none has."""
    if key not in result.keys:
        return 0.0
    values = [result.estimate(3 * triad + k, key).value for k in range(3)]
    numbers = [value for value in values if value is not None]
    return float(np.sqrt(np.mean(np.square(numbers)))) if numbers else 0.0
