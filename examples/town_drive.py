# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A car around two blocks with IMU, GNSS receiver and wheels; what each of them sees.

python examples/town_drive.py [FOLDER]
"""

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

import imu_sim_ros as ims
from imu_sim_ros.core import rotation

mpl.use("Agg")
import matplotlib.pyplot as plt

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
flight = ims.simulate(
    imu="bmi088",
    trajectory="town",
    seed=3,
    sensors=["gnss", "wheels"],
    latitude_deg=48.137,
    longitude_deg=11.575,
    gnss={"horizontal_sigma": [1.5, 0.6, 0.2, 0.01], "outages": [60.0, 20.0]},
    wheels={"model": "ackermann", "radius": 0.32, "track": 1.55, "wheelbase": 2.7}
    | {"radius_sigma_percent": 0.5, "steering_offset": [0.0007]},
)
flight.save(folder / "town.mcap")
truth, fixes, wheels = flight.truth, flight.gnss, flight.wheels
t = (truth.t_ns - truth.t_ns[0]) * 1e-9
speed = np.linalg.norm(truth.velocity, axis=1)
angles = np.degrees(rotation.to_euler(truth.q_wb))
way = float(np.sum(speed) * (t[1] - t[0]))
print(f"{t[-1]:.0f} s, {way:.0f} m, up to {speed.max() * 3.6:.0f} km/h")
print(f"roll up to {abs(angles[:, 0]).max():.1f} deg, pitch {abs(angles[:, 1]).max():.1f} deg")
away = np.linalg.norm(wheels.pose[-1, :2] - wheels.true_pose[-1, :2])
print(f"wheels end {away:.1f} m off, {len(fixes.t_ns)} fixes")

figure, (plan, over_time, lean) = plt.subplots(1, 3, figsize=(13.0, 4.0), layout="constrained")
plan.plot(*truth.position[:, :2].T, color="black", label="true path")
plan.plot(*fixes.position[:, :2].T, ".", ms=2.0, color="tab:orange", label="GNSS, 20 s lost")
plan.plot(*wheels.pose[:, :2].T, color="tab:blue", lw=1.0, label="wheels alone")
plan.set(xlabel="x, east [m]", ylabel="y, north [m]", aspect="equal", title="plan")
over_time.plot(t, speed, color="black")
over_time.set(xlabel="time [s]", ylabel="speed [m/s]", title="speed: limits, a light, a stop")
lean.plot(t, angles[:, 0], lw=0.8, label="roll")
lean.plot(t, angles[:, 1], lw=0.8, label="pitch")
lean.set(xlabel="time [s]", ylabel="angle [deg]", title="slope, suspension and road")
for axes in (plan, lean):
    axes.legend(fontsize=8)
for axes in (plan, over_time, lean):
    axes.grid(alpha=0.3)
figure.savefig(folder / "town_drive.png", dpi=100)
