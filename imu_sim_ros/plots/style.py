# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The common look of all pictures: colours, figures without a display, saving."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib
import matplotlib.figure
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.markers import TICKDOWN, TICKLEFT, MarkerStyle
from matplotlib.ticker import NullLocator

MUTED_COLOUR: Final = "#8A8A8A"
_FAINT: Final = "#EEEEEE"
_THIN: Final = 0.4
"""Width of grid lines [points]."""
_BELOW: Final = 0.4
"""Order of drawing: below matplotlib's own grid, at 0.5."""

_TITLE_SIZE: Final = 10.0
"""Size of the axes' titles [points]."""
_HEADING_SIZE: Final = 11.0
"""Size of the picture's title [points]."""
_SETTINGS: Final[Any] = {
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.3,
}
_PIXELS_PER_INCH: Final = 130
"""Resolution of files."""
_NOTEBOOK_PIXELS_PER_INCH: Final = 80
"""Resolution of pictures in notebooks."""


class Figure(matplotlib.figure.Figure):
    """A matplotlib figure that a notebook shows without pyplot, which keeps figures alive."""

    def _repr_png_(self) -> bytes:
        """Return the figure as PNG, for notebooks."""
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=_NOTEBOOK_PIXELS_PER_INCH)
        return buffer.getvalue()


def figure(width: float = 8.0, height: float = 5.0) -> Figure:
    """Return an empty figure that needs neither a display nor global state.

    :param width: width in inches.
    :param height: height in inches.
    """
    with matplotlib.rc_context(_SETTINGS):
        result = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(result)
    return result


def panels(
    rows: int,
    columns: int,
    width: float = 8.0,
    height: float = 5.0,
    *,
    sharex: bool = False,
    sharey: bool = False,
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels, row by row."""
    result = figure(width, height)
    with matplotlib.rc_context(_SETTINGS):
        grid = result.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey)
    axes = [axis for row in grid for axis in row]
    for axis in axes:
        style_panel(axis)
    return result, axes


def log_values(axes: Axes) -> None:
    """Make a panel's values logarithmic; below two decades the numbers are plain: 0.5, 1, 2."""
    axes.set_yscale("log")
    power_formatter = axes.yaxis.get_major_formatter()

    def label(value: float, position: float) -> str:
        low, high = axes.yaxis.get_view_interval()
        is_power = bool(np.isclose(value, 10.0 ** np.round(np.log10(value))))
        if high < 100.0 * low:
            digit = round(value / 10.0 ** np.floor(np.log10(value) + 1e-9))
            return f"{value:g}" if digit in (1, 2, 5) else ""
        return power_formatter(value, int(position or 0)) if is_power else ""

    axes.yaxis.set_major_formatter(label)
    axes.yaxis.set_minor_formatter(label)


def small_ticks(axes: Axes) -> None:
    """Draw the small ticks of logarithmic axes, with faint lines at them, all as one line each.

    Each of matplotlib's own is several objects: a hundred of them take longer than all the rest of
    a picture. The axes keep their own if these have labels, below a decade. Call it last: the
    ticks are those of the limits at this moment.
    """
    vertical, across = axes.get_xaxis_transform(), axes.get_yaxis_transform()
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        if high <= 10.0 * low:
            axis.grid(True, which="minor", color=_FAINT, linewidth=_THIN)
            continue
        positions = np.asarray(axis.get_minor_locator().tick_values(low, high))
        positions = positions[(positions >= low) & (positions <= high)]
        axis.set_minor_locator(NullLocator())
        along, ends = np.repeat(positions, 3), np.tile([0.0, 1.0, np.nan], len(positions))
        if axis is axes.xaxis:
            lines = Line2D(along, ends, transform=vertical)
            ticks = Line2D(
                positions, 0.0 * positions, transform=vertical, marker=MarkerStyle(TICKDOWN)
            )
        else:
            lines = Line2D(ends, along, transform=across)
            ticks = Line2D(
                0.0 * positions, positions, transform=across, marker=MarkerStyle(TICKLEFT)
            )
        lines.set(color=_FAINT, linewidth=_THIN, zorder=_BELOW)
        ticks.set(color="black", markersize=2.0, markeredgewidth=0.6, linestyle="none")
        ticks.set(zorder=_BELOW, clip_on=False)
        axes.add_artist(lines)
        axes.add_artist(ticks)


def style_panel(axes: Axes) -> None:
    """Draw a light grid, and no frame on the right and at the top of a panel."""
    axes.grid(True, which="major", color="#DDDDDD", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def title(axes: Axes, text: str) -> None:
    """Write a panel's title at the left; the right is for the legend above it."""
    axes.set_title(text, loc="left", fontsize=_TITLE_SIZE)


def draw_heading(picture: Figure, text: str) -> None:
    """Write the heading of a picture."""
    picture.suptitle(text, fontsize=_HEADING_SIZE)


def add_legend_above(
    axes: Axes, ncols: int, title: str | None = None, handles: Sequence[Artist] | None = None
) -> Legend:
    """Add a legend above a panel, at the right.

    :param handles: entries; None: everything with a label in the panel.
    """
    return axes.legend(
        handles=axes.get_legend_handles_labels()[0] if handles is None else handles,
        title=title,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=ncols,
        fontsize=8.0,
        title_fontsize=8.0,
        handlelength=1.5,
        columnspacing=1.2,
        borderaxespad=0.2,
        frameon=False,
    )


def save(picture: Figure, path: str | Path) -> None:
    """Write a figure; the file's ending chooses the format (png, svg, pdf).

    :raises OSError: if the file cannot be written.
    """
    if Path(path).suffix != ".png":
        picture.savefig(path, dpi=_PIXELS_PER_INCH)
        return
    pixels_per_inch, picture.dpi = picture.dpi, _PIXELS_PER_INCH
    try:
        canvas: Any = FigureCanvasAgg(picture)
        canvas.print_png(path)  # savefig would draw twice
    finally:
        picture.dpi = pixels_per_inch
