# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of trajectories, their errors, and what evaluation says of them."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes

from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.conventions import AXIS_COLOURS, SERIES_COLOURS, TRUTH_COLOUR
from imu_sim_ros.core.types import Array, Keywords
from imu_sim_ros.plots import style
from imu_sim_ros.plots.style import Figure

Series = tuple[Array, Array]
"""Times (n,) [s], and a value at each (n,)."""

_MAX_POINTS: Final = 4000
"""Largest number of points of a curve."""
_LARGEST_VIEW: Final = 4.0
"""Half the width of a view, in extents of the truth."""
_SHOWN_FROM: Final = 0.02
"""Part of the errors that may lie below the picture."""
_SMALLEST_VIEW: Final = 1.0
"""Half the width of the view of a body at rest [m]."""


def trajectories(
    paths: Mapping[str, Array],
    truth: Array | None,
    position_errors: Mapping[str, Series],
    attitude_errors: Mapping[str, Series],
    title: str = "",
) -> Figure:
    """Draw paths in top and side view, and their errors over time on log axes.

    :param paths: positions (n, 3) [m] by name.
    :param truth: true positions (m, 3) [m].
    :param position_errors: lengths [m] by name.
    :param attitude_errors: angles [rad] by name.
    :param title: contents and source of the picture.
    """
    has_errors = bool(position_errors)
    rows = 2 if has_errors else 1
    figure, axes = style.panels(rows + 1, 2, 9.0, 3.1 * rows + 0.8)
    looks = _looks(list(paths))
    for axis, (across, up) in zip(axes[:2], ((0, 1), (0, 2)), strict=True):
        _view(axis, paths, truth, looks, across, up)
    if has_errors:
        _errors(axes[2], position_errors, looks, "position error [m]", 1.0)
        _errors(axes[3], attitude_errors, looks, "attitude error [deg]", 180.0 / np.pi)
    finals = {name: f"{name}: {error[-1]:.3g} m" for name, (_, error) in position_errors.items()}
    _legend(figure, axes, finals)
    style.draw_heading(figure, title)
    return figure


def evaluation(
    t: Array,
    estimate: Array,
    truth: Array,
    position_error: Array,
    attitude_error: Array,
    title: str = "",
) -> Figure:
    """Draw an aligned estimate with the truth, and the errors per axis over time.

    :param t: (n,) times [s].
    :param estimate: (n, 3) positions [m].
    :param truth: (n, 3) positions at the same times [m].
    :param position_error: (n, 3) estimate minus truth [m].
    :param attitude_error: (n, 3) rotation vectors about the world's axes [rad].
    :param title: contents and source of the picture.
    """
    figure, axes = style.panels(2, 2, 9.0, 6.4)
    looks = _looks(["estimate"])
    _view(axes[0], {"estimate": estimate}, truth, looks, 0, 1)
    _view(axes[1], {"estimate": estimate}, truth, looks, 0, 2)
    degrees = np.degrees(attitude_error)
    for axis, errors, label, unit in (
        (axes[2], position_error, "position, estimate - truth [m]", "m"),
        (axes[3], degrees, "attitude, estimate - truth [deg]", "deg"),
    ):
        for k, (name, colour) in enumerate(AXIS_COLOURS.items()):
            rms = float(np.sqrt(np.mean(np.square(errors[:, k]))))
            label_of_axis = f"{name}: {rms:.3g} {unit} RMS"
            axis.plot(_thin(t), _thin(errors[:, k]), color=colour, label=label_of_axis)
        axis.set_xlabel("time [s]")
        axis.set_ylabel(label)
        style.add_legend_above(axis, ncols=3)
    style.add_legend_above(axes[0], ncols=2)
    style.draw_heading(figure, title)
    return figure


def _legend(figure: Figure, axes: Sequence[Axes], finals: Mapping[str, str]) -> None:
    """Turn the last row of panels into one legend for all lines of the first panel.

    :param finals: text for the legend of each line, by its name.
    """
    grid = axes[0].get_gridspec()
    assert grid is not None
    for axis in axes[-2:]:
        axis.remove()
    row = figure.add_subplot(grid[-1, :])
    row.axis("off")
    handles, labels = axes[0].get_legend_handles_labels()
    texts = [finals.get(label, label) for label in labels]
    columns = min(3, len(texts))
    lines = ceil_divide(len(texts), columns)
    grid.set_height_ratios([1.0] * (grid.nrows - 1) + [0.03 + 0.07 * (lines + bool(finals))])
    title = "position error at the end" if finals else None
    row.legend(handles, texts, loc="center", ncols=columns, frameon=False, title=title)


def _view(
    axis: Axes,
    paths: Mapping[str, Array],
    truth: Array | None,
    looks: Mapping[str, Keywords],
    across: int,
    up: int,
) -> None:
    """Draw paths seen along one axis of the world."""
    if truth is not None:
        line = _thin(truth)
        axis.plot(
            line[:, across],
            line[:, up],
            color=TRUTH_COLOUR,
            lw=0.8,
            label="truth",
            marker="" if np.any(np.ptp(truth, axis=0)) else "o",  # a body at rest is a point
            ms=4.0,
            zorder=3.0,  # thin, and over the estimates
        )
    for name, path in paths.items():
        line = _thin(path)
        axis.plot(line[:, across], line[:, up], label=name, **looks[name])
    if truth is not None:
        _keep_in_view(axis, truth[:, (across, up)], equal=up == 1)
    if up == 1:  # the panel stays filled: the shorter axis shows more
        axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel(f"{'xyz'[across]} [m]")
    axis.set_ylabel(f"{'xyz'[up]} [m]")
    style.title(axis, "top view (x-y)" if up == 1 else "side view (x-z)")


def _keep_in_view(axis: Axes, truth: Array, equal: bool) -> None:
    """Limit the picture to the surroundings of the truth if a path drifts far away.

    :param truth: (n, 2) true positions [m].
    :param equal: True: a metre is as long across as up.
    """
    centre = 0.5 * (truth.min(axis=0) + truth.max(axis=0))
    extent = np.ptp(truth, axis=0)
    widest = extent.max() if equal else np.maximum(extent, 0.5 * extent.max())
    reaches = np.maximum(_LARGEST_VIEW * widest, _SMALLEST_VIEW)
    reaches = np.broadcast_to(reaches, 2)
    low, high = axis.get_xlim()
    low, high = max(low, centre[0] - reaches[0]), min(high, centre[0] + reaches[0])
    axis.set_xlim(low, high, auto=True)  # auto: an equal aspect may still show more
    heights = [np.asarray(line.get_ydata()) for line in axis.get_lines()]
    across = [np.asarray(line.get_xdata()) for line in axis.get_lines()]
    visible = np.concatenate(
        [y[(x >= low) & (x <= high)] for x, y in zip(across, heights, strict=True)]
    )
    margin = 0.05 * max(float(np.ptp(visible)), 1e-3 * _SMALLEST_VIEW)
    low = max(float(visible.min()) - margin, centre[1] - reaches[1])
    high = min(float(visible.max()) + margin, centre[1] + reaches[1])
    axis.set_ylim(low, high, auto=True)


def _errors(
    axis: Axes,
    errors: Mapping[str, Series],
    looks: Mapping[str, Keywords],
    label: str,
    scale: float,
) -> None:
    """Draw the length of errors over time."""
    floors = []
    for name, (t, error) in errors.items():
        t, error = _thin(t), _thin(error) * scale
        axis.plot(t[error > 0.0], error[error > 0.0], label=name, **looks[name])
        floors += [np.quantile(error[error > 0.0], _SHOWN_FROM)] if np.any(error > 0.0) else []
    if not floors:
        axis.text(0.5, 0.5, "zero throughout", transform=axis.transAxes, ha="center")
    style.log_values(axis)
    if floors:  # an error that starts at zero comes from far below
        axis.set_ylim(bottom=0.5 * float(min(floors)))
    axis.set_xlabel("time [s]")
    axis.set_ylabel(label)


def _looks(names: Sequence[str]) -> dict[str, Keywords]:
    """Return colour, width and dashes by name; names that begin alike up to a comma share a colour.

    Each further group is thinner than the one before and drawn over it, so that lines that coincide
    are seen as one within the other.
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(name.partition(",")[0], []).append(name)
    widths = {1: (1.5,), 2: (2.2, 1.1)}.get(len(groups), (2.4, 1.6, 0.8))
    return {
        name: {
            "color": SERIES_COLOURS[g % len(SERIES_COLOURS)],
            "lw": widths[min(g, len(widths) - 1)],
            "ls": ("-", (0, (4, 2)), (0, (1, 1.5)))[k % 3],
        }
        for g, members in enumerate(groups.values())
        for k, name in enumerate(members)
    }


def _thin(values: Array) -> Array:
    """Return at most some thousand rows, the last one among them: a picture shows no more."""
    step = ceil_divide(len(values), _MAX_POINTS)
    return values[(len(values) - 1) % step :: step]
