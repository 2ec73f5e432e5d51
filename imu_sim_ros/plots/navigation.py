# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of trajectories, their errors, and what evaluation says of them."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from imu_sim_ros.plots import style

Array = NDArray[np.float64]
Series = tuple[Array, Array]
"""Times (n,) [s], and a value at each (n,)."""

_MOST_POINTS: Final = 4000
_LARGEST_VIEW: Final = 1.5
"""Half the width of a view, in extents of the truth."""
_SMALLEST_VIEW: Final = 1.0
"""Half the width of the view of a body at rest [m]."""


def trajectories(
    paths: Mapping[str, Array],
    truth: Array | None,
    position_errors: Mapping[str, Series],
    attitude_errors: Mapping[str, Series],
) -> Figure:
    """Draw paths in top and side view, and their errors over time on log axes.

    :param paths: positions (n, 3) [m] by name.
    :param truth: true positions (m, 3) [m].
    :param position_errors: lengths [m] by name.
    :param attitude_errors: angles [rad] by name.
    """
    with_errors = bool(position_errors)
    rows = 2 if with_errors else 1
    figure, axes = style.panels(rows + 1, 2, 9.0, 3.9 * rows + 0.5)
    looks = _looks(list(paths))
    for axis, (across, up) in zip(axes[:2], ((0, 1), (0, 2)), strict=True):
        _view(axis, paths, truth, looks, across, up)
    if with_errors:
        _errors(axes[2], position_errors, looks, "position error [m]", 1.0)
        _errors(axes[3], attitude_errors, looks, "attitude error [deg]", 180.0 / np.pi)
    _legend(figure, axes)
    return figure


def evaluation(
    t: Array, estimate: Array, truth: Array, position_error: Array, attitude_error: Array
) -> Figure:
    """Draw an aligned estimate with the truth, and the errors per axis over time.

    :param t: (n,) times [s].
    :param estimate: (n, 3) positions [m].
    :param truth: (n, 3) positions at the same times [m].
    :param position_error: (n, 3) truth less estimate [m].
    :param attitude_error: (n, 3) rotation vectors about the world's axes [rad].
    """
    figure, axes = style.panels(2, 2, 9.0, 7.8)
    looks = _looks(["estimate"])
    _view(axes[0], {"estimate": estimate}, truth, looks, 0, 1)
    _view(axes[1], {"estimate": estimate}, truth, looks, 0, 2)
    degrees = np.degrees(attitude_error)
    for axis, errors, label in (
        (axes[2], position_error, "position error [m]"),
        (axes[3], degrees, "attitude error [deg]"),
    ):
        for name, colour in style.AXIS_COLOURS.items():
            shown = _thinned(errors[:, "xyz".index(name)])
            axis.plot(_thinned(t), shown, color=colour, label=name)
        axis.set_xlabel("time [s]")
        axis.set_ylabel(label)
    axes[0].legend(loc="best")
    axes[2].legend(loc="best", ncols=3)
    return figure


def _legend(figure: Figure, axes: Sequence[Axes]) -> None:
    """Turn the last row of panels into one legend for all lines of the first panel."""
    grid = axes[0].get_gridspec()
    assert grid is not None
    grid.set_height_ratios([1.0] * (grid.nrows - 1) + [0.16])
    for axis in axes[-2:]:
        axis.remove()
    row = figure.add_subplot(grid[-1, :])
    row.axis("off")
    handles, labels = axes[0].get_legend_handles_labels()
    row.legend(handles, labels, loc="center", ncols=3, frameon=False, fontsize=8.0)


def _view(
    axis: Axes,
    paths: Mapping[str, Array],
    truth: Array | None,
    looks: Mapping[str, dict[str, Any]],
    across: int,
    up: int,
) -> None:
    if truth is not None:
        shown = _thinned(truth)
        axis.plot(shown[:, across], shown[:, up], color=style.TRUTH_COLOUR, lw=3.0, label="truth")
    for name, path in paths.items():
        shown = _thinned(path)
        axis.plot(shown[:, across], shown[:, up], label=name, **looks[name])
    if up == 1:
        axis.set_aspect("equal", adjustable="box")
    if truth is not None:
        _keep_in_view(axis, truth[:, (across, up)])
    axis.set_xlabel(f"{'xyz'[across]} [m]")
    axis.set_ylabel(f"{'xyz'[up]} [m]")
    axis.set_title("top view (x-y)" if up == 1 else "side view (x-z)")


def _keep_in_view(axis: Axes, truth: Array) -> None:
    """Let a path that drifts away leave the picture, before the truth becomes a dot in it.

    :param truth: (n, 2) [m].
    """
    centre = 0.5 * (truth.min(axis=0) + truth.max(axis=0))
    reach = max(_LARGEST_VIEW * float(np.max(np.ptp(truth, axis=0))), _SMALLEST_VIEW)
    for limits, set_limits, middle in (
        (axis.get_xlim(), axis.set_xlim, centre[0]),
        (axis.get_ylim(), axis.set_ylim, centre[1]),
    ):
        set_limits(max(limits[0], middle - reach), min(limits[1], middle + reach))


def _errors(
    axis: Axes,
    errors: Mapping[str, Series],
    looks: Mapping[str, dict[str, Any]],
    label: str,
    scale: float,
) -> None:
    for name, (t, error) in errors.items():
        t, error = _thinned(t), _thinned(error) * scale
        axis.plot(t[error > 0.0], error[error > 0.0], label=name, **looks[name])
    axis.set_yscale("log")
    axis.set_xlabel("time [s]")
    axis.set_ylabel(label)


def _looks(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return colour and line by name; names that begin alike up to a comma share the colour."""
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(name.partition(",")[0], []).append(name)
    return {
        name: {"color": style.PALETTE[g % len(style.PALETTE)], "ls": ("-", "--", ":")[k % 3]}
        for g, members in enumerate(groups.values())
        for k, name in enumerate(members)
    }


def _thinned(values: Array) -> Array:
    """Return at most some thousand rows, the last one among them: a picture shows no more."""
    step = -(-len(values) // _MOST_POINTS)
    return values[(len(values) - 1) % step :: step]
