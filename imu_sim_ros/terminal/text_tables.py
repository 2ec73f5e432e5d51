# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results as text: lines and tables that fit the terminal."""

import html
import math
import shutil
import sys
from collections.abc import Iterable, Sequence
from typing import NamedTuple


class TextTable(NamedTuple):
    """A table of a result in words."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    title: str = ""


def interval_text(value: float, low: float, high: float) -> tuple[str, str, str]:
    """Return a value and the ends of its interval with two digits of half the interval's width.

    All have the same last place, which is finer if an end that differs would look like the value.
    """
    largest = max(abs(value), abs(low), abs(high))
    half = 0.5 * (high - low)
    if not (math.isfinite(largest) and half > 0.0):
        return f"{value:.4g}", f"{low:.4g}", f"{high:.4g}"
    exponent = math.floor(math.log10(largest))
    places = 1 - math.floor(math.log10(half))
    plain, numbers = -4 <= exponent < 6, (value, low, high)
    for place in range(places, places + 10):
        if plain:
            texts = [f"{number:.{max(place, 0)}f}" for number in numbers]
        else:
            scale, digits = 10.0**exponent, max(place + exponent, 0)
            texts = [f"{number / scale:.{digits}f}e{exponent:+03d}" for number in numbers]
        texts = [
            "0" if number == 0.0 else part for number, part in zip(numbers, texts, strict=True)
        ]
        middle, bottom, top = texts
        if (low == value or bottom != middle) and (high == value or top != middle):
            break
    return middle, bottom, top


def plus_minus(value: float, half: float) -> str:
    """Return a value with half the width of its interval, which has two digits.

    The form is ``1.234 +- 0.056``, or ``(1.234 +- 0.056)e-05``.
    """
    if not (half > 0.0 and math.isfinite(max(abs(value), half))):
        return f"{value:.4g}"
    exponent = math.floor(math.log10(max(abs(value), half)))
    if -3 <= exponent < 4:
        exponent = 0
    places = max(1 - math.floor(math.log10(half)) + exponent, 0)
    scale = 10.0**exponent
    text = f"{value / scale:.{places}f} \N{PLUS-MINUS SIGN} {half / scale:.{places}f}"
    return text if exponent == 0 else f"({text})e{exponent:+03d}"


def html_of(lines: Iterable[str | TextTable]) -> str:
    """Return lines and tables as HTML, for notebooks."""
    return "".join(
        _html_table(line) if isinstance(line, TextTable) else f"<div>{html.escape(line)}</div>"
        for line in lines
    )


def _html_table(table: TextTable) -> str:
    caption = f"<caption>{html.escape(table.title)}</caption>" if table.title else ""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in table.header)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
        for row in table.rows
    )
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def print_lines(lines: Iterable[str | TextTable]) -> None:
    """Print lines and tables in their order."""
    for line in lines:
        if isinstance(line, TextTable):
            print_table(*line)
        else:
            print(line)


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], title: str = "") -> None:
    """Print an aligned table: the first column to the left, the others to the right.

    On a terminal too narrow for it the columns move together; if that is not enough, each row
    becomes a block with a line for each column: no number is ever cut.
    """
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    needed = sum(widths) + 3 * len(widths)
    if sys.stdout.isatty() and needed > (terminal := shutil.get_terminal_size().columns):
        close = sum(widths) + 2 * (len(widths) - 1) <= terminal
        print("\n".join((_close if close else stacked)(header, rows, title)))
        return
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD)
    for k, name in enumerate(header):
        table.add_column(name, justify="right" if k else "left", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    # A pipe has no width: every row stays on one line. Units stand in brackets, which are markup to
    # rich.
    width = None if sys.stdout.isatty() else max(160, needed + 4)
    console = Console(width=width, highlight=False, markup=False)
    with console.capture() as captured:
        console.print(table)
    lines = [line.rstrip() for line in captured.get().splitlines()]
    # A title may be longer than its table is wide; the table's own would be wrapped.
    print("\n".join([title, *lines] if title else lines))


def _close(header: Sequence[str], rows: Sequence[Sequence[str]], title: str) -> list[str]:
    """Return a table as lines, two spaces between its columns."""
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    lines = [title] if title else []
    for row in (header, ["\N{BOX DRAWINGS LIGHT HORIZONTAL}" * width for width in widths], *rows):
        first, *others = row
        cells = [f"{cell:>{width}}" for cell, width in zip(others, widths[1:], strict=True)]
        lines.append("  ".join([f"{first:{widths[0]}}", *cells]))
    return lines


def stacked(header: Sequence[str], rows: Sequence[Sequence[str]], title: str = "") -> list[str]:
    """Return a table as lines: a block for each row, a line for each further column."""
    width = max((len(name) for name in header[1:]), default=0)
    lines = [title] if title else []
    for row in rows:
        lines.append(f"{header[0]}: {row[0]}" if header[0] else row[0])
        pairs = zip(header[1:], row[1:], strict=True)
        lines += [f"  {name:{width}}  {value}" for name, value in pairs]
    return lines
