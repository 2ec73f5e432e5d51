# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulation of inertial measurement units, and everything that is recovered from their readings.

Conventions
===========

Frames
    ``w``  world, east-north-up (ENU); gravity is ``g_w = (0, 0, -9.81)`` unless configured.
    ``b``  body, forward-left-up (FLU).
    ``i``  IMU, where it is offset or turned from the body.

Rotations
    ``R_wb`` maps body to world: ``v_w = R_wb @ v_b``; neighbouring letters cancel.
    ``q_wb`` is the same rotation as a unit Hamilton quaternion ``(w, x, y, z)``, last axis.
    The order ``(x, y, z, w)`` of ROS exists only where messages are encoded or decoded.
    Euler angles are roll, pitch, yaw with ``R_wb = Rz(yaw) Ry(pitch) Rx(roll)``.
    ``omega_b`` is the body's angular rate relative to the world, resolved in the body.

Readings
    An accelerometer reads the specific force ``f_b = R_wb.T @ (a_w - g_w)``: +9.81 on z when level
    and at rest. A gyroscope reads ``omega_b``.

Units
    SI and radians everywhere; degrees only under names that end in ``_deg``.

Noise
    Continuous-time densities with the names and units of kalibr: ``gyroscope_noise_density``
    rad/s/sqrt(Hz), ``gyroscope_random_walk`` rad/s^2/sqrt(Hz), ``accelerometer_noise_density``
    m/s^2/sqrt(Hz), ``accelerometer_random_walk`` m/s^3/sqrt(Hz). A per-sample value ends in
    ``_discrete``: white noise ``sigma / sqrt(dt)``, one step of a walk ``sigma * sqrt(dt)``.

Time
    Stamps are int64 nanoseconds, ``t_ns``. Sample k is at ``t0_ns + round(k * 1e9 / rate)``, always
    computed from k. A float time is only ever a difference from a start, in seconds.

Shapes
    Time first: ``(n,)``, ``(n, 3)``, ``(n, 4)``, ``(n, 3, 3)``.
"""

__version__ = "0.1.0"
