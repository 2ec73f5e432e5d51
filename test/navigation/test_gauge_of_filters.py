# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The NEES of filters whose first poses are looser than later ones, as in OpenVINS' texts."""

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import States
from imu_sim_ros.navigation.evaluation import anees_band, pose_nees, remainder

COUNT, FIRST, DT = 300, 10, 0.05
RUNS = 100
SCALE = 0.1
WHEN = (100, 180, 289)
"""Poses at which all runs are judged."""
G = np.array([0.0, 0.0, -9.81])


def motion():
    """Return a path that begins at rest, its velocities and accelerations: exact differences."""
    t = np.arange(COUNT) * DT
    s = np.clip(t - 1.5, 0.0, None)
    u = np.where(s < 2.0, s**2 / 4.0, s - 1.0)
    position = np.stack(
        [4.0 * np.sin(0.5 * u), 3.0 * (1.0 - np.cos(0.7 * u)), 0.5 * np.sin(0.9 * u)], axis=1
    )
    angles = [0.2 * np.sin(u), 0.15 * (1.0 - np.cos(1.3 * u)), 0.5 * u]
    q_wb = rotation.from_euler(np.stack(angles, axis=1))
    velocity = np.diff(position, axis=0, append=position[-1:]) / DT
    acceleration = np.diff(velocity, axis=0, append=velocity[-1:]) / DT
    poses = States((t * 1e9).astype(np.int64), position, q_wb)
    return poses, velocity, acceleration


class Filter:
    """A Kalman filter of position, attitude and velocity, whose errors follow it exactly.

    It begins 0.5 s before its first pose with a tenth of the sigmas that OpenVINS begins with
    (5 cm, 0.02 rad, 1 cm/s), so that its errors are linear, and then measures the velocity in the
    body, which yaw and position do not change. What the tilt has done to the position until its
    first pose is corrected later, and so is the tilt. The world begins where the filter does.
    """

    def __init__(self):
        truth, velocity, acceleration = motion()
        rng = np.random.default_rng(5)
        sigma = SCALE * np.repeat([0.05, 0.02, 0.01], 3)
        noise = SCALE * np.repeat([0.0, 2e-4, 5e-3], 3)
        measured = SCALE * 0.02
        p, e = np.diag(sigma**2), sigma * rng.standard_normal((RUNS, 9))
        e[:, [0, 1, 2, 5]] = 0.0
        errors, covariances = np.empty((COUNT, RUNS, 6)), np.empty((COUNT, 6, 6))
        for k in range(COUNT):
            if k:
                f = np.eye(9)
                f[:3, 6:] = DT * np.eye(3)
                f[6:, 3:6] = -DT * rotation.skew(acceleration[k - 1] - G)
                p = f @ p @ f.T + np.diag(noise**2)
                e = e @ f.T + noise * rng.standard_normal((RUNS, 9))
            if k > FIRST:
                r = rotation.to_matrix(truth.q_wb[k])
                h = np.hstack([np.zeros((3, 3)), r.T @ rotation.skew(velocity[k]), r.T])
                gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + measured**2 * np.eye(3))
                e = e - (e @ h.T + measured * rng.standard_normal((RUNS, 3))) @ gain.T
                reduction = np.eye(9) - gain @ h
                p = reduction @ p @ reduction.T + measured**2 * gain @ gain.T
            errors[k], covariances[k] = e[:, :6], p[:6, :6]
        self.truth = truth.rows(slice(FIRST, None))
        self._errors, self._covariances = errors[FIRST:], covariances[FIRST:]
        self._rng = rng

    def run(self, k, cross):
        """Return an estimate in a world of its own, and the covariances that it states.

        :param cross: False: without those of position with attitude, as in OpenVINS' text.
        """
        error, truth = self._errors[:, k], self.truth
        position = truth.position - error[:, :3]
        q_wb = rotation.multiply(rotation.exp(-error[:, 3:]), truth.q_wb)
        yaw = rotation.exp(np.array([0.0, 0.0, self._rng.uniform(-3.0, 3.0)]))
        turn = np.kron(np.eye(2), rotation.to_matrix(yaw))
        stated = turn @ self._covariances @ turn.T
        if not cross:
            stated[:, :3, 3:] = stated[:, 3:, :3] = 0.0
        moved = rotation.rotate(yaw, position) + self._rng.uniform(-9.0, 9.0, 3)
        return States(truth.t_ns, moved, rotation.multiply(yaw, q_wb)), stated


@pytest.fixture(scope="module")
def converging():
    return Filter()


@pytest.mark.parametrize("cross", [True, False], ids=["whole covariances", "blocks alone"])
def test_a_filter_that_converges_is_consistent(converging, cross):
    """Mean NEES of position and attitude 5, 9 and 14.5 s after the first pose, of 100 runs.

    The band holds 99.9 % of the means of 100 chi-squares of 3 degrees of freedom: 2.26 to 3.87.
    """
    values = {"position": [], "attitude": []}
    for k in range(RUNS):
        estimate, stated = converging.run(k, cross)
        for name, nees in values.items():
            part = remainder(name, stated, estimate, converging.truth, "yaw")
            assert part.usable[list(WHEN)].all()
            errors, covariances = part.errors[list(WHEN)], part.covariances[list(WHEN)]
            nees.append(np.einsum("ki,kij,kj->k", errors, np.linalg.inv(covariances), errors))
    low, high = anees_band(3, RUNS, 0.999)
    assert (low, high) == pytest.approx((2.26, 3.87), abs=0.01)
    for name, nees in values.items():
        means = np.mean(nees, axis=0)
        assert ((low < means) & (means < high)).all(), (name, means)


def test_each_part_has_the_pose_at_which_it_holds(converging):
    """The yaw is known as well at the first pose as later; the position is not for a second."""
    estimate, stated = converging.run(0, cross=False)
    nees, why = pose_nees(stated, estimate, converging.truth, "yaw")
    assert why is None
    assert nees["gauge"] == "a later pose"
    assert nees["attitude"]["fixed_s"] == 0.0
    assert 0.5 < nees["position"]["fixed_s"] < 2.0
    assert nees["attitude"]["poses"] == nees["attitude"]["of"] - 1 == COUNT - FIRST - 1
    assert 0.95 * nees["position"]["of"] <= nees["position"]["poses"] < COUNT - FIRST


def test_a_covariance_that_is_too_small_shows(converging):
    """A filter that states half of its sigmas has four times the NEES."""
    ratios = []
    for k in range(20):
        estimate, stated = converging.run(k, cross=False)
        means = [
            pose_nees(factor * stated, estimate, converging.truth, "yaw")[0]["attitude"]["mean"]
            for factor in (1.0, 0.25)
        ]
        ratios.append(means[1] / means[0])
    assert ratios == pytest.approx([4.0] * 20, rel=1e-6)


def test_what_is_wrong_is_blamed(converging):
    estimate, stated = converging.run(0, cross=False)
    truth = converging.truth
    # Ever surer of its yaw, which nothing measures: the position has lever arms of it.
    surer = stated.copy()
    surer[:, 5, 5] *= np.linspace(1.0, 0.5, len(surer))
    nees, why = pose_nees(surer, estimate, truth, "yaw")
    assert nees is None or nees["attitude"] is None
    assert "attitude: later poses state no larger covariances than earlier ones" in why
    # Constant covariances do not grow either; without an alignment they are as good as others.
    constant = np.tile(stated[-1], (len(stated), 1, 1))
    nees, why = pose_nees(constant, estimate, truth, "yaw")
    assert nees is None
    assert why.startswith("position: later poses state no larger covariances than earlier ones")
    assert pose_nees(constant, truth, truth, "none")[0]["position"]["mean"] == 0.0
    for nothing in (0.0 * stated, np.nan * stated):
        assert pose_nees(nothing, estimate, truth, "yaw") == (
            None,
            "the estimate's covariances are singular",
        )
    # A position without a covariance does not cost the attitude its own.
    blind = stated.copy()
    blind[:, :3] = blind[:, :, :3] = 0.0
    nees, why = pose_nees(blind, estimate, truth, "yaw")
    assert why == "position: the estimate's covariances are singular"
    assert nees["position"] is None
    assert nees["attitude"]["poses"] == len(stated) - 1
    # A yaw that nobody knows is no uncertain attitude: it is fixed.
    unknown = stated.copy()
    unknown[:, 5, 5] += 9.0
    assert pose_nees(unknown, estimate, truth, "none")[1].startswith("not valid: the attitude is")
