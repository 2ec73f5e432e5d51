# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A Monte-Carlo loop: how far a sensor drifts, over many seeds.

`campaign` does this for any estimator on all cores; here is the loop itself.

    python examples/monte_carlo.py [FOLDER] [RUNS]
"""

import sys
from pathlib import Path

import numpy as np

import imu_sim_ros as ims

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
runs = int(sys.argv[2]) if len(sys.argv) > 2 else 40
for imu in ("tactical", "navigation"):
    errors = []
    for seed in range(runs):
        flight = ims.simulate(imu=imu, trajectory="figure_eight", duration=30, seed=seed)
        errors.append(ims.evaluate(ims.dead_reckon(flight), flight.truth).position)
    final = np.linalg.norm(np.array(errors)[:, -1], axis=1)
    low, middle, high = np.percentile(final, [5, 50, 95])
    print(f"{imu}: {middle:.3g} m after 30 s (5 to 95 %: {low:.3g} to {high:.3g} m)")
np.save(folder / "monte_carlo.npy", np.array(errors))
