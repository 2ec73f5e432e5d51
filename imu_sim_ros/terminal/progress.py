# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Receivers of a job's lines and progress: programs print them; in Python there are none."""

import sys
from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Final

Advance = Callable[..., None]
"""Receives the number of elements that are done since the last call."""
Bar = Callable[..., AbstractContextManager[Advance]]
"""Returns a context in which a text and the progress up to a total are shown."""


def _ignore(line: object) -> None:
    """Ignore a line or an output: the default receiver."""


@dataclass(frozen=True)
class Watcher:
    """Receivers of a job's progress and lines; all are idle by default."""

    bar: Bar | None = None
    """Shows progress; None: nothing is shown."""
    warn: Callable[[str], None] = _ignore
    """Receives warnings: lines about settings that are allowed but may be unintended."""
    remark: Callable[[str], None] = _ignore
    """Receives remarks: lines about the input, such as parts that are left out."""
    note: Callable[[str], None] = _ignore
    """Receives notes: lines about choices that the job made."""
    undisturbed: Callable[[], AbstractContextManager[object]] = nullcontext
    """Holds signals while outputs get their names."""
    interrupted: Callable[[], bool] = bool
    """Returns True if the job has been interrupted: work in its threads can stop."""
    complete: Callable[[Path], None] = _ignore
    """Receives the path of each output that is complete and has its final name."""


_watcher: ContextVar[Watcher] = ContextVar("watcher", default=Watcher())  # noqa: B039 - frozen


def current_watcher() -> Watcher:
    """Return the receivers of jobs that begin now."""
    return _watcher.get()


def check_interrupted() -> None:
    """Raise an exception in a thread whose job has been interrupted; long work calls it often.

    :raises KeyboardInterrupt: if the job has been interrupted.
    """
    if _watcher.get().interrupted():
        raise KeyboardInterrupt


def watch_thread(follower: Watcher) -> None:
    """Set the receivers of the jobs of this thread, which does not inherit its parent's."""
    _watcher.set(follower)


@contextmanager
def watch(follower: Watcher) -> Iterator[None]:
    """Set the receivers of the jobs in a block."""
    token = _watcher.set(follower)
    try:
        yield
    finally:
        _watcher.reset(token)


@contextmanager
def progress(text: str, total: Callable[[], int], **details: int) -> Iterator[Advance]:
    """Yield the function ``advance(count, remark)`` that receives the progress of a block of work.

    :param text: description of the work.
    :param total: returns the number of elements; called only if progress is shown.
    :param details: ``done``, the number of elements that were done before.
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
    """Show a bar with speed and time left on a terminal; yields ``advance(count, remark)``.

    On a narrow terminal the text is cut off, the numbers never. Nothing is shown, and nothing
    imported, if standard error is not a terminal.

    :param done: number of elements that were done before, of which the speed takes no account.
    """
    if not sys.stderr.isatty():
        yield lambda count, remark="": None
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
            """Add to the number of finished elements; show a remark behind the text."""
            description = ": ".join(part for part in (text, remark) if part)
            bar.update(task, advance=count, description=description)
            now_done = bar.tasks[0].completed
            speed, remaining = pace.after(
                now_done - done, total - now_done, bar.tasks[0].elapsed or 0
            )
            bar.update(task, speed=speed, left=remaining)

        yield advance


class ProgressRate:
    """Speed and time left of work that is done in parts, perhaps by several processes.

    Parts arrive in bursts, the first only after the processes have started, so that neither the
    latest parts nor the mean since the start tell the speed. It is the mean over the second half of
    the time so far, from twice the time of the first burst on.
    """

    def __init__(self) -> None:
        """Initialise at the start of the work."""
        self._times, self._done = [0.0], [0.0]

    def after(self, done: float, rest: float, elapsed: float) -> tuple[str, str]:
        """Return speed and time left as text; an empty and an unknown one at the beginning.

        :param done: number of elements that are done since the start.
        :param rest: number of elements that are left.
        :param elapsed: time since the start [s].
        """
        if done > self._done[-1] and elapsed > self._times[-1]:
            self._times.append(elapsed)
            self._done.append(done)
        burst_end = _BURST * self._times[min(1, len(self._times) - 1)]
        base = bisect_right(self._times, max(0.5 * elapsed, burst_end)) - 1
        count, seconds = done - self._done[base], elapsed - max(self._times[base], burst_end)
        if elapsed < 2.0 * burst_end or not (count > 0.0 and seconds > 0.0):
            return "", _UNKNOWN_TIME
        speed = count / seconds
        minutes, second = divmod(round(min(max(rest, 0.0) / speed, _LONGEST_TIME)), 60)
        return speed_text(speed), f"{minutes // 60}:{minutes % 60:02}:{second:02}"


def speed_text(speed: float | None) -> str:
    """Return a speed [1/s] as text with few digits: ``812/s``, ``15 k/s``; "": it is unknown."""
    if not speed:
        return ""
    if speed < 1e4:
        return f"{speed:,.0f}/s" if speed >= 10.0 else f"{speed:.2g}/s"
    return f"{speed / 1e3:,.0f} k/s"
