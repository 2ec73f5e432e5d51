# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effect of a spline's degree and knots on the IMU that is simulated along it.

python examples/splines.py [PICTURE]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import NullLocator
from scipy.interpolate import make_interp_spline
from scipy.linalg import expm, logm

import imu_sim_ros as ims

DEGREES = (2, 3, 5)
SPACINGS = (0.4, 0.2, 0.1, 0.05)

# The lecture's path and its accelerations in the world, from equations.
flight = ims.simulate(imu="perfect", trajectory="lecture", duration=20, rate=500)
t = (flight.t_ns - flight.t_ns[0]) * 1e-9
truth = flight.truth
inner = (t > 4) & (t < 16)  # away from the ends, where an interpolation lacks neighbours

print("RMS error of the acceleration of the path's z axis [m/s^2]")
print("knots every    degree 2    degree 3    degree 5")
errors = {degree: [] for degree in DEGREES}
curves = {}
for spacing in SPACINGS:
    knots = slice(None, None, round(spacing * 500))
    for degree in DEGREES:
        spline = make_interp_spline(t[knots], truth.position[knots, 2], degree)
        curves[spacing, degree] = spline.derivative(2)(np.minimum(t, t[knots][-1]))
        difference = curves[spacing, degree] - truth.acceleration[:, 2]
        errors[degree].append(np.sqrt(np.mean(difference[inner] ** 2)))
    row = "".join(f"{errors[degree][-1]:12.2g}" for degree in DEGREES)
    print(f"{spacing:9.2f} s {row}")

print("\nIMU along the package's spline through 20 s of poses, RMS error away from the ends")
print("poses at    accelerometer [m/s^2]    gyroscope [rad/s]")
for rate in (5, 10, 20, 50):
    ims.generate(
        "poses.tum", imu="perfect", trajectory="lecture", duration=20, rate=rate, force=True
    )
    copy = ims.simulate(imu="perfect", trajectory="poses.tum", duration=19.5, rate=500)
    rows = np.flatnonzero(inner[: len(copy.t_ns)])
    accel = np.sqrt(np.mean((copy.accel - flight.accel[: len(copy.t_ns)])[rows] ** 2))
    gyro = np.sqrt(np.mean((copy.gyro - flight.gyro[: len(copy.t_ns)])[rows] ** 2))
    print(f"{rate:5d} Hz {accel:19.1e} {gyro:22.1e}")


def pose(time: float) -> np.ndarray:
    """Return a body that turns at 1 rad/s about z while its origin moves at 1 m/s along x."""
    c, s = np.cos(time), np.sin(time)
    return np.array([[c, -s, 0, time], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


halfway = pose(0.0) @ expm(0.5 * logm(np.linalg.inv(pose(0.0)) @ pose(0.1)).real)
print(f"\nSE(3), knots 0.1 s apart: the origin leaves its line by {1e3 * halfway[1, 3]:.2f} mm")

figure, (curve_axes, error_axes) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
extract = (t > 6) & (t < 9)
styles = {2: ("#E69F00", 1.2), 3: ("#CC79A7", 1.2), 5: ("#0072B2", 1.6)}
for degree, (colour, width) in styles.items():
    label = f"degree {degree}, C{degree - 1}"
    curve_axes.plot(t[extract], curves[0.4, degree][extract], colour, linewidth=width, label=label)
    error_axes.loglog(SPACINGS, errors[degree], "o-", color=colour, markersize=4, label=label)
curve_axes.plot(
    t[extract], truth.acceleration[extract, 2], "#1A1A1A", linewidth=0.8, label="equations"
)
curve_axes.set(xlabel="time [s]", ylabel="acceleration along z [m/s²]", title="Poses every 0.4 s")
error_axes.set(
    xlabel="interval of the poses [s]",
    ylabel="RMS error of the acceleration [m/s²]",
    title="Order of convergence: degree − 1",
)
error_axes.set_xticks(SPACINGS, [f"{spacing:g}" for spacing in SPACINGS], minor=False)
error_axes.xaxis.set_minor_locator(NullLocator())
for axes in (curve_axes, error_axes):
    axes.grid(color="#EEEEEE")
    axes.spines[["top", "right"]].set_visible(False)
curve_axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, frameon=False)
error_axes.legend(frameon=False)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "splines.png", dpi=130)
