# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Banded systems against scipy.linalg's, bit for bit, however LAPACK was loaded."""

import subprocess
import sys

import numpy as np
import pytest

from imu_sim_ros.trajectory.splines import banded

PROGRAM = """
import sys
import numpy as np
from imu_sim_ros.trajectory.splines import banded

factor = banded.factored(np.array([[4.0, 5.0], [1.0, 0.0]]))
assert "scipy.linalg" not in sys.modules, "all of scipy.linalg was imported"
import scipy.linalg

np.testing.assert_array_equal(
    factor, scipy.linalg.cholesky_banded(np.array([[4.0, 5.0], [1.0, 0.0]]), lower=True)
)
assert scipy.linalg.lapack.dpbtrf is banded._lapack().dpbtrf
"""


def test_factors_and_solutions_are_those_of_scipy():
    from scipy.linalg import cho_solve_banded, cholesky_banded

    rng = np.random.default_rng(1)
    bands = 0.3 * rng.standard_normal((6, 200))
    bands[0] = 10.0 + rng.random(200)
    right = rng.standard_normal((200, 3))
    factor = banded.factored(bands)
    expected = cholesky_banded(bands, lower=True)
    np.testing.assert_array_equal(factor, expected)
    np.testing.assert_array_equal(
        banded.solved(factor, right), cho_solve_banded((expected, True), right)
    )


def test_a_matrix_that_is_not_positive_definite_is_an_error():
    with pytest.raises(np.linalg.LinAlgError, match="leading minor 2"):
        banded.factored(np.array([[1.0, 1.0], [2.0, 0.0]]))


def test_scipy_linalg_can_be_imported_afterwards():
    subprocess.run([sys.executable, "-c", PROGRAM], check=True)
