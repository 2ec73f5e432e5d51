# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What images need besides NumPy: OpenCV, and numba for what is made of their pixels."""

import os
from collections.abc import Callable
from typing import Any, TypeVar

from imu_sim_ros.errors import MissingDependencyError

_Function = TypeVar("_Function", bound=Callable[..., Any])


def opencv() -> Any:
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


def numba() -> Any:
    """Return numba's module.

    :raises MissingDependencyError: if it is not installed.
    """
    try:
        import numba
    except ImportError as error:
        raise MissingDependencyError(
            f"images need numba ({error}): apt install python3-numba, or pip install numba"
        ) from None
    return numba


def compiled(function: _Function, part: bool = False) -> _Function:
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


def part(function: _Function) -> _Function:
    """Return what :func:`compiled` makes of a part of other functions."""
    return compiled(function, part=True)
