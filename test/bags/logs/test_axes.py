# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""FRD and NED in FLU and ENU, against closed forms of angles and matrices."""

import numpy as np

from imu_sim_ros.bags.logs import axes
from imu_sim_ros.core import rotation


def test_vectors_change_their_axes():
    np.testing.assert_array_equal(axes.flu([[1.0, 2.0, 3.0]]), [[1.0, -2.0, -3.0]])
    np.testing.assert_array_equal(axes.enu([[1.0, 2.0, 3.0]]), [[2.0, 1.0, -3.0]])


def test_roll_stays_pitch_is_inverted_and_yaw_is_counted_from_the_east():
    roll, pitch, yaw = 0.3, -0.2, 0.5
    q = axes.q_enu_flu(rotation.from_euler([[roll, pitch, yaw]]))
    np.testing.assert_allclose(rotation.to_euler(q), [[roll, -pitch, np.pi / 2 - yaw]], atol=1e-15)
    # Without a heading, forward is forward: yaw is inverted alone.
    q = axes.q_flu_flu(rotation.from_euler([[roll, pitch, yaw]]))
    np.testing.assert_allclose(rotation.to_euler(q), [[roll, -pitch, -yaw]], atol=1e-15)


def test_attitudes_are_those_of_the_matrices():
    rng = np.random.default_rng(1)
    q = rotation.normalise(rng.normal(size=(100, 4)))
    exchange = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    inversion = np.diag([1, -1, -1.0])
    r = rotation.to_matrix(q)
    of_enu = rotation.to_matrix(axes.q_enu_flu(q))
    np.testing.assert_allclose(of_enu, exchange @ r @ inversion, atol=1e-14)
    of_flu = rotation.to_matrix(axes.q_flu_flu(q))
    np.testing.assert_allclose(of_flu, inversion @ r @ inversion, atol=1e-14)
    # A specific force is the same vector in both: R v of NED, exchanged, is R v of ENU.
    v = rng.normal(size=(100, 3))
    np.testing.assert_allclose(
        axes.enu(rotation.rotate(q, v)), rotation.rotate(axes.q_enu_flu(q), axes.flu(v)), atol=1e-14
    )
