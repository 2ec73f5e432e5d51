# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who follows a job: a program prints its lines and shows its progress, in Python nobody does."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass

Advance = Callable[..., None]
"""Receives how many more are done."""
Bar = Callable[..., AbstractContextManager[Advance]]
"""Shows a text and progress up to a total."""


def _nothing(line: str) -> None:
    """Print nothing."""


@dataclass(frozen=True)
class Watcher:
    """Who follows a job, and keeps signals from its last step; by default nobody does."""

    bar: Bar | None = None
    warn: Callable[[str], None] = _nothing
    """Receives lines about what is allowed but may be unintended."""
    remark: Callable[[str], None] = _nothing
    """Receives lines about what is left out, or was found on the way."""
    note: Callable[[str], None] = _nothing
    """Receives lines about what was chosen."""
    undisturbed: Callable[[], AbstractContextManager[object]] = nullcontext
    """Holds signals while outputs get their names."""


_watcher: ContextVar[Watcher] = ContextVar("watcher", default=Watcher())  # noqa: B039 - frozen


def watcher() -> Watcher:
    """Return who follows the jobs that begin now."""
    return _watcher.get()


@contextmanager
def watched_by(follower: Watcher) -> Iterator[None]:
    """Let somebody follow the jobs in a block."""
    token = _watcher.set(follower)
    try:
        yield
    finally:
        _watcher.reset(token)


@contextmanager
def progress(text: str, total: Callable[[], int], **more: int) -> Iterator[Advance]:
    """Yield what receives progress.

    :param total: returns how much there is to do; called if somebody looks.
    :param more: ``done``, how much there was before.
    """
    bar = _watcher.get().bar
    if bar is None:
        yield lambda count, words="": None
    else:
        with bar(text, total(), **more) as advance:
            yield advance
