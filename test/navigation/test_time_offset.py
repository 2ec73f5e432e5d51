# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The offset between two clocks: its interval over many seeds, and motion that does not tell it."""

import numpy as np
import pytest
from scipy.signal import lfilter

import imu_sim_ros as ims
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import States
from imu_sim_ros.navigation.time_offset import OffsetInterval, time_offset

OFFSET = 0.0073
RATE, EVERY = 100, 5


@pytest.fixture(scope="module")
def truth():
    """Return the true poses of half a minute at 100 Hz."""
    return poses_of(ims.simulate(imu="perfect", trajectory="lecture", duration=30, rate=RATE))


def poses_of(flight) -> States:
    t = flight.truth
    return States(t_ns=t.t_ns, position=t.position, q_wb=t.q_wb, source="truth")


def noisy(truth: States, seed: int, white: float, drift: float) -> States:
    """Return an estimate at 20 Hz with a clock that is early, white noise and a random walk.

    :param white: deviation of a position [m]; a tenth of it for the attitude [rad].
    :param drift: density of the position's walk [m/sqrt(s)]; a fiftieth for the attitude.
    """
    rng = np.random.default_rng(seed)
    rows = np.arange(0, len(truth.t_ns), EVERY)
    step = np.sqrt(EVERY / RATE)
    walk, turn = step * np.cumsum(rng.standard_normal((2, len(rows), 3)), axis=1)
    noise, jitter = white * rng.standard_normal((2, len(rows), 3))
    q = rotation.multiply(rotation.exp(0.02 * drift * turn), truth.q_wb[rows])
    return States(
        t_ns=truth.t_ns[rows] - round(OFFSET * 1e9),
        position=truth.position[rows] + noise + drift * walk,
        q_wb=rotation.multiply(q, rotation.exp(0.1 * jitter)),
        source="estimate",
    )


def intervals(truth, runs, white, drift) -> list[OffsetInterval]:
    return [time_offset(noisy(truth, seed, white, drift), truth) for seed in range(runs)]


def count_containing(estimated: list[OffsetInterval]) -> int:
    return sum(offset.low <= OFFSET <= offset.high for offset in estimated)


def test_the_interval_holds_the_offset(truth):
    """Fewer than 12 of 15 intervals of 95 % hold once in 180 times."""
    estimated = intervals(truth, 15, 0.002, 0.03)
    assert count_containing(estimated) >= 12
    assert np.median([offset.high - offset.low for offset in estimated]) < 6e-3


def test_the_interval_holds_where_few_turns_tell_the_offset():
    """A tour along aisles with errors that last for seconds.

    Of 40 intervals of 95 %, fewer than 34 hold once in 290 times.
    """
    tour = {"type": "tour", "place": "warehouse"}
    truth = poses_of(ims.simulate(imu="perfect", trajectory=tour, duration=60, rate=50, seed=1))
    rows = np.arange(0, len(truth.t_ns), 10)
    phi = np.exp(-0.2 / 5.0)
    offsets = []
    for seed in range(40):
        drive = np.sqrt(1.0 - phi**2) * np.random.default_rng(seed).standard_normal((len(rows), 6))
        error = lfilter([1.0], [1.0, -phi], drive, axis=0)
        estimate = States(
            t_ns=truth.t_ns[rows] - round(OFFSET * 1e9),
            position=truth.position[rows] + 0.02 * error[:, :3],
            q_wb=rotation.multiply(truth.q_wb[rows], rotation.exp(0.002 * error[:, 3:])),
        )
        offsets.append(time_offset(estimate, truth))
    assert count_containing(offsets) >= 34


@pytest.mark.slow
@pytest.mark.parametrize(("white", "drift"), [(0.005, 0.0), (0.002, 0.03), (0.01, 0.06)])
def test_the_interval_holds_over_sixty_seeds(truth, white, drift):
    """Fewer than 51 of 60 intervals of 95 % hold once in 700 times."""
    assert count_containing(intervals(truth, 60, white, drift)) >= 51


def test_motion_that_does_not_determine_the_offset_is_refused():
    """Nearly constant speed on a straight line: only noise tells one offset from another."""
    t = np.arange(0.0, 60.0, 1.0 / RATE)
    straight = np.stack([1.2 * t + 0.02 * np.sin(0.5 * t), 0.0 * t, 0.0 * t], axis=1)
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    t_ns = np.round(t * 1e9).astype(np.int64) + 10**9
    truth = States(t_ns=t_ns, position=straight, q_wb=q, source="truth")
    for seed in range(5):
        with pytest.raises(InputError, match="the motion does not (determine|reveal)"):
            time_offset(noisy(truth, seed, 0.005, 0.01), truth)
