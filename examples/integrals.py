# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead reckoning of an IMU that gives integrals: delta angles and delta velocities.

python examples/integrals.py

Coning and sculling are corrected with the interval before (P. Savage, "Strapdown inertial
navigation integration algorithm design", parts 1 and 2, J. Guidance 1998), and the rotation
within the interval to second order:

    dphi = alpha + alpha' x alpha / 12
    dv = v + alpha x v / 2 + alpha x (alpha x v) / 6 + (alpha' x v + v' x alpha) / 12

with alpha, v the integrals and alpha', v' those of the interval before, of equal length; its own
stand for them in the first interval. The position follows from the specific force that is linear
over both intervals.
"""

import numpy as np

import imu_sim_ros as ims
from imu_sim_ros.core import rotation
from imu_sim_ros.core.conventions import GRAVITY


def increments(h, delta_angle, delta_velocity):
    """Return dphi, dv and dp (n, 3) of intervals, in the attitudes of their starts.

    :param h: length of the intervals [s].
    :param delta_angle: (n, 3) integrals of the angular rate [rad].
    :param delta_velocity: (n, 3) integrals of the specific force in the turning body [m/s].
    """
    before_angle = np.concatenate([delta_angle[:1], delta_angle[:-1]])
    before_velocity = np.concatenate([delta_velocity[:1], delta_velocity[:-1]])
    turned = np.cross(delta_angle, delta_velocity)
    sculling = np.cross(before_angle, delta_velocity) + np.cross(before_velocity, delta_angle)
    dphi = delta_angle + np.cross(before_angle, delta_angle) / 12.0
    dv = delta_velocity + 0.5 * turned + np.cross(delta_angle, turned) / 6.0 + sculling / 12.0
    dp = (before_velocity - delta_velocity - turned) * (h / 12.0)
    return dphi, dv, dp


def integrate(h, delta_angle, delta_velocity, position, velocity, q_wb):
    """Return the last position, velocity and attitude from those at the start of n intervals."""
    dphi, dv, dp = increments(h, delta_angle, delta_velocity)
    turns = rotation.exp(dphi)
    for turn, velocity_step, position_step in zip(turns, dv, dp, strict=True):
        next_velocity = velocity + np.array(GRAVITY) * h + rotation.rotate(q_wb, velocity_step)
        position = (
            position + 0.5 * h * (velocity + next_velocity) + rotation.rotate(q_wb, position_step)
        )
        velocity, q_wb = next_velocity, rotation.normalise(rotation.multiply(q_wb, turn))
    return position, velocity, q_wb


def main():
    """Compare integrals with readings of the same flight, at 50 to 400 Hz."""
    setup = {"trajectory": "figure_eight", "duration": 10}
    print("rate [Hz]   midpoint of readings [m]   integrals [m]")
    for rate in (50, 100, 200, 400):
        # The mean over the sample interval, as an IMU that integrates inside has it.
        averaged = {"preset": "perfect", "sampling": "averaged"}
        flight = ims.simulate(imu=averaged, rate=rate, **setup)
        truth, h = flight.truth, 1.0 / rate
        start = truth.position[0], truth.velocity[0], truth.q_wb[0]
        end, _, _ = integrate(h, flight.gyro[1:] * h, flight.accel[1:] * h, *start)
        track = ims.dead_reckon(ims.simulate(imu="perfect", rate=rate, **setup))
        errors = [np.linalg.norm(p - truth.position[-1]) for p in (track.position[-1], end)]
        print(f"{rate:9d} {errors[0]:26.2e} {errors[1]:15.2e}")


if __name__ == "__main__":
    main()
