# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start of a program: standard streams, warnings, threads of libraries, and its import."""

import gc
import importlib
import os
import sys
import warnings
from types import ModuleType


def open_standard_streams() -> None:
    """Open closed standard streams on /dev/null, so that no file opened later takes their place."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free number is this one
        if getattr(sys, name) is None:
            mode = "r+" if number else "r"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115


def load(module: str) -> ModuleType:
    """Import and return the module of a program.

    OpenBLAS gets one thread: the matrices of this package are too small for more, which would only
    spin. Warnings of libraries name lines of source: they are for developers, who get them by
    ``python -W default`` or PYTHONWARNINGS. Modules live to the end of the process, so the garbage
    collector does not search them.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.disable()
    try:
        return importlib.import_module(module)
    finally:
        gc.freeze()
        gc.enable()


def needs_ros(error: ImportError) -> str:
    """Return the message for a missing ROS 2."""
    return f"needs ROS 2, but {error.name} is not installed here (source its setup.bash)"
