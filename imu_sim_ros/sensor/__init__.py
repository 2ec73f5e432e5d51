# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an IMU on a moving body reads: the ideal reading, then its errors in one fixed order.

For each triad, x its ideal input and f the ideal specific force::

    1  ideal reading   gravity (constant or WGS84), Earth rate, lever arm, mounting, places of the
                       accelerometers; at an instant or as the mean since the sample before
    2  response        S x + q x^2            scale and misalignment, second-order non-linearity
    3                  + G f + H f^2          g-sensitivity and g^2 rectification (gyroscope)
    4  scale           * (1 + s_T(T) + s_on + s_age)  temperature, turn-on (drawn), ageing
    5  bias            + b_T(T) + b_on + b    temperature, turn-on, constant
    6                  + walk + Gauss-Markov + 1/f + ramp  (+ injected jumps)
                       + hysteresis + ageing + stress steps + what shocks left
    7  white noise     + n                    correlated between axes, changing with temperature
    8  bandwidth       Butterworth low-pass over all of the above, then the vehicle's vibration
    9  digital output  rounding to steps and saturation, of readings or of increments
    10 timing          stamps: offset, skew, drift, jitter; transport: latency, losses, duplicates

In an oversampled sensor 2 to 8 act at its internal rate, and every m-th reading goes on to 9.
Every term is off at zero and set per axis. The truth beside the readings: the ideal reading (1),
the scale (4), the bias (5 and 6), the temperature, the true times. So without 2, 3 and 8 to 10
``reading = scale * ideal + bias + n``.

Samples are generated in blocks with carried state. Every random source has its own stream for each
axis (:mod:`imu_sim_ros.random_streams`), and a sample does not depend, not in a single bit, on
the size of the block in which it is generated. What it exports is imported when first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.sensor import catalogue as catalogue
    from imu_sim_ros.sensor.block import ImuBlock as ImuBlock
    from imu_sim_ros.sensor.block import MagneticBlock as MagneticBlock
    from imu_sim_ros.sensor.block import OrientationBlock as OrientationBlock
    from imu_sim_ros.sensor.block import PressureBlock as PressureBlock
    from imu_sim_ros.sensor.curved_earth import CurvedEarth as CurvedEarth
    from imu_sim_ros.sensor.errors import accel_variance_discrete as accel_variance_discrete
    from imu_sim_ros.sensor.errors import field_variance_discrete as field_variance_discrete
    from imu_sim_ros.sensor.errors import gyro_variance_discrete as gyro_variance_discrete
    from imu_sim_ros.sensor.errors import pressure_variance_discrete as pressure_variance_discrete
    from imu_sim_ros.sensor.faults import Fault as Fault
    from imu_sim_ros.sensor.gravity import earth_rate_vector as earth_rate_vector
    from imu_sim_ros.sensor.gravity import gravity_vector as gravity_vector
    from imu_sim_ros.sensor.imu import Imu as Imu
    from imu_sim_ros.sensor.realised import realised_imu as realised_imu
    from imu_sim_ros.sensor.vehicle import MotionSize as MotionSize
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": ["catalogue"],
            "block": ["ImuBlock", "MagneticBlock", "OrientationBlock", "PressureBlock"],
            "curved_earth": ["CurvedEarth"],
            "errors": [
                "accel_variance_discrete",
                "field_variance_discrete",
                "gyro_variance_discrete",
                "pressure_variance_discrete",
            ],
            "faults": ["Fault"],
            "gravity": ["earth_rate_vector", "gravity_vector"],
            "imu": ["Imu"],
            "realised": ["realised_imu"],
            "vehicle": ["MotionSize"],
        },
    )
