# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Angle of an elbow from two IMUs on the arm of a walking person, with the errors of real sensors.

python examples/joint_angles.py [PICTURE]
"""

import sys
import warnings

import matplotlib.pyplot as plt
import numpy as np
import walk

import imu_sim_ros as ims

warnings.simplefilter("ignore", Warning)  # what a motion capture states is on the page
SENSORS = ("perfect", "mti3", "icm42688p", "bno055")
COLOURS = ("#1A1A1A", "#0072B2", "#00878F", "#E69F00")
MOUNTS = {
    "LeftArm": {"lever_arm": [-0.04, 0.0, -0.15]},
    "LeftForeArm": {"lever_arm": [-0.03, 0.0, -0.22]},
}
"""Positions of the IMUs behind the upper arm and above the wrist, in the segments' axes [m]."""


def bending(q_upper, q_lower):
    """Return the angles (n,) of attitudes (n, 4) about the axis y of the elbow [deg]."""
    w, x, y, z = np.moveaxis(q_upper * [1.0, -1.0, -1.0, -1.0], 1, 0)
    a, b, c, d = np.moveaxis(q_lower, 1, 0)
    about_y, cosine = w * c - x * d + y * a + z * b, w * a - x * b - y * c - z * d
    return np.degrees(2.0 * np.arctan2(about_y * np.sign(cosine), np.abs(cosine)))


walk.write("walk.bvh", 60.0)
curves, errors = {}, {}
print("Largest error of the elbow's angle [deg]")
print("sensor         in 10 s   in 60 s")
for sensor in SENSORS:
    flights = ims.simulate(trajectory="walk.bvh", segments=MOUNTS, imu=sensor, rate=100, seed=1)
    upper, lower = (ims.dead_reckon(flight, initial="truth") for flight in flights.values())
    t = flights["LeftArm"].t
    curves[sensor] = bending(upper.q_wb, lower.q_wb)
    errors[sensor] = curves[sensor] - walk.angles("LeftForeArm", t)[:, 1]
    largest = (np.abs(errors[sensor][t < end]).max() for end in (10.0, 60.0))
    print(f"{sensor:12s} {next(largest):9.2f} {next(largest):9.2f}")

figure, (angle_axes, error_axes) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
window = t < 12.0
for sensor, colour in zip(SENSORS, COLOURS, strict=True):
    if sensor in ("perfect", "bno055"):
        angle_axes.plot(t[window], -curves[sensor][window], colour, linewidth=1.2, label=sensor)
    error_axes.semilogy(t, np.abs(errors[sensor]) + 1e-4, colour, linewidth=0.8, label=sensor)
angle_axes.set(
    xlabel="time [s]", ylabel="bending of the left elbow [deg]", title="Integrated gyroscopes"
)
error_axes.set(
    xlabel="time [s]", ylabel="error [deg]", title="Error against the formula of the walk"
)
error_axes.axhline(0.1, color="#888888", linewidth=0.8, linestyle="--")
for axes in (angle_axes, error_axes):
    axes.grid(color="#EEEEEE")
    axes.spines[["top", "right"]].set_visible(False)
angle_axes.legend(frameon=False, ncols=2)
error_axes.legend(
    frameon=False,
    ncols=4,
    loc="center",
    bbox_to_anchor=(0.56, 0.45),
    handlelength=1.0,
    columnspacing=1.2,
    fontsize="small",
)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "joint_angles.png", dpi=130)
