# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Places before a camera: truth of depth, corners and tracks; the same bytes everywhere."""

import hashlib

import numpy as np
import pytest
from corner_judge import WIDE_CAMERA, judged
from small_camera import SMALL_CAMERA, imager_of, without_textures

from imu_sim_ros.camera import build_rig
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.places.catalogue import KINDS, build, usual
from imu_sim_ros.places.geometry import Caster, is_hidden, surfaces
from imu_sim_ros.places.light import Lamp, Lighting
from imu_sim_ros.places.paint import Painter
from imu_sim_ros.places.place import CLEARANCE, Place, PlaceBuilder, Site
from imu_sim_ros.places.sheet import Print
from imu_sim_ros.places.tour import clearance
from imu_sim_ros.sensors.camera.images.imager import Imager
from imu_sim_ros.sensors.camera.images.loops import shine
from imu_sim_ros.sensors.camera.images.renderer import Renderer
from imu_sim_ros.sensors.camera.images.texture import atlas
from imu_sim_ros.sensors.camera.scene_parameters import CorridorParameters
from imu_sim_ros.sensors.camera.view import CameraPoses, Eyes, transform_to_camera
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.kinds import Waypoints
from imu_sim_ros.trajectory.parameters import TourParameters
from imu_sim_ros.trajectory.tour import tour, waypoints

SMALL = {**SMALL_CAMERA, "scene__horizon": 10.0}
NARROW = {"trajectory__y.amplitude": [1.2]}
"""A figure eight that fits a corridor."""
HANGING = ("poster", "notices", "whiteboard", "clock", "outlet")


def make_imager(make_rig, kind, **values):
    rig = make_rig("figure_eight", **{**SMALL, **NARROW, "scene__type": kind, **values})
    return rig, imager_of(rig)


def distances_plainly(surfaces, eye, rays):
    """Return how far (n,) the nearest fronts are that rays (n, 3) of float64 meet."""
    o, a, b = surfaces[:3]
    n = np.cross(a, b)
    slope = rays @ n.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (n * (o - eye)).sum(axis=1) / slope
        intersection = eye + t[:, :, None] * rays[:, None] - o
        s, r = ((intersection * side).sum(axis=2) / (side * side).sum(axis=1) for side in (a, b))
    hit = (slope < 0.0) & (t > 0.0) & (s >= 0.0) & (s <= 1.0) & (r >= 0.0) & (r <= 1.0)
    return np.where(hit, t, np.inf).min(axis=1)


@pytest.mark.parametrize("kind", KINDS)
def test_depth_is_that_of_the_surfaces_equation(make_rig, kind):
    """To 0.1 mm, or float32's 6e-8 of the distance times what a grazing ray makes of it."""
    rig = make_rig("figure_eight", **{**SMALL, **NARROW, "scene__type": kind})
    view = rig.views["cam0"]
    renderer = Renderer(view.model, rig.scene.surfaces, without_textures(rig.scene), 1)
    stream = np.random.default_rng(2)
    good = checked = 0
    for t in (0.5, 3.0, 6.0):
        poses = view.poses(rig.trajectory, np.array([t]))
        depth = renderer.depth(Eyes(poses))
        u, v = stream.integers(0, 188, 60), stream.integers(0, 120, 60)
        rays = view.model.unproject(np.column_stack([u, v]).astype(float)).direction
        ways = rotation.rotate(np.tile(poses.q_wc[0], (len(rays), 1)), rays)
        expected = distances_plainly(rig.scene.surfaces, poses.position[0], ways) * rays[:, 2]
        error = np.abs(depth[v, u] - expected)
        good += np.count_nonzero(error < 1e-4 * np.maximum(1.0, expected / 5.0))
        checked += len(rays)
    assert good >= 0.97 * checked  # at an edge the other side may win


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_stands_in_the_path(make_rig, kind):
    rig = make_rig("figure_eight", **{**SMALL, **NARROW, "scene__type": kind})
    where = rig.scene.surfaces
    path = rig.views["cam0"].poses(rig.trajectory, np.linspace(0.0, 10.0, 400)).position
    ways = np.random.default_rng(7).standard_normal((30, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    hits = Caster(where).cast(np.tile(path, (30, 1)), ways.repeat(len(path), axis=0))
    assert hits.distance.min() > 0.9 * CLEARANCE
    assert not is_hidden(where, path[:-1], path[1:]).any()
    # However much of it is flown.
    short = make_rig("figure_eight", duration=2.0, **{**SMALL, **NARROW, "scene__type": kind})
    assert np.array_equal(short.scene.surfaces.origin, where.origin)
    assert len(where.origin) >= 10


def test_a_wide_hall_has_tanks_wherever_the_path_leaves_room():
    def tanks(size, path):
        low, high = usual("machine_hall", size)
        faces = build("machine_hall", Site(low, high, np.array(path).reshape(-1, 3))).faces
        return sum(face.material == "metal:a8acae" for face in faces) / 10

    wide = (30.0, 24.0, 8.0)
    assert tanks((0.0, 0.0, 0.0), []) == 0
    assert tanks(wide, []) == 18  # two rows of 9, each 2.8 m
    assert tanks(wide, [[3.2 - 15.0, 4.6 - 12.0, 2.0]]) == 17
    assert tanks(wide, [[0.0, 0.0, 2.0]]) == 18


def test_the_same_parameters_give_the_same_bytes(make_rig):
    """On the oldest libraries and today's: this file runs on both."""
    values = {"scene__light": "lamps", "scene__texture": "rich", "camera__encoding": "rgb8"}
    rig, areas = make_imager(make_rig, "corridor", **values)
    view = make_rig(
        "figure_eight",
        **{**SMALL, **NARROW, "scene__type": "corridor", **values},
        camera__antialiasing=False,
    ).views["cam0"]
    points = Imager(view, rig.scene, areas.atlas, rig.trajectory)
    for imager, expected in ((points, "bdf9384fa26c6da2"), (areas, "ee68e652e2367f77")):
        pictures = imager.image(20).tobytes() + imager.image(90).tobytes()
        assert hashlib.sha256(pictures).hexdigest()[:16] == expected


def test_texture_and_light_change_what_is_seen_and_nothing_else(make_rig):
    rigs, images = {}, {}
    for texture, light in (("rich", "lamps"), ("blank", "lamps"), ("rich", "dim")):
        values = {"scene__texture": texture, "scene__light": light}
        rigs[texture, light], imager = make_imager(make_rig, "corridor", **values)
        images[texture, light] = np.stack([imager.image(k) for k in (10, 60, 110)]).astype(float)
    rich, blank, dim = images.values()
    assert dim.mean() < 0.75 * rich.mean()
    slopes = [np.abs(np.diff(stack, axis=2)).mean() for stack in (rich, blank)]
    assert slopes[1] < 0.8 * slopes[0]
    reference, *variants = rigs.values()
    for rig in variants:
        assert np.array_equal(reference.scene.surfaces.origin, rig.scene.surfaces.origin)
        assert np.array_equal(reference.scene.landmarks, rig.scene.landmarks)


def test_landmarks_are_on_surfaces_and_seen_where_nothing_hides_them(make_rig):
    rig = make_rig("figure_eight", **{**SMALL, "scene__type": "office", "scene__landmarks": 500})
    tracks = next(rig.tracks("cam0", 40))
    assert np.bincount(tracks.frame).min() > 3
    poses = rig.views["cam0"].poses(rig.trajectory, np.arange(40) / 20.0)
    points, eye = rig.scene.landmarks[tracks.landmark], poses.position[tracks.frame]
    hits = Caster(rig.scene.surfaces).cast(eye, points - eye)
    assert np.abs(hits.distance - 1.0).max() < 1e-6
    local = transform_to_camera(CameraPoses(eye, poses.q_wc[tracks.frame]), points)
    uv, valid = rig.views["cam0"].model.project(local)
    assert valid.all()
    assert np.abs(uv - tracks.uv_true).max() < 1e-9


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_hangs_on_a_wall_hangs_before_nothing_else_and_behind_nothing(kind, seed):
    """Neither over another print, nor behind a bookcase: rays from 0.3 m in front of it meet it."""
    low, high = usual(kind, (0.0, 0.0, 0.0))
    place = build(kind, Site(low, high, np.zeros((0, 3)), seed, "rich"))
    starts, ways, walls = [], [], []
    for m, face in enumerate(place.faces):
        hung = [hanging for hanging in face.prints if hanging.kind in HANGING]
        obstacles = [
            hanging for hanging in face.prints if hanging.kind not in ("strip", "band", "plinth")
        ]
        for hanging in hung:
            over = [
                neighbour
                for neighbour in obstacles
                if neighbour is not hanging
                and hanging.left < neighbour.left + neighbour.width
                and neighbour.left < hanging.left + hanging.width
                and hanging.bottom < neighbour.bottom + neighbour.height
                and neighbour.bottom < hanging.bottom + hanging.height
            ]
            assert over == []
            origin, across, up = face.rectangle
            units = [side / np.linalg.norm(side) for side in (across, up)]
            normal = np.cross(*units)
            grid = np.stack(np.meshgrid(*[np.linspace(0.02, 0.98, 12)] * 2), axis=-1).reshape(-1, 2)
            corner, size = (hanging.left, hanging.bottom), (hanging.width, hanging.height)
            points = origin + (corner + grid * size) @ np.array(units)
            starts.append(points + 0.3 * normal)
            ways.append(np.broadcast_to(-normal, points.shape))
            walls.append(m)
    assert len(walls) >= {"office": 5, "corridor": 3, "machine_hall": 1}.get(kind, 0)
    if walls:
        hits = Caster(place.surfaces()).cast(np.concatenate(starts), np.concatenate(ways))
        assert np.array_equal(hits.surface, np.repeat(walls, len(grid)))


def test_texels_suit_the_nearest_distance_and_all_of_them_are_bounded():
    """A desk next to the path has texels of half the usual size, a wall out of reach larger ones.

    A texel is a pixel of EuRoC's camera, 2.2 mrad, where the face is nearest, to within a factor of
    sqrt(2) for the steps of two, and another of two on floors and ceilings.
    """
    low, high = usual("office", (0.0, 0.0, 0.0))
    site = Site(low, high, np.zeros((0, 3)), 1)
    place = build("office", site)
    path = np.array([[-3.0, -2.0, 1.35], [-2.0, -2.0, 1.35]])
    where = place.surfaces()
    texels = Painter(place, site, path).texels(1e12)
    away = np.array([clearance(where.some(np.arange(len(texels)) == m), path).min()
                     for m in range(len(texels))])  # fmt: skip
    ideal = 0.0022 * away
    middle = (ideal > 0.0026) & (ideal < 0.019) & (np.abs(where.normal[:, 2]) < 0.9)
    ratio = texels[middle] / ideal[middle]
    assert len(ratio) > 100
    assert 0.7 <= ratio.min() < ratio.max() <= 1.4143
    assert texels.min() == 0.00125
    assert texels.max() > 0.009
    assert (Painter(place, site).texels(1e12) == 0.0025).all()
    for budget in (36e6, 5e6):
        some = Painter(place, site, path).texels(budget)
        assert (where.sides.prod(axis=1) / some**2).sum() <= 1.0001 * budget


def test_no_part_of_a_crown_is_black():
    """The darkest light on a tree is half of its mean; the insides of its boxes had none."""
    low, high = usual("street", (40.0, 12.0, 8.0))
    site = Site(low, high, np.zeros((0, 3)), 1)
    place = build("street", site)
    light = Painter(place, site)._exposed.total
    leaves = [face.material == "leaves" for face in place.faces]
    ends = np.flatnonzero(np.diff([False, *leaves, False])).reshape(-1, 2)
    assert len(ends) > 5
    for begin, end in ends:
        crown = np.concatenate([texture.reshape(-1, 3) for texture in light[begin:end]])
        assert (crown.min(axis=0) > 0.5 * crown.mean(axis=0)).all()


@pytest.mark.parametrize("kind", KINDS)
def test_cameras_on_a_tour_see_the_place_that_it_goes_through(kind):
    """Seed and size of the scene are those of the tour, whichever of the two was told."""
    parameters = {
        "cameras": ["cam0"],
        "trajectory.type": "tour",
        "scene.type": kind,
        "scene.seed": 3,
    }
    rig = build_rig({**parameters, "camera.images": "none", "duration": 5.0})
    low, high = usual(kind, (0.0, 0.0, 0.0))
    site = Site(low, high, np.zeros((0, 3)), 3)
    assert np.array_equal(build(kind, site).surfaces().origin, rig.scene.surfaces.origin)
    path = rig.trajectory.sample(np.linspace(0.0, rig.trajectory.duration, 1500)).position
    assert clearance(rig.scene.surfaces, path).min() > CLEARANCE
    assert np.ptp(path, axis=0).max() > 0.6 * (high - low).max()
    assert np.abs(path[-1] - path[0]).max() < 1e-9  # it ends where it began


def test_a_tour_is_a_list_of_waypoints():
    """The list, flown as trajectory.type waypoints, is the tour; its clearance is the distance."""
    parameters = TourParameters(place="corridor", place_seed=2)
    flight, flown = tour(parameters), Waypoints(waypoints(parameters))
    t = np.linspace(0.0, flight.duration, 500)
    assert np.array_equal(flight.sample(t).position, flown.sample(t).position)
    wall = surfaces([(np.zeros(3), np.array([2.0, 0, 0]), np.array([0.0, 1, 0]))], hides=True)
    points = np.array([[1.0, 0.5, 0.7], [3.0, 0.5, 0.0], [3.0, 2.0, 2.0]])
    assert clearance(wall, points) == pytest.approx([0.7, 1.0, 6.0**0.5])
    with pytest.raises(ConfigurationError, match=r"along x must be 12 to 150 m for corridor"):
        load_simulation({"trajectory.type": "tour", "trajectory.place": "corridor",
                         "trajectory.place_size": [3.0, 3.0, 3.0]})  # fmt: skip


def test_a_path_through_something_is_refused():
    parameters = {"cameras": ["cam0"], "trajectory.type": "waypoints", "scene.type": "office"}
    parameters["trajectory.positions"] = [0.3, 0.0, 2.35, 0.3, 4.0, 2.35]  # above the doors
    parameters |= {"scene.size": [13.0, 9.4, 2.8], "scene.center": [0.0, 0.0, 1.4], "duration": 4.0}
    with pytest.raises(ConfigurationError, match=r"the path meets something at \("):
        build_rig(parameters)


def test_a_path_that_leaves_its_place_is_refused(make_rig):
    size = {"scene__size": [12.0, 3.0, 2.6], "scene__center": [0.0, 30.0, 1.0]}
    with pytest.raises(ConfigurationError, match=r"leaves the corridor, from"):
        make_rig("figure_eight", scene__type="corridor", **size)
    with pytest.raises(ConfigurationError, match=r"along x must be 12 to 150 m for corridor"):
        make_rig("figure_eight", scene__type="corridor", scene__size=[3.0, 3.0, 2.6])
    along_y = r"along x must be 2.2 to 150 m for corridor\n.*along y must be 12 to 150 m"
    with pytest.raises(ConfigurationError, match=along_y):
        make_rig("figure_eight", scene__type="corridor", scene__size=[1.0, 3.0, 2.6])
    with pytest.raises(ConfigurationError, match=r"it would be 61.8 m along x \(at most 26 m\)"):
        make_rig("line", scene__type="office", scene__horizon=60.0)
    with pytest.raises(ConfigurationError, match="must be one of rich, plain, blank"):
        make_rig("figure_eight", scene__type="corridor", scene__texture="blanc")


def test_a_place_around_a_path_stays_what_it_is_and_says_how_large_it_is(make_rig):
    """A corridor is at most 4 m wide and at least three times as long, whichever way the path runs.

    Its walls are 0.6 m from the path, its floor 0.3 m, its ceiling 1 m; the camera's lever arm
    and the roll add up to 0.15 m to the path.
    """
    with pytest.raises(ConfigurationError, match=r"it would be 6.3 m wide \(at most 4 m\)"):
        make_rig("figure_eight", scene__type="corridor", scene__horizon=13.0)
    turned = {"trajectory__x.amplitude": [1.2], "trajectory__y.amplitude": [6.0]}
    turned = {**turned, "scene__horizon": 13.0}
    for values, size in (
        ({**NARROW, "scene__horizon": 13.0}, [12.0, 3.6, 2.5]),
        (turned, [3.6, 13.2, 2.5]),
    ):
        scene = make_rig("figure_eight", scene__type="corridor", **values).scene
        place = scene.painter.place
        extent = place.high - place.low
        assert extent == pytest.approx(size, abs=0.15)
        dimensions = " x ".join(f"{length:.1f}" for length in extent)
        assert f"scene.type corridor: {dimensions} m around the path" in scene.note
        doors = [sum(fitting.kind == "door" for fitting in face.prints) for face in place.faces[:4]]
        short, long = (doors[:2], doors[2:]) if extent[0] > extent[1] else (doors[2:], doors[:2])
        assert short == [0, 0]
        assert min(long) >= 3
    street = make_rig("figure_eight", scene__type="street", **turned).scene.note
    assert street.startswith("scene.type street: 12.0 x 40.0 x 8.0 m around the path, 0.75 x 0.67")
    room = {"scene__size": [16.0, 7.0, 2.6], "scene__center": [0.0, 0.0, 1.5]}
    assert make_rig("figure_eight", scene__type="corridor", **room).scene.note == ""


@pytest.mark.parametrize(("scale", "areas"), [(2, False), (1, True)])
def test_corners_of_a_printed_grid_in_a_lit_scene_are_unbiased(make_rig, scale, areas):
    """Light from one side and mip levels move no corner: OpenCV's refinement is the judge.

    The wall's texels divide the squares, so its corners are where they are printed.
    """
    site = Site(np.zeros(3), np.array([4.0, 4.0, 2.5]), np.zeros((0, 3)))
    builder = PlaceBuilder(site)
    board = [Print("grid", 1.0, 0.5, 2.0, 1.5)]
    builder.face((4.0, 4.0, 0.0), (0, -4.0, 0), (0, 0, 2.5), "plaster", board)
    lamp = (np.array([2.0, 0.5, 2.4]), np.array([0.5, 0, 0]), np.array([0.0, -0.5, 0]))
    lighting = Lighting([Lamp(lamp, (6.0, 6.0, 6.0))], sky=(0.2, 0.2, 0.2))
    place = Place(tuple(builder.faces), lighting, site.low, site.high, np.zeros((0, 3)))
    wall = place.surfaces()
    textures = atlas(wall, CorridorParameters(), False, Painter(place, site))
    assert textures.size.tolist() == [[1600.0, 1000.0]]
    view = make_rig("figure_eight", **{**SMALL, **WIDE_CAMERA}).views["cam0"]
    renderer = Renderer(view.model, wall, textures, scale, areas=areas)
    inner = np.array(
        [(4.0, 3.0 - 0.1 * j, 0.5 + 0.1 * i) for i in range(1, 15) for j in range(1, 20)]
    )
    errors, images = judged(renderer, view, inner, (1.4, 1.5, 1.0), (2.2, 2.5, 1.5))
    slopes = [float(image[:, :376].mean() - image[:, 376:].mean()) for image in images]
    assert len(errors) > 400
    assert max(np.abs(slopes)) > 3.0  # the light does come from a side
    assert np.abs(errors.mean(axis=0)).max() < 0.01
    assert np.sqrt((errors**2).mean()) < 0.1


def before_a_glossy_wall(make_rig, lamp):
    """Return a camera's view of a tiled wall at x = 4 m, its textures, and a renderer of it."""
    site = Site(np.zeros(3), np.array([4.0, 4.0, 2.5]), np.zeros((0, 3)))
    builder = PlaceBuilder(site)
    builder.face((4.0, 4.0, 0.0), (0, -4.0, 0), (0, 0, 2.5), "tiles")
    lighting = Lighting([Lamp(lamp, (20.0, 20.0, 20.0))], sky=(0.2, 0.2, 0.2))
    place = Place(tuple(builder.faces), lighting, site.low, site.high, np.zeros((0, 3)))
    textures = atlas(place.surfaces(), CorridorParameters(), False, Painter(place, site))
    view = make_rig("figure_eight", **SMALL).views["cam0"]
    return view, textures, Renderer(view.model, place.surfaces(), textures, 1)


def added_by_gloss(view, renderer, poses, step=1):
    """Return columns and rows (n,) of the pixels that see the wall, and what gloss adds there.

    :param step: of so many columns and rows one is looked at.
    """
    u, v = (
        radiance.ravel()
        for radiance in np.meshgrid(np.arange(0, 188, step), np.arange(0, 120, step))
    )
    ray = view.model.unproject(np.column_stack([u, v]).astype(float)).direction
    way = rotation.rotate(np.broadcast_to(poses.q_wc[0], (len(ray), 4)), ray)
    eye = poses.position[0]
    intersection = eye + way * ((4.0 - eye[0]) / way[:, :1])
    places = np.column_stack([(4.0 - intersection[:, 1]) / 4.0, intersection[:, 2] / 2.5]).astype(
        np.float32
    )
    on_wall = ((places > 0.0) & (places < 1.0)).all(axis=1)
    foot = tuple(np.array([(4.0 - eye[1]) / 4.0, eye[2] / 2.5], np.float32))
    sheen, added = renderer.atlas.polish.sheen, np.zeros((on_wall.sum(), 1), np.float32)
    height, lit = np.float32(4.0 - eye[0]), np.array([True, False])
    for place, radiance in zip(places[on_wall], added, strict=True):
        shine(radiance, sheen, 0, lit, tuple(place), foot, height)
    return u[on_wall], v[on_wall], added[:, 0]


@pytest.fixture(scope="module")
def street():
    """Return a street by day and its textures."""
    site = Site(*(np.array(corner) for corner in usual("street", ())), np.zeros((0, 3)), seed=4)
    return build("street", site), site


def test_heads_of_street_lamps_are_closed(street):
    """Rays from all directions, from below too, meet each head."""
    place, _ = street
    heads = [k for k, face in enumerate(place.faces) if face.material == "paint:3c4046"]
    caster = Caster(place.surfaces())
    assert len(heads) >= 12
    assert len(heads) % 6 == 0
    directions = np.random.default_rng(1).standard_normal((100, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for head in heads[::6]:
        corners = np.array([place.faces[k].rectangle[0] for k in range(head, head + 6)])
        middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        hits = caster.cast(middle + 0.6 * directions, -directions)
        assert (hits.distance < 0.6 + 0.05).all()


def test_the_sky_has_no_seam(street):
    """Texels on both sides of an edge of its five faces differ by at most 4 grey values."""
    place, site = street
    painter = Painter(place, site)
    sky = [k for k, face in enumerate(place.faces) if face.sky]
    assert len(sky) == 5
    textures = {k: painter.texture(k, 1200, 1200, 0.25, colour=False).astype(int) for k in sky[:4]}
    x_low, x_high, y_low, y_high = sky[:4]
    for west, east in ((x_low, y_high), (y_high, x_high), (x_high, y_low), (y_low, x_low)):
        seam = np.abs(textures[west][:, -1] - textures[east][:, 0]).max()
        assert seam <= 4, (west, east)


def test_cars_stand_on_their_wheels(street):
    """Below a car's body, 0.175 m up, are four tyres, which meet the ground."""
    place, _ = street
    ground = place.low[2]
    tyres = np.array([f.rectangle for f in place.faces if f.material == "paint:202022"])
    corners = np.concatenate([tyres[:, 0], tyres.sum(axis=1)])
    wheels = [f for f in place.faces if sum(p.kind == "wheel" for p in f.prints) == 2]
    assert len(wheels) >= 4
    assert len(tyres) == 12 * len(wheels)
    assert corners[:, 2].min() == pytest.approx(ground, abs=1e-9)
    for face in wheels:
        origin, across, _ = face.rectangle
        assert origin[2] == pytest.approx(ground + 0.175, abs=1e-9)
        for print_ in face.prints:
            share = (print_.left + 0.5 * print_.width) / np.linalg.norm(across)
            contact = origin + share * across
            at_contact = np.linalg.norm((corners - contact)[:, :2], axis=1) < 0.4
            assert corners[at_contact, 2].min() == pytest.approx(ground, abs=1e-9)


def test_prints_cover_their_own_size_on_long_walls():
    """A wall of 36 m has wider texels than high ones: doors grew over what hangs next to them."""
    site = Site(np.zeros(3), np.array([36.0, 2.4, 2.7]), np.zeros((0, 3)))
    builder = PlaceBuilder(site)
    builder.face((0, 0, 0), (36.0, 0, 0), (0, 0, 2.7), "plaster", [Print("door", 9, 0, 1, 2)])
    builder.face((0, 0, 0), (36.0, 0, 0), (0, 0, 2.7), "plaster")
    lighting = Lighting(sky=(1.0, 1.0, 1.0))
    faces = builder.faces
    painted = []
    for face in faces:
        place = Place((face,), lighting, site.low, site.high, np.zeros((0, 3)))
        painted.append(Painter(place, site).texture(0, 270, 720, 0.02, colour=False))
    rows, columns = np.nonzero(painted[0] != painted[1])
    assert (columns.min(), columns.max()) == (180, 199)
    assert (rows.min(), rows.max()) == (0, 199)


@pytest.mark.parametrize("height", [2.05, 2.3, 2.7])
def test_nothing_hangs_over_a_door_in_a_corridor(height):
    site = Site(np.zeros(3), np.array([30.0, 2.4, height]), np.zeros((0, 3)), texture="rich")
    for face in build("corridor", site).faces:
        doors = [p for p in face.prints if p.kind in ("door", "doors", "opening")]
        for door in doors:
            for fitting in face.prints:
                if fitting.kind in ("strip", "band", "paper") or fitting is door:
                    continue
                apart = (
                    fitting.left >= door.left + door.width
                    or fitting.left + fitting.width <= door.left
                    or fitting.bottom >= door.bottom + door.height
                )
                assert apart, (door, fitting)


def test_a_square_lamp_has_a_square_highlight(make_rig):
    """The share of Phong's lobe that falls on the lamp, summed over 20 x 20 parts of it: 4 cm each.

    Of its largest value, to 6 %: the blur is a product of two smooth steps instead of the lobe
    itself, whose integrals differ by at most 0.025, on each side.
    """
    corner, side = np.array([1.0, 1.9, 1.2]), 0.8
    lamp = (corner, np.array([0, side, 0]), np.array([0, 0, side]))
    view, _, renderer = before_a_glossy_wall(make_rig, lamp)
    mounting = rotation.from_matrix(np.array(SMALL["camera__mounting"]).reshape(3, 3))
    eye = np.array([0.8, 2.1, 1.0])
    poses = CameraPoses(eye[None], mounting[None])
    u, v, added = added_by_gloss(view, renderer, poses, step=2)
    ray = view.model.unproject(np.column_stack([u, v]).astype(float)).direction
    way = rotation.rotate(np.broadcast_to(mounting, (len(ray), 4)), ray)
    intersection = eye + way * ((4.0 - eye[0]) / way[:, :1])
    mirrored = way * (-1.0, 1.0, 1.0) / np.linalg.norm(way, axis=1, keepdims=True)
    steps = (np.arange(20) + 0.5) / 20 * side
    expected = np.zeros(len(intersection))
    for y, z in np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2):
        to = corner + np.array([0.0, y, z]) - intersection
        square = (to * to).sum(axis=1)
        cosine = (to * mirrored).sum(axis=1) / np.sqrt(square)
        expected += np.maximum(cosine, 0.0) ** 2048 * -to[:, 0] / square**1.5
    middle = expected > 0.02 * expected.max()
    assert middle.sum() > 35
    highlight = added - np.median(added[~middle])
    scale = highlight[middle] @ expected[middle] / (expected[middle] @ expected[middle])
    assert np.abs(highlight / scale - expected).max() < 0.06 * expected.max()


def test_a_highlight_is_where_the_mirrored_lamp_is(make_rig):
    """To within a pixel: the lobe's middle, but for the slope of the lamp's light on the wall."""
    pane = (np.array([1.0, 2.4, 2.1]), np.array([0, 0.2, 0]), np.array([0, 0, 0.2]))
    view, textures, renderer = before_a_glossy_wall(make_rig, pane)
    mounting = rotation.from_matrix(np.array(SMALL["camera__mounting"]).reshape(3, 3))
    for eye in ((1.0, 2.1, 1.0), (0.6, 2.9, 1.6)):
        poses = CameraPoses(np.array([eye]), mounting[None])
        columns, rows, added = added_by_gloss(view, renderer, poses)
        u, v = columns[added.argmax()], rows[added.argmax()]
        expected, _ = view.model.project(transform_to_camera(poses, np.array([[7.0, 2.5, 2.2]])))
        assert np.abs(expected[0] - (u, v)).max() < 1.0
        image = np.concatenate([picture for _, picture in renderer.pictures(Eyes(poses))])
        matt = Renderer(view.model, renderer.surfaces, textures._replace(polish=None), 1)
        plain = np.concatenate([picture for _, picture in matt.pictures(Eyes(poses))])
        assert image[v, u] > plain[v, u] + 10
