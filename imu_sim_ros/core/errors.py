# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The errors that a user can cause, and how any error is reported: lines and an exit status."""

import errno
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

_MACHINE: Final = frozenset(
    {
        *(errno.EIO, errno.ENODEV, errno.ESTALE),
        *(errno.ENOSPC, errno.EDQUOT, errno.EFBIG),
        *(errno.ENOMEM, errno.EAGAIN, errno.EMFILE, errno.ENFILE),
    }
)
"""System errors that no other argument would avoid."""
_PASSED_OVER: Final = (__name__.partition(".")[0], "contextlib")
"""Packages whose lines no warning names: this one, and what stands between its own calls."""


class ImuSimError(Exception):
    """Base class of the package's errors; ``problems`` has one line for each problem."""

    status = 2
    """Exit status of a program that ends with it."""

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems: tuple[str, ...] = (
            (problems,) if isinstance(problems, str) else tuple(problems)
        )
        super().__init__("\n".join(self.problems))


class ConfigurationError(ImuSimError, ValueError):
    """Parameters that cannot be used: unknown names, wrong types, values out of range."""


class ArgumentTypeError(ConfigurationError, TypeError):
    """An argument of the wrong type."""


class InputError(ImuSimError):
    """Input or output that cannot be used: a bag, a trajectory file, a folder."""


class Problems(list[str]):
    """Lines about several inputs, or parts of one, which one error tells together.

    Each part is tried::

        problems = Problems()
        for file in files:
            with problems.collect():
                load(file)
        problems.tell()
    """

    def __init__(self) -> None:
        super().__init__()
        self._kinds: set[type[ConfigurationError | InputError]] = set()
        self.unjudged: tuple[str, ...] = ()
        """Prefixes of parameters that depend on a wrong part; they are not checked."""

    @contextmanager
    def collect(self, prefix: str = "", hanging: str | None = None) -> Iterator[None]:
        """Collect the problems that the block raises, so that later blocks are checked, too.

        :param prefix: text in front of each line.
        :param hanging: prefix of the parameters that depend on what the block checks: they are not
            judged after a problem. None: no parameter depends on it.
        """
        try:
            yield
        except (ConfigurationError, InputError) as error:
            self += [f"{prefix}{line}" for line in error.problems if f"{prefix}{line}" not in self]
            self._kinds.add(type(error))
            self.unjudged += () if hanging is None else (hanging,)

    def tell(self) -> None:
        """Raise the collected problems, if there are any."""
        if self:
            alike = len(self._kinds) == 1
            raise (self._kinds.pop() if alike else ConfigurationError)(self)


class MachineError(ImuSimError):
    """An operation that the machine could not carry out: a full disk, a read error."""

    status = 1


class MissingDependencyError(ImuSimError):
    """An optional library that is needed but not installed; the text says how to install it."""


class Remark(UserWarning):
    """A note for the user in addition to the result, such as rows that are left out.

    A program prints it as a line of standard error.
    """


class InputWarning(UserWarning):
    """Input that makes results wrong or worse than they could be.

    A program prints it as a line of standard error that begins with ``warning:``.
    """


def warn(line: str, category: type[UserWarning] = InputWarning) -> None:
    """Warn at the line of the user's code that called the package."""
    frame, level = sys._getframe(1), 2
    while frame.f_back and frame.f_globals["__name__"].partition(".")[0] in _PASSED_OVER:
        frame, level = frame.f_back, level + 1
    warnings.warn(line, category, stacklevel=level)


def system_error(path: str | Path, error: OSError) -> ImuSimError:
    """Return the system's message about a path, as an error of the input or of the machine."""
    kind = MachineError if error.errno in _MACHINE else InputError
    return kind(f"{path}: {error.strerror or error}")


@contextmanager
def name_source(source: str | Path, kind: type[ImuSimError] = InputError) -> Iterator[None]:
    """Prefix the problems in a block with the name of a file, unless they begin with it."""
    try:
        yield
    except kind as error:
        lines = (line.removeprefix(f"{source}: ") for line in error.problems)
        raise type(error)([f"{source}: {line}" for line in lines]) from None


def explain(error: BaseException) -> tuple[tuple[str, ...], int]:
    """Return the lines to print about an error, and its exit status.

    :returns: 2 for what the user can mend; 1 for errors of the machine (a full disk, a missing
        permission) and for anything unforeseen.
    """
    if isinstance(error, ImuSimError):
        return error.problems, error.status
    if isinstance(error, OSError) and error.strerror:
        names = [str(name) for name in (error.filename, error.filename2) if name is not None]
        status = 2 if error.errno == errno.ENAMETOOLONG else 1
        return (": ".join([*names, error.strerror]),), status
    if isinstance(error, MemoryError):
        return ("not enough memory",), 1
    message = " ".join(str(error).split())
    what = f"{type(error).__name__}: {message}" if message else type(error).__name__
    return (f"unexpected: {what}; run with --debug for the traceback",), 1
