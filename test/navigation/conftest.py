# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exact motions with the readings of a perfect IMU, made from closed forms."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import States
from imu_sim_ros.core.timebase import sample_times_ns
from imu_sim_ros.navigation.state import NavigationState, state_of_row, states_of

GRAVITY = np.array([0.0, 0.0, -9.81])
AT_REST = NavigationState(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


class Record(NamedTuple):
    t_ns: np.ndarray
    gyro: np.ndarray
    accel: np.ndarray
    truth: States

    @property
    def initial(self) -> NavigationState:
        return state_of_row(self.truth, 0)


def lecture(t):
    """Return the ellipse of the lecture's simulation with its sinusoidal height, roll and pitch."""
    k = np.pi / 10
    entry = np.ones_like(t)
    s, c, s10, c10 = np.sin(k * t), np.cos(k * t), np.sin(10 * k * t), np.cos(10 * k * t)
    position = np.stack([15 * c + 5, 20 * s + 5, s10 + 5], -1)
    velocity = np.stack([-15 * k * s, 20 * k * c, 10 * k * c10], -1)
    acceleration = np.stack([-15 * k**2 * c, -20 * k**2 * s, -100 * k**2 * s10], -1)
    angles = np.stack([0.1 * np.cos(t), 0.2 * np.sin(t), k * t], -1)
    rates = np.stack([-0.1 * np.sin(t), 0.2 * np.cos(t), k * entry], -1)
    body_rates = (rotation.euler_rates_to_body_rates(angles) @ rates[..., None])[..., 0]
    return position, velocity, acceleration, rotation.from_euler(angles), body_rates


def coning(t):
    """Move the body's axis round a cone: q = (cos a/2, sin a/2 cos nt, sin a/2 sin nt, 0)."""
    angle, n = 0.3, 4.0
    c, s = np.cos(n * t), np.sin(n * t)
    zero = np.zeros_like(t)
    half = np.full_like(t, 0.5 * angle)
    q = np.stack([np.cos(half), np.sin(half) * c, np.sin(half) * s, zero], -1)
    # 2 q* dq/dt
    body_rates = n * np.stack(
        [-np.sin(angle) * s, np.sin(angle) * c, zero - 2 * np.sin(half) ** 2], -1
    )
    position = np.stack([0.5 * c, zero, 0.3 * s], -1)
    velocity = n * np.stack([-0.5 * s, zero, 0.3 * c], -1)
    acceleration = n**2 * np.stack([-0.5 * c, zero, -0.3 * s], -1)
    return position, velocity, acceleration, q, body_rates


def excitation(t):
    """Return a motion of all axes at once, each at its own frequencies, and its derivatives."""
    fp, fa = np.array([2.1, 2.7, 3.3]), np.array([1.7, 2.3, 2.9])
    phase = t[:, None] * fp
    angles = np.array([0.5, 0.4, 0.6]) * np.sin(t[:, None] * fa)
    rates = np.array([0.5, 0.4, 0.6]) * fa * np.cos(t[:, None] * fa)
    body_rates = (rotation.euler_rates_to_body_rates(angles) @ rates[..., None])[..., 0]
    position, velocity = 0.4 * np.sin(phase), 0.4 * fp * np.cos(phase)
    return position, velocity, -(fp**2) * position, rotation.from_euler(angles), body_rates


MOTIONS = {"lecture": lecture, "coning": coning, "excitation": excitation}


@pytest.fixture(scope="session")
def record() -> Callable[..., Record]:
    """Return ``record(motion, rate, duration)``: ideal readings, both ends included."""

    def make(motion: str, rate: float, duration: float) -> Record:
        t_ns = sample_times_ns(0, round(rate * duration) + 1, rate, 1_000_000_000)
        t = (t_ns - t_ns[0]) * 1e-9
        position, velocity, acceleration, q_wb, body_rates = MOTIONS[motion](t)
        force = rotation.rotate_inverse(q_wb, acceleration - GRAVITY)
        truth = states_of(t_ns, position, velocity, q_wb)
        return Record(t_ns, body_rates, force, truth)

    return make


@pytest.fixture(scope="session")
def motions() -> dict[str, Callable]:
    """Return the motions themselves: t (n,) -> position, velocity, acceleration, q_wb, omega_b."""
    return MOTIONS
