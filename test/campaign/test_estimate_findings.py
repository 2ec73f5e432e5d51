# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mistakes that an estimate shows next to the truth; a sound estimate has none."""

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.campaigns.estimate_findings import estimate_findings
from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import States

FLIGHT = ims.simulate(imu="perfect", trajectory="lecture", duration=10, rate=100, seed=1)
TRUTH = States(FLIGHT.truth.t_ns, FLIGHT.truth.position, FLIGHT.truth.q_wb)
N = len(TRUTH.t_ns)


def findings(alignment="yaw", t_ns=TRUTH.t_ns, position=TRUTH.position, q_wb=TRUTH.q_wb):
    return estimate_findings(States(t_ns, position, q_wb), TRUTH, alignment)


def turned(angle, axis, side):
    """Return the attitude with a constant rotation in the body or in the world."""
    turn = rotation.exp(angle * np.array(axis))
    factors = (TRUTH.q_wb, turn) if side == "body" else (turn, TRUTH.q_wb)
    return rotation.multiply(*factors)


@pytest.mark.parametrize("alignment", ["none", "yaw", "se3", "sim3"])
def test_a_sound_estimate_has_no_finding(alignment):
    """Drift, noise, a slower rate, a constant tilt of 5 deg, and rest are none."""
    s = np.linspace(0.0, 1.0, N)[:, None]
    noise = np.random.default_rng(1).normal(size=(N, 3))
    q_wb = rotation.multiply(TRUTH.q_wb, rotation.exp(0.01 * noise))
    drifted = TRUTH.position + 0.2 * s * s + 0.002 * noise
    assert findings(alignment, position=drifted, q_wb=q_wb) == []
    tenth = slice(None, None, 10)
    parts = (TRUTH.t_ns[tenth], drifted[tenth], turned(0.087, [0.0, 1.0, 0.0], "body")[tenth])
    assert findings(alignment, *parts) == []


def test_a_body_at_rest_has_an_estimate_that_stays_the_same():
    still = States(TRUTH.t_ns, np.zeros((N, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (N, 1)))
    assert estimate_findings(still, still, "none") == []


@pytest.mark.parametrize("alignment", ["none", "yaw"])
@pytest.mark.parametrize(("begin", "end"), [(0, N), (300, 600)])
def test_what_is_frozen_is_named(alignment, begin, end):
    frozen_index = np.arange(N)
    frozen_index[begin:end] = begin
    seconds = (end - begin - 1) / 100
    (pose,) = findings(
        alignment, position=TRUTH.position[frozen_index], q_wb=TRUTH.q_wb[frozen_index]
    )
    assert pose.startswith(
        f"frozen: the pose stays the same for {seconds:.3g} s from {begin / 100:g} s"
    )
    (position,) = findings(alignment, position=TRUTH.position[frozen_index])
    assert position.startswith("frozen: the position stays the same")


def test_poses_that_repeat_the_one_before_are_named():
    even_index = np.arange(N) // 2 * 2
    (line,) = findings(position=TRUTH.position[even_index], q_wb=TRUTH.q_wb[even_index])
    assert line == "each pose stands 2 times on average: 50 Hz, not 100 [poses_held]"


@pytest.mark.parametrize("side", ["body", "world"])
@pytest.mark.parametrize(("angle", "axis"), [(np.pi, [1.0, 0.0, 0.0]), (0.5, [0.0, 0.6, 0.8])])
def test_a_constant_error_of_the_attitude_is_named(side, angle, axis):
    (line,) = findings("none", q_wb=turned(angle, axis, side))
    beginning = f"the attitude is off by a constant {np.degrees(angle):.3g} deg about ("
    assert line.startswith(beginning)
    assert f"of the {side}, and the position is right" in line


@pytest.mark.parametrize(
    ("q_wb", "convention"),
    [
        (rotation.conjugate(TRUTH.q_wb), "those of the inverse rotation"),
        (np.roll(TRUTH.q_wb, 1, axis=1), "in the order w, x, y, z [quaternion_order]"),
        (np.roll(TRUTH.q_wb, -1, axis=1), "in the order x, y, z, w [quaternion_order]"),
    ],
)
def test_another_convention_of_quaternions_is_named(q_wb, convention):
    (line,) = findings("none", q_wb=q_wb)
    assert (
        line
        == f"the attitude is wrong, and the position is right: its quaternions are {convention}"
    )


@pytest.mark.parametrize("factor", [2.0, 0.001, 1000.0])
def test_positions_in_another_unit_are_named(factor):
    (line,) = findings("none", position=factor * TRUTH.position)
    assert line == f"the positions are {factor:.3g} times as large as those of the truth"


def test_poses_without_truth_are_counted():
    later = TRUTH.t_ns + 2_000_000_000
    line = findings(t_ns=later, position=TRUTH.position + 1.0)[0]
    assert line == "200 of 1000 poses skipped: no truth at their times"
    assert findings(t_ns=TRUTH.t_ns + 60_000_000_000) == [
        "1000 of 1000 poses skipped: no truth at their times"
    ]
