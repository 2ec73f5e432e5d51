# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An independent strapdown as oracle: pyins integrates on the ellipsoid of the Earth, which turns.

Both get the same readings, those of a body at rest on the turning Earth that is then moved. Over
some seconds and metres the Earth is flat. Both take the readings as linear between the samples and
correct the rotation within a step to different orders: what differs is of second order in the step,
and far below what a wrong sign of Coriolis' acceleration or of the Earth's rate would give.
"""

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.navigation.dead_reckoning import dead_reckon

LATITUDE, LONGITUDE = 50.0, 10.0
EARTH_RATE = 7.2921157e-5
ENU_FROM_NED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])


def moved_on_the_earth(motion, g):
    """Return the readings of the motion on the turning Earth, and the Earth's rate in ENU."""
    latitude = np.radians(LATITUDE)
    earth_rate = EARTH_RATE * np.array([0.0, np.cos(latitude), np.sin(latitude)])
    q_wb = motion.truth.q_wb
    gyro = motion.gyro + rotation.rotate_inverse(q_wb, earth_rate)
    felt = 2.0 * np.cross(earth_rate, motion.truth.velocity) + np.array([0.0, 0.0, g - 9.81])
    return gyro, motion.accel + rotation.rotate_inverse(q_wb, felt), earth_rate


def integrate_with_pyins(motion, gyro, accel):
    """Return position, velocity and attitude in our frames."""
    from pandas import DataFrame, Index, Series
    from pyins import strapdown, transform
    from pyins.util import LLA_COLS, RPH_COLS, VEL_COLS

    imu = DataFrame(
        np.column_stack([gyro @ FLU_FROM_FRD, accel @ FLU_FROM_FRD]),
        columns=strapdown.GYRO_COLS + strapdown.ACCEL_COLS,
        index=Index((motion.t_ns - motion.t_ns[0]) * 1e-9, name="time"),
    )
    initial = motion.initial
    r_nb = ENU_FROM_NED.T @ rotation.to_matrix(initial.q_wb) @ FLU_FROM_FRD
    velocity_n = ENU_FROM_NED.T @ initial.velocity
    start = Series(
        [LATITUDE, LONGITUDE, 0.0, *velocity_n, *transform.mat_to_rph(r_nb)],
        index=LLA_COLS + VEL_COLS + RPH_COLS,
        name=0.0,
    )
    increments = strapdown.compute_increments_from_imu(imu, "rate")
    track = strapdown.Integrator(start).integrate(increments)
    lla = track[LLA_COLS].to_numpy()
    position = transform.compute_lla_difference(lla, lla[0]) @ ENU_FROM_NED.T
    r_nb = transform.mat_from_rph(track[RPH_COLS].to_numpy())
    return (
        position + initial.position,
        track[VEL_COLS].to_numpy() @ ENU_FROM_NED.T,
        rotation.from_matrix(ENU_FROM_NED @ r_nb @ FLU_FROM_FRD.T),
    )


def test_agreement_with_pyins(record):
    earth = pytest.importorskip("pyins.earth")
    g = earth.gravity(LATITUDE, 0.0)
    gravity = (0.0, 0.0, -g)
    differences = []
    for rate in (200.0, 400.0, 800.0):
        motion = record("excitation", rate, 5.0)
        gyro, accel, earth_rate = moved_on_the_earth(motion, g)
        arguments = (motion.t_ns, gyro, accel, motion.initial, "rk4", "so3", gravity)
        ours = dead_reckon(*arguments, earth_rate=earth_rate)
        position, velocity, q_wb = integrate_with_pyins(motion, gyro, accel)
        turn = rotation.log(rotation.multiply(rotation.conjugate(q_wb), ours.q_wb))
        differences.append(
            [
                np.abs(position - ours.position).max(),
                np.abs(velocity - ours.velocity).max(),
                np.abs(turn).max(),
            ]
        )
    position, velocity, turn = np.array(differences).T
    for values, limit in ((position, 4e-5), (velocity, 2e-5)):
        assert values[-1] < limit
        assert np.log2(values[0] / values[-1]) / 2.0 == pytest.approx(2.0, abs=0.1)
    # The curvature: 5 s at 1 m/s on 6370 km turn the local level by 8e-7 rad at most.
    assert turn.max() < 2e-7
    flat = dead_reckon(*arguments)
    assert np.abs(flat.velocity - ours.velocity).max() > 1e-3
