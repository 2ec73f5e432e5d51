# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who follows a job: a program prints its lines and shows its progress, in Python nobody does."""

import sys
from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Final

Advance = Callable[..., None]
"""Receives how many more are done."""
Bar = Callable[..., AbstractContextManager[Advance]]
"""Shows a text and progress up to a total."""


def _nothing(what: object) -> None:
    """Nobody wants to know."""


@dataclass(frozen=True)
class Watcher:
    """Receivers of a job's progress and lines; all are idle by default."""

    bar: Bar | None = None
    warn: Callable[[str], None] = _nothing
    """Receives lines about what is allowed but may be unintended."""
    remark: Callable[[str], None] = _nothing
    """Receives lines about what is left out, or was found on the way."""
    note: Callable[[str], None] = _nothing
    """Receives lines about what was chosen."""
    undisturbed: Callable[[], AbstractContextManager[object]] = nullcontext
    """Holds signals while outputs get their names."""
    interrupted: Callable[[], bool] = bool
    """Returns whether the job has been interrupted, so that nobody uses what is under way."""
    complete: Callable[[Path], None] = _nothing
    """Receives each output that has its name."""


_watcher: ContextVar[Watcher] = ContextVar("watcher", default=Watcher())  # noqa: B039 - frozen


def watcher() -> Watcher:
    """Return the receivers of jobs that begin now."""
    return _watcher.get()


def check_interrupted() -> None:
    """End long work in a thread whose job has been interrupted.

    :raises KeyboardInterrupt: if it has; the thread that waits for the result is interrupted, too.
    """
    if _watcher.get().interrupted():
        raise KeyboardInterrupt


def watch_thread(follower: Watcher) -> None:
    """Set the receivers of the jobs of this thread, which does not inherit its parent's."""
    _watcher.set(follower)


@contextmanager
def watched_by(follower: Watcher) -> Iterator[None]:
    """Set the receivers of the jobs in a block."""
    token = _watcher.set(follower)
    try:
        yield
    finally:
        _watcher.reset(token)


@contextmanager
def progress(text: str, total: Callable[[], int], **details: int) -> Iterator[Advance]:
    """Yield the function that receives progress.

    :param total: returns how much there is to do; called if somebody looks.
    :param details: ``done``, how much there was before.
    """
    bar = _watcher.get().bar
    if bar is None:
        yield lambda count, remark="": None
    else:
        with bar(text, total(), **details) as advance:
            yield advance


_UNKNOWN_TIME: Final = "-:--:--"
_LONGEST_TIME: Final = 3.6e7
"""Longest time that is shown, ten thousand hours [s]."""
_BURST: Final = 1.1
"""Multiple of the first part's time within which parts count as one burst."""


@contextmanager
def terminal_bar(text: str, total: int, done: int = 0) -> Iterator[Advance]:
    """Show a bar with speed and time left on a terminal; yields ``advance(count, text)``.

    On a narrow terminal the text is cut off, the numbers never. Nothing is shown, and nothing
    imported, if standard error is not a terminal.

    :param done: how much of the total was there before; speed and time left are those of the rest.
    """
    if not sys.stderr.isatty():
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
        pace = ProgressRate()
        task = bar.add_task(text, total=total, completed=done, speed="", left=_UNKNOWN_TIME)

        def advance(count: int, remark: str = "") -> None:
            """Count on; what there is to say now stands behind the text."""
            description = ": ".join(part for part in (text, remark) if part)
            bar.update(task, advance=count, description=description)
            now_done = bar.tasks[0].completed
            speed, remaining = pace.after(
                now_done - done, total - now_done, bar.tasks[0].elapsed or 0
            )
            bar.update(task, speed=speed, left=remaining)

        yield advance


class ProgressRate:
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
    """Return a number per second in few digits; nothing if it is not known yet."""
    if not speed:
        return ""
    if speed < 1e4:
        return f"{speed:,.0f}/s" if speed >= 10.0 else f"{speed:.2g}/s"
    return f"{speed / 1e3:,.0f} k/s"
