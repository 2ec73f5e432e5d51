# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A digital twin: from a sensor's record at rest to a simulation with the same noise.

Give a bag of your own IMU at rest; without one a simulated sensor stands for it.

    python examples/digital_twin.py [FOLDER] [BAG]
"""

import sys
from pathlib import Path

import numpy as np

import imu_sim_ros as ims

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
if len(sys.argv) > 2:
    bag = Path(sys.argv[2])
else:
    stranger = ims.simulate(imu="adis16448", trajectory="static", duration="20min", seed=11)
    bag = stranger.save(folder / "stranger.mcap", imu_only=True)

# 1. What the record reveals, with 95 % intervals.
noise = ims.allan(bag)
print(noise)

# 2. The twin has these densities; those consistent with zero are left out.
imu = {"preset": "perfect"}
for name in ("gyroscope", "accelerometer"):
    triad = getattr(noise, name)
    for key in ("noise_density", "random_walk"):
        imu[f"{name}_{key}"] = np.nan_to_num(getattr(triad, key).value)
twin = ims.simulate(imu=imu, trajectory="static", duration="20min", rate=noise.rate, seed=12)

# 3. Its record shows the same.
again = ims.allan(twin)
for name in ("gyroscope", "accelerometer"):
    ratio = getattr(again, name).noise_density.value / getattr(noise, name).noise_density.value
    print(f"{name} noise density, twin to original:", ratio.round(3))
again.plot().savefig(folder / "digital_twin.png", dpi=120)
