# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings with the usual faults of real recordings, computed from clean ones."""

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.conventions import STANDARD_GRAVITY
from imu_sim_ros.core.records import replace_fields

FRD = np.diag([1.0, -1.0, -1.0])
CAMERA = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Rotation from forward-left-up to right-down-forward."""


def stuck(readings):
    """Return readings whose accelerometer's y axis stays constant from the middle on."""
    accel = readings.accel.copy()
    begin = len(accel) // 2
    accel[begin:, 1] = accel[begin, 1]
    return replace_fields(readings, accel=accel)


def saturated(readings):
    """Return readings whose gyroscope's z axis is cut off for a tenth of the time."""
    gyro = readings.gyro.copy()
    limit = np.quantile(np.abs(gyro[:, 2]), 0.9)
    gyro[:, 2] = np.clip(gyro[:, 2], -limit, limit)
    return replace_fields(readings, gyro=gyro)


FAULTS = {
    "accelerometer_g": lambda r: replace_fields(r, accel=r.accel / STANDARD_GRAVITY),
    "accelerometer_mg": lambda r: replace_fields(r, accel=1e3 * r.accel / STANDARD_GRAVITY),
    "accelerometer_counts": lambda r: replace_fields(
        r, accel=np.rint(16384.0 * r.accel / STANDARD_GRAVITY)
    ),
    "gyroscope_degrees": lambda r: replace_fields(r, gyro=np.degrees(r.gyro)),
    "gyroscope_counts": lambda r: replace_fields(r, gyro=np.rint(131.0 * np.degrees(r.gyro))),
    "axes_down": lambda r: replace_fields(r, gyro=r.gyro @ FRD, accel=r.accel @ FRD),
    "axes_sideways": lambda r: replace_fields(r, gyro=r.gyro @ CAMERA.T, accel=r.accel @ CAMERA.T),
    "triads_swapped": lambda r: replace_fields(r, gyro=r.accel, accel=r.gyro),
    "gyroscope_absent": lambda r: replace_fields(r, gyro=None),
    "triad_zeros": lambda r: replace_fields(r, gyro=0.0 * r.gyro),
    "accelerometer_absent": lambda r: replace_fields(r, accel=None),
    "axis_stuck": stuck,
}
"""Readings with a fault, by the kind of its finding."""

MS = 1_000_000


def shifted(readings, rows, by_ns):
    """Return readings with the stamps of some rows moved by a time [ns]."""
    t_ns = readings.t_ns.copy()
    t_ns[rows] += by_ns
    return replace_fields(readings, t_ns=t_ns)


def bunched(readings):
    """Return readings stamped on arrival, eight at a time."""
    rows = np.arange(len(readings))
    return replace_fields(readings, t_ns=readings.t_ns[rows // 8 * 8] + rows % 8 * 50_000)


STAMPS = {
    "stamps_equal": lambda r: replace_fields(r, t_ns=0 * r.t_ns),
    "stamps_unit": lambda r: replace_fields(r, t_ns=(r.t_ns - r.t_ns[0]) // 1000),
    "clock_reset": lambda r: shifted(r, slice(len(r) // 2, None), -(10**9) * 60),
    "clock_change": lambda r: shifted(r, slice(len(r) // 2, None), 10**18),
    "stamps_stray": lambda r: shifted(r, 500, -(10**18)),
    "stamps_shared": lambda r: replace_fields(r, t_ns=r.t_ns[np.arange(len(r)) // 8 * 8]),
    "stamps_bunched": bunched,
    "stamps_late": lambda r: r.rows(np.r_[0:500, 502, 500, 501, 503 : len(r)]),
    "messages_repeated": lambda r: r.rows(np.sort(np.r_[0 : len(r), 300:400])),
    "stamps_rounded": lambda r: replace_fields(r, t_ns=r.t_ns // MS * MS),
}
"""Readings whose stamps have a fault, by the kind of its finding."""


def held(states):
    """Return states in which each fourth pose is repeated three times."""
    rows = np.arange(len(states)) // 4 * 4
    return replace_fields(states, position=states.position[rows], q_wb=states.q_wb[rows])


POSES = {
    "poses_held": held,
    "poses_sparse": lambda s: s.rows(slice(None, None, 60)),
    "poses_contradictory": lambda s: replace_fields(
        s, t_ns=np.r_[s.t_ns[:500], s.t_ns[499], s.t_ns[501:]]
    ),
    "quaternion_order": lambda s: replace_fields(s, q_wb=s.q_wb[:, [1, 2, 3, 0]]),
    "z_down": lambda s: replace_fields(
        s, q_wb=rotation.multiply(s.q_wb, np.array([0.0, 1.0, 0.0, 0.0]))
    ),
    "axes_camera": lambda s: replace_fields(
        s, q_wb=rotation.multiply(s.q_wb, np.array([0.5, -0.5, 0.5, -0.5]))
    ),
}
"""Poses with a fault, by the kind of its finding."""
