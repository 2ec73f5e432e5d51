# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results as tables and JSON, and progress."""

import shutil
import sys
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Final

from imu_sim_ros.json_text import as_json

_UNKNOWN_TIME: Final = "-:--:--"
_LONGEST_TIME: Final = 3.6e7
"""[s]; ten thousand hours."""
_BURST: Final = 1.1
"""What comes until this multiple of the first part's time is counted as one burst."""


def print_json(result: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print a result as one JSON object; what is not finite is null."""
    print(as_json(result))


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], title: str = "") -> None:
    """Print an aligned table: the first column to the left, the others to the right.

    On a terminal too narrow for it the columns move together; where that is not enough, each row
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


@contextmanager
def progress(
    text: str, total: int, quiet: bool = False, done: int = 0
) -> Iterator[Callable[..., None]]:
    """Show a bar with speed and time left on a terminal; yields ``advance(count, text)``.

    On a narrow terminal the text is cut off, the numbers never. Nothing is shown, and nothing
    imported, where standard error is not a terminal.

    :param done: how much of the total was there before; speed and time left are those of the rest.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda count, text="": None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
    )
    from rich.table import Column

    columns = (
        TextColumn("{task.description}", table_column=Column(no_wrap=True, ratio=2)),
        BarColumn(None, table_column=Column(ratio=1)),
        TaskProgressColumn(),
        TextColumn("{task.fields[speed]}"),
        TextColumn("{task.fields[left]}"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True, expand=True) as bar:
        pace = Pace()
        task = bar.add_task(text, total=total, completed=done, speed="", left=_UNKNOWN_TIME)

        def advance(count: int, now: str = "") -> None:
            """Count on; what there is to say now stands behind the text."""
            words = f"{text}: {now}" if now else text
            bar.update(task, advance=count, description=words)
            now_done = bar.tasks[0].completed
            speed, left = pace.after(now_done - done, total - now_done, bar.tasks[0].elapsed or 0)
            bar.update(task, speed=speed, left=left)

        yield advance


class Pace:
    """Speed and time left of something that is done in parts, perhaps by several processes.

    What they deliver arrives in bursts, the first only after the processes have started: neither a
    moment nor the time since the start tells the speed. It is taken over the second half of the
    time so far, and not before as much time has passed after the first burst as until then.
    """

    def __init__(self) -> None:
        self._times, self._done = [0.0], [0.0]

    def after(self, done: float, rest: float, elapsed: float) -> tuple[str, str]:
        """Return speed and time left in words.

        :param done: since the start.
        :param rest: what is still to be done.
        :param elapsed: since the start [s].
        """
        if done > self._done[-1] and elapsed > self._times[-1]:
            self._times.append(elapsed)
            self._done.append(done)
        first = _BURST * self._times[min(1, len(self._times) - 1)]
        base = bisect_right(self._times, max(0.5 * elapsed, first)) - 1
        gone, took = done - self._done[base], elapsed - max(self._times[base], first)
        if elapsed < 2.0 * first or not (gone > 0.0 and took > 0.0):
            return "", _UNKNOWN_TIME
        speed = gone / took
        minutes, seconds = divmod(round(min(max(rest, 0.0) / speed, _LONGEST_TIME)), 60)
        return speed_in_words(speed), f"{minutes // 60}:{minutes % 60:02}:{seconds:02}"


def speed_in_words(speed: float | None) -> str:
    """Return a number per second in few digits; nothing where it is not known yet."""
    if not speed:
        return ""
    if speed < 1e4:
        return f"{speed:,.0f}/s" if speed >= 10.0 else f"{speed:.2g}/s"
    return f"{speed / 1e3:,.0f} k/s"
