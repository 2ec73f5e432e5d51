# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Preintegration against brute force: the covariance of the deltas, predicted and counted.

python examples/preintegration.py [RUNS]
"""

import sys
import time

import numpy as np

import imu_sim_ros as ims

runs = int(sys.argv[1]) if len(sys.argv) > 1 else 60
setup = {"trajectory": "figure_eight", "duration": 11, "rate": 200}

# Without noise: the deltas that are true.
exact = ims.preintegrate(ims.simulate(imu="perfect", **setup), every=0.5)
flight = ims.simulate(imu="lecture", **setup)
started = time.perf_counter()
predicted = ims.preintegrate(flight, every=0.5)
print(f"{len(predicted.alpha)} intervals in {1e3 * (time.perf_counter() - started):.1f} ms")

# Brute force: the spread of alpha and beta over many seeds.
alpha, beta = [], []
for seed in range(runs):
    deltas = ims.preintegrate(ims.simulate(imu="lecture", seed=seed, **setup), every=0.5)
    alpha.append(deltas.alpha - exact.alpha)
    beta.append(deltas.beta - exact.beta)
for name, errors, place in (("alpha", alpha, slice(0, 3)), ("beta", beta, slice(6, 9))):
    counted = np.mean(np.square(errors))
    variances = np.diagonal(predicted.covariance, axis1=1, axis2=2)[:, place]
    print(
        f"{name}: predicted / counted standard deviation {np.sqrt(variances.mean() / counted):.3f}"
    )
