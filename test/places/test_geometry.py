# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rays meet rectangles where their equations say."""

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.places.geometry import Caster, is_hidden, surfaces
from imu_sim_ros.places.sight import is_hidden_place


def rectangles(count, aligned):
    stream = np.random.default_rng(4)
    result = []
    for k in range(count):
        q = stream.standard_normal(4)
        turn = np.eye(3)[:, np.roll([0, 1, 2], k)]
        if not aligned:
            turn = rotation.to_matrix(q / np.linalg.norm(q))
        across, up = (turn[:, j] * stream.uniform(0.3, 3.0) for j in (0, 1))
        result.append((stream.uniform(-3.0, 3.0, 3), across, up))
    return surfaces(result, hides=True)


def met_plainly(where, origin, direction):
    """Solve ``origin + t direction = o + s a + r b`` for each rectangle."""
    best = np.inf, -1
    for m in range(len(where.origin)):
        matrix = np.stack([direction, -where.across[m], -where.up[m]], axis=1)
        t, s, r = np.linalg.solve(matrix, where.origin[m] - origin)
        if t > 1e-4 and 0.0 <= s <= 1.0 and 0.0 <= r <= 1.0 and t < best[0]:
            best = t, m
    return best


@pytest.mark.parametrize("aligned", [True, False])
def test_a_ray_meets_what_the_equations_say(aligned):
    where = rectangles(40, aligned)
    stream = np.random.default_rng(5)
    origins, ways = stream.uniform(-3.0, 3.0, (500, 3)), stream.standard_normal((500, 3))
    hits = Caster(where).cast(origins, ways)
    expected = [met_plainly(where, o, d) for o, d in zip(origins, ways, strict=True)]
    assert hits.surface.tolist() == [m for _, m in expected]
    hit = hits.surface >= 0
    assert 100 < hit.sum() < 500
    distances = np.array([t for t, _ in expected])
    assert np.abs(hits.distance[hit] - distances[hit]).max() < 1e-10  # m, rounding alone
    single = Caster(where, np.float32).cast(origins, ways)
    agreeing = single.surface == hits.surface
    assert agreeing.mean() > 0.98  # at an edge the other side may win
    both = hit & agreeing
    assert np.abs(single.distance[both] - hits.distance[both]).max() < 1e-4


def test_what_is_blocked_is_what_is_hidden():
    where = rectangles(30, aligned=False)
    stream = np.random.default_rng(6)
    eyes, points = stream.uniform(-4.0, 4.0, (2, 800, 3))
    blocked = Caster(where).is_blocked(eyes, points - eyes)
    assert np.array_equal(blocked, is_hidden(where, eyes, points))
    assert 0.1 < blocked.mean() < 0.9


@pytest.mark.parametrize("aligned", [True, False])
@pytest.mark.parametrize("count", [3, 30])
def test_places_are_hidden_from_a_lamp_as_rays_to_it_are_blocked(count, aligned):
    """Bundles of places leave out only rectangles in other directions, behind, or turned away."""
    where = rectangles(count, aligned)
    stream = np.random.default_rng(7)
    shares = []
    for _ in range(8):
        eye, axis = stream.uniform(-1.0, 1.0, 3), stream.standard_normal(3)
        axis /= np.linalg.norm(axis)
        points = stream.uniform(-6.0, 6.0, (3000, 3)).astype(np.float32)
        points = points[(points - eye) @ axis > 0.05]
        facing = ((eye - where.origin) * where.normal).sum(axis=1) > 0.0
        blocked = Caster(where.some(facing)).is_blocked(
            np.broadcast_to(eye, points.shape), points - eye, 1.0 - 1e-4
        )
        hidden = is_hidden_place(where, eye, axis, points)
        assert (hidden != blocked).mean() < 1e-3  # at an edge rounding decides
        shares.append(blocked.mean())
    assert 0.02 < np.mean(shares) < 0.95
