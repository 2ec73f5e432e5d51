# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Formulas over components: a reading in floats has the value that it has in a block of arrays."""

from itertools import starmap

import numpy as np
import pytest

from imu_sim_ros.core import components, rotation

RNG = np.random.default_rng(55)
N = 400
Q, P = (rotation.normalise(RNG.normal(size=(N, 4))) for _ in range(2))
U, V = RNG.normal(size=(2, N, 3))
U[0] = 0.0
Q[:3] = [[1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
P[1] = rotation.exp([1e-6, -2e-6, 1e-7])
M = RNG.normal(size=(N, 3, 3))
ANGLES = RNG.uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1], size=(N, 3))
EXACT = {
    "multiply": (P, Q),
    "conjugate": (Q,),
    "normalise": (3.0 * Q,),
    "rotate": (Q, V),
    "rotate_inverse": (Q, V),
    "cross": (U, V),
    "transform": (M, V),
    "to_matrix": (Q,),
}
"""Sums, products, quotients and square roots, which IEEE 754 rounds alike everywhere."""
WITH_SINES = {"exp": (U,), "log": (P,), "from_euler": (ANGLES,), "to_euler": (Q,)}
ULP = 2.3e-16


def columns(values):
    """Return the components of a block as arrays (n,)."""
    return tuple(np.ascontiguousarray(column) for column in values.reshape(N, -1).T)


def both(name, operands):
    """Return (n, k) as the formula gives it for a block, and row by row for floats."""
    formula = getattr(components, name)
    block = np.stack(formula(*map(columns, operands)), axis=1)
    rows = zip(*(map(tuple, values.reshape(N, -1).tolist()) for values in operands), strict=True)
    single = list(starmap(formula, rows))
    assert all(type(number) is float for row in single for number in row)
    return block, np.array(single)


@pytest.mark.parametrize("name", EXACT)
def test_floats_and_arrays_agree_in_every_bit(name):
    block, single = both(name, EXACT[name])
    np.testing.assert_array_equal(single, block)


@pytest.mark.parametrize("name", WITH_SINES)
def test_floats_and_arrays_agree_but_for_the_last_digits_of_sines(name):
    # NumPy's sine, cosine and arc tangent may be another one than the C library's, each within
    # 4 ulp (NumPy's own bound); they enter numbers up to pi, times at most three others up to 1.
    block, single = both(name, WITH_SINES[name])
    np.testing.assert_allclose(single, block, rtol=0, atol=3 * 4 * np.pi * ULP)


@pytest.mark.parametrize("name", [*EXACT, *WITH_SINES])
def test_whole_arrays_have_the_same_values(name):
    operands = {**EXACT, **WITH_SINES}[name]
    block, _ = both(name, operands)
    result = getattr(rotation, name)(*operands)
    np.testing.assert_array_equal(result.reshape(N, -1), block)


def test_the_edges_of_a_block_split_and_stack():
    np.testing.assert_array_equal(components.stack(components.vector(V)), V)
    np.testing.assert_array_equal(components.stack(components.quaternion(Q)), Q)
    entries = components.stack(components.matrix(M))
    np.testing.assert_array_equal(entries.reshape(N, 3, 3), M)
    assert components.float_vector(V[5]) == tuple(V[5].tolist())
    assert components.float_quaternion(Q[5]) == tuple(Q[5].tolist())
    assert components.float_matrix(M[5]) == tuple(M[5].ravel().tolist())
