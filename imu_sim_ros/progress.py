# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Progress of a job's work, for whoever shows it: a program on a terminal, nobody in Python."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar

Advance = Callable[[int], None]
"""Receives how many more are done."""
Bar = Callable[[str, int], AbstractContextManager[Advance]]
"""Shows a text and progress up to a total."""

_bar: ContextVar[Bar | None] = ContextVar("bar", default=None)


@contextmanager
def shown_by(bar: Bar) -> Iterator[None]:
    """Let something show the progress of the jobs in a block."""
    token = _bar.set(bar)
    try:
        yield
    finally:
        _bar.reset(token)


@contextmanager
def progress(text: str, total: Callable[[], int]) -> Iterator[Advance]:
    """Yield what receives progress.

    :param total: returns how much there is to do; called if somebody looks.
    """
    bar = _bar.get()
    if bar is None:
        yield lambda count: None
    else:
        with bar(text, total()) as advance:
            yield advance
