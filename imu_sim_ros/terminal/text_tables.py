# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results as text: lines and tables that fit the terminal."""

import html
import itertools
import shutil
import sys
import textwrap
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

_TITLE_WIDTH: Final = 80
"""Width of titles if there is no terminal [characters]."""
_INDENT: Final = 2
"""Spaces before the rows below a heading."""


class TextTable(NamedTuple):
    """A table of a result, its cells as text."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    title: str = ""


def html_of(lines: Iterable[str | TextTable]) -> str:
    """Return lines and tables as HTML, for notebooks."""
    return "".join(
        _html_table(line) if isinstance(line, TextTable) else f"<div>{html.escape(line)}</div>"
        for line in lines
    )


def _html_table(table: TextTable) -> str:
    """Return the element ``table`` of a table, with its title as the caption."""
    caption = f"<caption>{html.escape(table.title)}</caption>" if table.title else ""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in table.header)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
        for row in table.rows
    )
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def print_lines(lines: Iterable[str | TextTable]) -> None:
    """Print lines and tables in their order; a terminal shows long lines broken between words."""
    for line in lines:
        if isinstance(line, TextTable):
            print_table(*line)
        elif sys.stdout.isatty() and len(line) > (columns := shutil.get_terminal_size().columns):
            print(textwrap.fill(line, columns, subsequent_indent="  ", break_on_hyphens=False))
        else:
            print(line)


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], title: str = "") -> None:
    """Print an aligned table: the first column to the left, the others to the right.

    A title longer than 80 letters, or than the terminal is wide, goes on in the next line.
    On a terminal too narrow for it the columns move together; if that is not enough, the leading
    columns become headings of groups of rows; and if even the last two columns are too wide, each
    row becomes a block with a line for each column: no number is ever cut.
    """
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    needed = sum(widths) + 3 * len(widths)
    terminal = shutil.get_terminal_size().columns if sys.stdout.isatty() else _TITLE_WIDTH
    title = textwrap.fill(title, min(terminal, _TITLE_WIDTH))
    if sys.stdout.isatty() and needed > terminal:
        for headings in range(len(widths) - 1):
            lines = _group_columns(header, rows, headings)
            if max(map(len, lines)) <= terminal:
                break
        else:
            lines = stacked_lines(header, rows)
        print("\n".join([title, *lines] if title else lines))
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
    # A title may be longer than its table is wide; rich would fit it to the table.
    print("\n".join([title, *lines] if title else lines))


def _group_columns(
    header: Sequence[str], rows: Sequence[Sequence[str]], headings: int
) -> list[str]:
    """Return a table as lines, two spaces between its columns.

    :param headings: number of leading columns that become a line above the rows that share them,
        such as "imu: mpu6000, rate: 200"
    """
    columns = list(zip(header, *rows, strict=True))[headings:]
    widths = [max(map(len, column)) for column in columns]
    indent = " " * (_INDENT if headings else 0)

    def aligned(row: Sequence[str]) -> str:
        cells = [f"{cell:>{width}}" for cell, width in zip(row[1:], widths[1:], strict=True)]
        return indent + "  ".join([f"{row[0]:{widths[0]}}", *cells])

    lines = [aligned(header[headings:])]
    lines.append(aligned(["\N{BOX DRAWINGS LIGHT HORIZONTAL}" * width for width in widths]))
    for heading, group in itertools.groupby(rows, lambda row: row[:headings]):
        if headings:
            cells = zip(header, heading, strict=False)
            lines.append(", ".join(f"{name}: {cell}" if name else cell for name, cell in cells))
        lines += [aligned(row[headings:]) for row in group]
    return lines


def stacked_lines(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table as lines: a block for each row, a line for each further column."""
    width = max((len(name) for name in header[1:]), default=0)
    lines = []
    for row in rows:
        lines.append(f"{header[0]}: {row[0]}" if header[0] else row[0])
        pairs = zip(header[1:], row[1:], strict=True)
        lines += [f"  {name:{width}}  {value}" for name, value in pairs]
    return lines
