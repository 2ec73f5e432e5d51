# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings of two triads at the times of one of them."""

import numpy as np
import pytest

from imu_sim_ros.recordings.pairing import pair

NAMES = ("gyroscope", "accelerometer")


def triad(shift_ns=0):
    """Return stamps [ns] of 10 s at 200 Hz, and values that change with each."""
    t_ns = 10**9 + shift_ns + 5_000_000 * np.arange(2000)
    return t_ns, np.sin(t_ns[:, None] * 1e-9 + [0.0, 1.0, 2.0])


@pytest.mark.parametrize("repeated", ["gyroscope", "accelerometer"])
def test_messages_that_came_twice_change_nothing(repeated):
    (t_ns, gyro), (companion_ns, accel) = triad(), triad(1_300_000)
    expected = pair(t_ns, gyro, companion_ns, accel, NAMES)
    rows = np.sort(np.append(np.arange(2000), np.arange(100, 110)))
    if repeated == "gyroscope":
        paired = pair(t_ns[rows], gyro[rows], companion_ns, accel, NAMES)
        np.testing.assert_array_equal(rows[paired.rows], expected.rows)
    else:
        paired = pair(t_ns, gyro, companion_ns[rows], accel[rows], NAMES)
        np.testing.assert_array_equal(paired.rows, expected.rows)
    np.testing.assert_allclose(paired.values, expected.values, atol=1e-9)
    assert not any("in gaps" in note for note in paired.notes)
