# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Optional libraries of images: OpenCV, and numba for loops over pixels."""

import os
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any, TypeVar

from imu_sim_ros.core.errors import MissingDependencyError
from imu_sim_ros.terminal.progress import current_watcher

_Function = TypeVar("_Function", bound=Callable[..., Any])


def opencv() -> ModuleType:
    """Return OpenCV's module.

    :raises MissingDependencyError: if it is not installed.
    """
    try:
        os.environ.setdefault("OPENCV_LOG_LEVEL", "OFF")  # what it logs goes to standard error
        import cv2
    except ImportError as error:
        raise MissingDependencyError(
            f"images need OpenCV ({error}): apt install python3-opencv, or pip install "
            "opencv-python-headless"
        ) from None
    return cv2


def numba() -> ModuleType:
    """Return numba's module; before its first compilation, users get a note.

    :raises MissingDependencyError: if it is not installed.
    """
    try:
        import numba
    except ImportError as error:
        raise MissingDependencyError(
            f"images need numba ({error}): apt install python3-numba, or pip install numba"
        ) from None
    _tell_before_compiling()
    return numba


def numba_function(function: _Function, part: bool = False) -> _Function:
    """Return a function that numba compiles when it is called first, and keeps on the disk.

    Arithmetic stays as written, so that the bits of a result are the same on every processor. What
    is kept is used until the file of the function changes: its parts must be in the same file. It
    allocates no arrays: counting references to them would take three times as long as the rest.

    :param part: of other compiled functions, in which it disappears.
    :raises MissingDependencyError: if numba is not installed.
    """
    result: _Function = numba().njit(
        nogil=True, error_model="numpy", cache=not part, forceinline=part, _nrt=False
    )(function)
    return result


@cache
def _tell_before_compiling() -> None:
    """Tell the job's receiver once that code is compiled before the first image."""
    from numba.core import event

    class Notice(event.Listener):  # type: ignore[misc]
        announced = False

        def on_start(self, compiling: Any) -> None:
            ours = compiling.data["dispatcher"].py_func.__module__.startswith(f"{__package__}.")
            if ours and not self.announced:
                self.announced = True
                current_watcher().note(
                    "the code that makes images is compiled first, once after an installation: "
                    "5 to 15 s of processor time"
                )

        def on_end(self, _: Any) -> None:
            pass

    event.register("numba:compile", Notice())


def part(function: _Function) -> _Function:
    """Compile a function that compiled functions call, as :func:`numba_function` does."""
    return numba_function(function, part=True)
