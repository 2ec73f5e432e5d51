# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the module of a program is loaded: before anything that is slow to import."""

import importlib
import os
import sys
import warnings
from typing import Any


def load(module: str) -> Any:
    """Import the module that a program is about.

    OpenBLAS would start a thread for each processor, which spins for 50 ms; no matrix of ours is
    large enough for them. Warnings of libraries name lines of source: they are for developers, who
    get them by ``python -W default`` or PYTHONWARNINGS.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    return importlib.import_module(module)


def needs_ros(error: ImportError) -> str:
    """Return what is said if ROS 2 is not there."""
    return f"needs ROS 2, but {error.name} is not installed here (source its setup.bash)"
