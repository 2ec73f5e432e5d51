# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Symmetric positive definite banded systems, by LAPACK's pbtrf and pbtrs.

These are what ``scipy.linalg.cholesky_banded`` and ``cho_solve_banded`` call. Importing
``scipy.linalg`` takes 0.2 s, half of what a short simulation along a recording takes in all; its
LAPACK alone is loaded in a tenth of that.
"""

import sys
from functools import cache
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros.trajectory.motion import Array

_MODULE: Final = "scipy.linalg._flapack"


def factored(bands: Array) -> Array:
    """Return the Cholesky factor of a matrix, both in SciPy's lower banded form (b + 1, n).

    :raises numpy.linalg.LinAlgError: where the matrix is not positive definite.
    """
    factor: Array
    factor, info = _lapack().dpbtrf(np.asarray_chkfinite(bands), lower=1)
    if info > 0:
        raise np.linalg.LinAlgError(f"leading minor {info} is not positive definite")
    return factor


def solved(factor: Array, right: Array) -> Array:
    """Return the solutions (n, m) of a system with a factored matrix and right sides (n, m)."""
    result: Array
    result, _ = _lapack().dpbtrs(factor, np.asarray_chkfinite(right), lower=1)
    return result


@cache
def _lapack() -> Any:
    """Return SciPy's LAPACK: the extension module alone, or where it is not found, by the door."""
    if _MODULE in sys.modules:
        return sys.modules[_MODULE]
    scipy = find_spec("scipy")  # which does not import it
    places = scipy.submodule_search_locations if scipy else None
    folders = [str(Path(place, "linalg")) for place in places or []]
    found = PathFinder.find_spec(_MODULE, folders)
    if found is None or found.loader is None:
        return import_module("scipy.linalg.lapack")
    module = module_from_spec(found)
    found.loader.exec_module(module)
    sys.modules[_MODULE] = module  # a later import of scipy.linalg finds it
    return module
