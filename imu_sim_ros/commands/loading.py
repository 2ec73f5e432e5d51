# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How a program's module is loaded, and the interpreter left: most of a short run is just that."""

import atexit
import gc
import importlib
import os
import sys
import warnings
from typing import Any


def load(module: str) -> Any:
    """Import the module that a program is about.

    Imports make no garbage, but so many objects that its collector would go through all of them
    many times. OpenBLAS would start a thread for each processor, which spins for 50 ms; no matrix
    of ours is large enough for them. Warnings of libraries name lines of source: they are for
    developers, who get them by ``python -W default`` or PYTHONWARNINGS.
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
    """Return what is said if ROS 2 is not there."""
    return f"needs ROS 2, but {error.name} is not installed here (source its setup.bash)"


def leave_at_once() -> None:
    """Let the interpreter end without looking at every object once more, which takes 20 ms.

    Files are closed by then, and the system takes the memory.
    """
    atexit.register(gc.freeze)
