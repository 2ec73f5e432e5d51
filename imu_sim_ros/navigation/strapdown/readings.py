# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of a record of readings before it is integrated."""

import math

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs import gate

Array = NDArray[np.float64]


def check_readings(
    t_ns: NDArray[np.int64], gyro: Array, accel: Array, max_gap: float = math.inf
) -> None:
    """Make sure that readings can be integrated.

    :param t_ns: (n,) stamps [ns].
    :param gyro: (n, 3) [rad/s].
    :param accel: (n, 3) [m/s^2].
    :param max_gap: longest interval that is bridged [s].
    :raises InputError: with a line for each thing that is wrong.
    """
    n = len(t_ns)
    if gyro.shape != (n, 3) or accel.shape != (n, 3):
        raise InputError(
            f"{n} stamps need readings of shape ({n}, 3): gyro has {gyro.shape}, "
            f"accel {accel.shape}"
        )
    if n < 2:
        raise InputError(f"{n} reading{'' if n == 1 else 's'}: integration needs at least two")
    steps = np.diff(t_ns)
    problems = [*_order_problems(t_ns, steps), *_gap_problems(t_ns, steps, max_gap)]
    problems += gate.readings(t_ns, gyro, accel).problems("readings")
    if problems:
        raise InputError(problems)


def _order_problems(t_ns: NDArray[np.int64], steps: NDArray[np.int64]) -> list[str]:
    problems: list[str] = []
    if steps.min() > 0:
        return problems
    for what, bad in (("repeated", steps == 0), ("earlier than the one before them", steps < 0)):
        if bad.any():
            first = int(np.argmax(bad)) + 1
            problems.append(
                f"{np.count_nonzero(bad)} stamps are {what}, "
                f"the first is number {first} ({t_ns[first]} ns)"
            )
    return problems


def _gap_problems(
    t_ns: NDArray[np.int64], steps_ns: NDArray[np.int64], max_gap: float
) -> list[str]:
    if steps_ns.max() * 1e-9 <= max_gap:
        return []
    steps = steps_ns * 1e-9
    gaps = steps > max_gap
    first = int(np.argmax(gaps))
    return [
        f"{np.count_nonzero(gaps)} gaps are longer than max_gap = {max_gap:g} s, the first is "
        f"{steps[first]:.6g} s after number {first} ({t_ns[first]} ns)"
    ]
