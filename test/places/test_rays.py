# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rays through rectangles, meshes and moving bodies, against closed forms."""

import numpy as np
import pytest

from imu_sim_ros.core.errors import MissingDependencyError
from imu_sim_ros.places import rays
from imu_sim_ros.places.bodies import Course, MovingBody
from imu_sim_ros.places.geometry import NO_SURFACES, surfaces
from imu_sim_ros.places.mesh import MeshCaster, fibonacci_directions
from imu_sim_ros.places.mesh_file import mesh_of_rectangles
from imu_sim_ros.places.place import PlaceBuilder, Site
from imu_sim_ros.places.rays import RayTracer

RNG = np.random.default_rng(4)
HALF = np.array([3.0, 2.0, 1.5])


def box(half=HALF):
    """Return the six faces of a box around the origin."""
    faces = []
    for axis in range(3):
        across, up = np.zeros((2, 3))
        across[(axis + 1) % 3], up[(axis + 2) % 3] = 2 * half[(axis + 1) % 3], 2 * half[axis - 1]
        for side in (-1.0, 1.0):
            origin = -half.copy()
            origin[axis] = side * half[axis]
            faces.append((origin, across, up))
    return surfaces(faces, hides=True)


def within_box(origins, directions):
    """Return distance, wall and cosine from inside the box, in closed form: nearest of 3 slabs."""
    with np.errstate(divide="ignore"):
        ends = (np.sign(directions) * HALF - origins) / directions
    axis = np.argmin(ends, axis=1)
    rows = np.arange(len(axis))
    return ends[rows, axis], 2 * axis + (directions[rows, axis] > 0), np.abs(directions[rows, axis])


@pytest.fixture(params=["embree", "mesh", "rectangles"])
def of_the_box(request, monkeypatch):
    """Return a tracer of a box: rectangles with embreex, a mesh, and rectangles without embreex."""
    if request.param != "rectangles":
        pytest.importorskip("embreex")
    if request.param == "mesh":
        return RayTracer(NO_SURFACES, MeshCaster(mesh_of_rectangles(box().corners)))
    if request.param == "rectangles":

        def missing(_):
            raise MissingDependencyError("embreex")

        monkeypatch.setattr(rays, "MeshCaster", missing)
    return RayTracer(box())


def test_a_box_is_met_where_its_walls_are(of_the_box):
    count = 100_000  # more than are processed at once
    origins = RNG.uniform(-0.9, 0.9, (count, 3)) * HALF
    directions = fibonacci_directions(count)
    hits = of_the_box.trace(np.zeros(count), origins, directions)
    distance, face, along = within_box(origins, directions)
    # Double precision, a few roundings of numbers of 10 m; the edges themselves belong to either.
    assert np.abs(hits.distance - distance).max() < 1e-12
    number = hits.surface // (2 if hits.surface.max() > 5 else 1)  # two triangles a wall
    assert np.mean(number != face) < 1e-4
    assert np.abs(np.abs(hits.along) - along)[number == face].max() < 1e-12
    assert not hits.body.any()


def test_nothing_is_met_through_the_sky():
    sky = np.zeros(6, np.bool_)
    sky[5] = True  # +z
    tracer = RayTracer(box(), seen_through=sky)
    directions = np.array([[0.0, 0, 1], [0, 0, -1], [1, 0, 0]])
    hits = tracer.trace(np.zeros(3), np.zeros((3, 3)), directions)
    assert np.array_equal(hits.distance, [np.inf, 1.5, 3.0])
    assert np.array_equal(hits.surface, [-1, 4, 1])
    assert hits.along[0] == 0.0


def test_rays_hit_nothing_in_an_empty_world():
    hits = RayTracer(NO_SURFACES).trace(np.zeros(4), np.zeros((4, 3)), fibonacci_directions(4))
    assert np.isinf(hits.distance).all()
    assert (hits.surface == -1).all()


def moving_block():
    """Return a block 1 m wide, 2 m long and 1 m high, which drives along x and turns."""
    b = PlaceBuilder(Site(np.zeros(3), np.ones(3), np.zeros((0, 3))))
    b.box((-1.0, -0.5, 0.0), (1.0, 0.5, 1.0), "paint:808080", leave="")
    t = np.arange(64) * 0.25
    controls = np.column_stack([4.0 + 2.0 * np.sin(2 * np.pi * t / 16.0), 0.0 * t, 0.4 * t])
    return MovingBody("block", "cart", tuple(b.faces), Course(controls), -0.5)


def test_a_moving_body_is_met_where_it_is_at_each_rays_own_time():
    """Rays over 0.1 s hit the moving box as a box at rest in the pose of their time."""
    block, count = moving_block(), 20_000
    t = np.sort(RNG.uniform(3.0, 3.1, count))
    directions = np.column_stack([np.ones(count), RNG.uniform(-0.6, 0.6, (count, 2))])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = RNG.uniform(-0.1, 0.1, (count, 3))
    hits = RayTracer(NO_SURFACES, bodies=[block]).trace(t, origins, directions)
    start = block.to_body(t, origins)
    end = block.to_body(t, origins + directions)
    way = end - start
    low, high = np.array([-1.0, -0.5, 0.0]), np.array([1.0, 0.5, 1.0])
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(low - start) / way, (high - start) / way])
    entry_distance, exit_distance = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    meets = (entry_distance < exit_distance) & (entry_distance > 0.0)
    assert 0.02 < meets.mean() < 0.9
    assert (np.isfinite(hits.distance) == meets).mean() > 0.9995  # all but some edges
    both = np.isfinite(hits.distance) & meets
    assert np.abs(hits.distance - entry_distance)[both].max() < 1e-9
    assert (hits.body[np.isfinite(hits.distance)] == 1).all()


def test_what_is_nearer_hides_what_is_farther():
    wall = surfaces(
        [(np.array([2.0, -5, -5]), np.array([0.0, 10, 0]), np.array([0.0, 0, 10]))], True
    )
    tracer = RayTracer(wall, bodies=[moving_block()])
    hits = tracer.trace(np.full(1, 3.0), np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]))
    assert hits.distance[0] == pytest.approx(2.0, abs=1e-12)
    assert hits.body[0] == 0
    behind = tracer.trace(np.full(1, 3.0), np.array([[2.5, 0, 0]]), np.array([[1.0, 0.0, 0.0]]))
    assert behind.body[0] == 1
