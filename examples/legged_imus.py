# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The IMUs of 4096 legged robots as a loop of NumPy, for policies that learn in parallel.

python examples/legged_imus.py [COUNT]

In place of a simulator, the bodies trot: they pitch, roll and bounce at the frequency of the steps.
Every 20 steps some episodes end, and these robots get other units of the IMU.
"""

import sys
import time

import numpy as np

import imu_sim_ros as ims

RATE = 200.0
SPREAD = {
    "gyroscope_noise_density": ("uniform", 1e-4, 4e-4),
    "accelerometer_bias": ("gaussian", 0.1),
}


def trot(t, phase):
    """Return ideal angular rates and specific forces (count, 3) at a time [s]."""
    step = 2.0 * np.pi * 2.5 * t + phase
    pitch, roll = 0.05 * np.sin(step), 0.04 * np.sin(0.5 * step)
    gyro, accel = np.zeros((2, len(phase), 3))
    gyro[:, 0] = 0.04 * 0.5 * 15.7 * np.cos(0.5 * step)
    gyro[:, 1] = 0.05 * 15.7 * np.cos(step)
    up = 9.81 + 3.0 * np.sin(2.0 * step)
    accel[:, 0] = -up * np.sin(pitch)
    accel[:, 1] = up * np.sin(roll) * np.cos(pitch)
    accel[:, 2] = up * np.cos(roll) * np.cos(pitch)
    return gyro, accel


def main():
    """Run the loop; print what the sensors add, and what that costs."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 4096
    rng = np.random.default_rng(1)
    phase = rng.uniform(0.0, 2.0 * np.pi, count)
    sensors = ims.ErrorModel(imu="bmi088", rate=RATE, seed=1, count=count, spread=SPREAD)
    spent, steps = 0.0, 512
    for k in range(steps):
        gyro, accel = trot(k / RATE, phase)
        ended = rng.random(count) < (0.005 if k % 20 == 0 else 0.0)
        begin = time.process_time()
        sensors.reset(ended)
        samples = sensors.read(round(k * 1e9 / RATE), gyro, accel)
        spent += time.process_time() - begin
    off = np.abs(samples.accel - accel).max(axis=1)
    print(f"gyroscopes: bias {samples.gyro_bias.std():.4f} rad/s, over robots and axes")
    print(f"accelerometers: bias {samples.accel_bias.std():.3f} m/s^2, at most {off.max():.2f} off")
    print(f"{spent / steps / count * 1e6:.2f} us of processor time for a robot and step")


if __name__ == "__main__":
    main()
