# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bodies that move before a camera: poses, masks, landmarks and files, held against images."""

import numpy as np
import pytest
from rigs import make_rig
from rosbags.highlevel import AnyReader
from small_camera import imager_of

import imu_sim_ros as ims
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.places.bodies import HEIGHT, RADIUS, STEP, Course, Crowd, MovingBody, faces
from imu_sim_ros.places.geometry import Caster
from imu_sim_ros.places.place import CLEARANCE, PlaceBuilder, Site
from imu_sim_ros.places.sheet import Print
from imu_sim_ros.places.tour import clearance
from imu_sim_ros.places.walks import PERIOD
from imu_sim_ros.sensors.camera.images.files import decode_image
from imu_sim_ros.sensors.camera.images.imager import Imager
from imu_sim_ros.sensors.camera.tracker import Tracker
from imu_sim_ros.sensors.camera.view import CameraPoses, transform_to_camera

SMALL = {
    "camera__width": 188,
    "camera__height": 120,
    "camera__intrinsics": [114.7, 114.3, 91.8, 62.1],
    "camera__mounting": [0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0],
    "camera__rate": 20.0,
    "camera__read_noise": 0.0,
}
TOUR = {
    **SMALL,
    "trajectory__place": "corridor",
    "trajectory__place_size": [16.0, 5.0, 2.6],
    "scene__type": "corridor",
    "scene__size": [16.0, 5.0, 2.6],
    "scene__center": [0.0, 0.0, 1.3],
    "scene__bodies__people": 3,
    "scene__bodies__carts": 1,
    "scene__bodies__doors": 2,
    "scene__bodies__landmarks": 150,
    "camera__antialiasing": False,  # masks and depths are those of the pixels' centres
}
ROLLING = {"camera__row_time": 1e-4}


@pytest.fixture(name="hall", scope="module")
def hall_fixture():
    return make_rig("tour", duration=90.0, **TOUR)


@pytest.fixture(name="rolling_hall", scope="module")
def rolling_hall_fixture(hall):
    return make_rig("tour", duration=90.0, scene=hall.scene, **TOUR, **ROLLING)


@pytest.fixture(name="imager_of_hall", scope="module")
def imager_of_hall_fixture(hall):
    return imager_of(hall)


@pytest.fixture(name="imager_of_rolling_hall", scope="module")
def imager_of_rolling_hall_fixture(rolling_hall, imager_of_hall):
    """Return an imager with a rolling shutter, with the textures of the same scene."""
    rig = rolling_hall
    return Imager(rig.views["cam0"], rig.scene, imager_of_hall.atlas, rig.trajectory)


def plainly_left(line, points):
    """Return the share of light that a line's shadow leaves at points (n, 3) of the body's axes."""
    way, offset = line.end - line.start, points[:, :2] - line.start
    share = np.clip(offset @ way / max(way @ way, 1e-12), 0.0, 1.0)
    square = ((offset - share[:, None] * way) ** 2).sum(axis=1)
    return 1.0 - line.depth * np.maximum(1.0 - square / line.radius**2, 0.0) ** 2


def frames_with(imager, total, count):
    """Return frames in which bodies are, spread over the flight."""
    visible = [k for k in range(0, total, 60) if imager.depth_and_mask(k)[1].any()]
    return visible[:: max(1, len(visible) // count)][:count]


def test_courses_keep_off_things_cameras_and_each_other(hall):
    """The distance from every rectangle is tested at 2,000 times of the flight, without a grid."""
    bodies = hall.scene.crowd.bodies
    assert [body.name for body in bodies] == [
        "door_1", "door_2", "cart_1", "person_1", "person_2", "person_3"
    ]  # fmt: skip
    t = np.linspace(0.0, hall.trajectory.duration, 2000)
    eye = hall.views["cam0"].poses(hall.trajectory, t).position
    places = {body.name: body.pose(t)[0] for body in bodies}
    surfaces = hall.scene.surfaces
    top = np.max([surfaces.origin[:, 2], (surfaces.origin + surfaces.up)[:, 2]], axis=0)
    things = surfaces.some(top + surfaces.across[:, 2] > 0.03)  # all but the floor
    for body in bodies[2:]:
        radius, place = RADIUS[body.kind], places[body.name]
        for height in (0.15, 0.45, 0.75, 1.0):
            away = clearance(things, place + np.array([0.0, 0.0, height]))
            assert away.min() > radius
        at_height = eye[:, 2] < HEIGHT[body.kind] + CLEARANCE  # it may fly above
        assert np.hypot(*(eye - place)[at_height, :2].T).min(initial=9.0) > radius + CLEARANCE
        for neighbour in bodies[2:]:
            if neighbour.name != body.name:
                apart = np.hypot(*(places[neighbour.name] - place)[:, :2].T)
                assert apart.min() > radius + RADIUS[neighbour.kind]


def states_at(body, t):
    return body.states(np.rint(t * 1e9).astype(np.int64), t)


def test_velocities_are_the_derivatives_of_poses_and_people_walk_as_told(hall):
    t = np.linspace(1.0, 119.0, 4001)
    step = 1e-4
    for body in hall.scene.crowd.bodies:
        state, earlier, later = (states_at(body, t + shift) for shift in (0.0, -step, step))
        # A spline's third derivative is at most 8 / STEP^3 times its knots' differences of 0.3 m:
        # central differences are wrong by less than 150 / 6 step^2 = 3e-7.
        slope = (later.position - earlier.position) / (2.0 * step)
        assert np.abs(slope - state.velocity).max() < 1e-6
        turned = rotation.multiply(rotation.conjugate(earlier.q_wb), later.q_wb)
        assert (
            np.abs(rotation.log(turned)[:, 2] / (2.0 * step) - state.angular_velocity[:, 2]).max()
            < 1e-5
        )
        speed = np.hypot(*state.velocity[:, :2].T)
        pace = {"person": 1.2, "cart": 0.96, "door": 0.0}[body.kind]
        assert speed.max() <= pace + 1e-9
        if body.kind != "door":
            assert (speed < 1e-6).any()  # it stops
            assert speed.max() > 0.8 * pace
        again = states_at(body, t + PERIOD)
        assert np.abs(again.position - state.position).max() < 1e-9


def test_the_same_seed_moves_alike_whatever_the_duration(make_rig, hall):
    short = make_rig("tour", duration=3.0, **TOUR)
    other_seed = make_rig("tour", duration=3.0, **{**TOUR, "scene__seed": 1})
    for long_body, second in zip(hall.scene.crowd.bodies, short.scene.crowd.bodies, strict=True):
        assert np.array_equal(long_body.course.controls, second.course.controls)
    assert not np.array_equal(
        other_seed.scene.crowd.bodies[-1].course.controls,
        short.scene.crowd.bodies[-1].course.controls,
    )


@pytest.mark.parametrize("shutter", ["hall", "rolling_hall"])
def test_depth_and_image_differ_from_those_without_bodies_where_the_mask_says(request, shutter):
    """A body changes only pixels of its mask and of its shadow, and is nearer in each of the mask.

    The shadow is darkest below the body: on the floor, the squares of grey values have the share
    that the shadow's equation leaves at that place in the body's axes, to the rounding. Gloss,
    which a shadow does not darken, is left out.
    """
    rig = request.getfixturevalue(shutter)
    imager = request.getfixturevalue(f"imager_of_{shutter}")
    matt = imager.atlas._replace(polish=None)
    empty = rig.scene._replace(crowd=None)
    without = Imager(rig.views["cam0"], empty, matt, rig.trajectory)
    imager = Imager(rig.views["cam0"], rig.scene, matt, rig.trajectory)
    masked_bodies, shaded = set(), 0
    for k in frames_with(imager, rig.views["cam0"].total, 6):
        depth, mask = imager.depth_and_mask(k)
        static_depth = without.depth(k)
        assert np.array_equal(depth != static_depth, mask > 0)
        assert (depth[mask > 0] < static_depth[mask > 0])[static_depth[mask > 0] > 0].all()
        image, plain = imager.image(k).astype(float), without.image(k).astype(float)
        assert (image != plain)[mask > 0].mean() > 0.8
        rows, columns = np.nonzero((image != plain) & (mask == 0))
        shaded += len(rows)
        t = time_of_row(rig.views["cam0"], k, rows)
        rays = rig.views["cam0"].model.unproject(np.column_stack([columns, rows]).astype(float))
        local = rays.direction / rays.direction[:, 2:] * depth[rows, columns][:, None]
        poses = rig.views["cam0"].poses(rig.trajectory, t)
        points = poses.position + rotation.rotate(poses.q_wc, local)
        assert np.abs(points[:, 2]).max(initial=0.0) < 0.04
        transmittance = np.ones(len(rows))
        for body, shadow in zip(rig.scene.crowd.bodies, rig.scene.crowd.shadows, strict=True):
            transmittance *= plainly_left(shadow.below, body.to_body(t, points))
        error = image[rows, columns] - plain[rows, columns] * np.sqrt(transmittance)
        assert np.abs(error[np.abs(points[:, 2]) < 1e-3]).max(initial=0.0) < 1.0
        masked_bodies |= set(np.unique(mask).tolist())
        assert np.array_equal(imager.depth(k), depth)
    assert len(masked_bodies) >= 4
    assert shaded > 50


def test_depth_of_bodies_is_that_of_their_poses_at_the_time_of_each_row(
    rolling_hall, imager_of_rolling_hall
):
    """Rays in float64 meet each body's rectangles in its pose at the row's time."""
    rig, imager = rolling_hall, imager_of_rolling_hall
    view = rig.views["cam0"]
    stream, checked, good = np.random.default_rng(5), 0, 0
    for k in frames_with(imager, view.total, 8):
        depth, mask = imager.depth_and_mask(k)
        v, u = np.argwhere(mask)[stream.integers(0, mask.astype(bool).sum(), 25)].T
        t = time_of_row(view, k, v)
        pose = view.poses(rig.trajectory, t)
        rays = view.model.unproject(np.column_stack([u, v]).astype(float)).direction
        ways = rotation.rotate(pose.q_wc, rays)
        front_distance = [
            nearest_front(body, t, pose.position, ways) for body in rig.scene.crowd.bodies
        ]
        expected = np.array(front_distance)[mask[v, u] - 1, np.arange(25)] * rays[:, 2]
        error = np.abs(depth[v, u] - expected)
        good += np.count_nonzero(error < 1e-4 * np.maximum(1.0, expected / 5.0))
        checked += len(rays)
    assert checked == 200
    assert good >= 0.97 * checked  # at an edge the other side may win


def nearest_front(body, t, eyes, rays):
    """Return where (n,), in their lengths, rays (n, 3) at times t (n,) meet a body's front."""
    o, a, b = body.surfaces()[:3]
    n, state = np.cross(a, b), states_at(body, t)
    # In the body's axes, with one axis more, for its rectangles.
    turn = rotation.to_matrix(state.q_wb)
    eye, ray = (np.einsum("nij,ni->nj", turn, vector)[:, None] for vector in
                (eyes - state.position, rays))  # fmt: skip
    slope = (ray * n).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        away = (n * (o - eye)).sum(axis=2) / slope
        intersection = eye + away[..., None] * ray - o
        s, r = ((intersection * side).sum(axis=2) / (side * side).sum(axis=1) for side in (a, b))
    hit = (slope < 0.0) & (away > 0.0) & (s >= 0.0) & (s <= 1.0) & (r >= 0.0) & (r <= 1.0)
    return np.where(hit, away, np.inf).min(axis=1)


@pytest.mark.parametrize("row_time", [0.0, 4e-5])
def test_corners_printed_on_a_moving_body_are_where_its_pose_puts_them(make_rig, row_time):
    """OpenCV's refinement finds them, while the body moves during the read-out."""
    cv2 = pytest.importorskip("cv2")
    rig = make_rig("static", duration=10.0, scene__type="corridor",
                   scene__size=[14.0, 4.0, 2.6], scene__center=[0.0, 0.0, 0.6],
                   **{**SMALL, "camera__width": 376, "camera__height": 240,
                      "camera__intrinsics": [458.65, 457.3, 183.6, 124.2],
                      "camera__supersampling": 2, "camera__row_time": row_time})  # fmt: skip
    site = Site(np.zeros(3), np.ones(3), np.zeros((0, 3)))
    builder = PlaceBuilder(site)
    builder.face((0.0, 0.6, 0.2), (0.0, -1.2, 0.0), (0.0, 0.0, 1.0), "paint:f0f0f0",
                 [Print("grid", 0.0, 0.0, 1.2, 1.0)])  # fmt: skip
    t = np.arange(160) * STEP
    path = np.column_stack([2.6 + 0.3 * np.sin(t), 0.5 * np.sin(1.7 * t), 0.2 * np.sin(2.3 * t)])
    board = MovingBody("board", "cart", tuple(builder.faces), Course(path), -0.7)
    crowd = Crowd([board], site, [(np.zeros((0, 3)), np.zeros((0, 3)))])
    imager, view = imager_of(rig, rig.scene._replace(crowd=crowd)), rig.views["cam0"]
    inner = np.array(
        [(0.0, 0.6 - 0.1 * j, 0.2 + 0.1 * i) for i in range(2, 9) for j in range(2, 11)]
    )
    errors, moved = [], []
    for k in range(20, 180, 40):
        time = np.full(len(inner), view.seconds(view.frames(k, 1).true_t_ns)[0])
        late = np.zeros(len(inner))
        initial_uv = None
        for _ in range(12):
            local = transform_to_camera(
                view.poses(rig.trajectory, time + late), board.to_world(time + late, inner)
            )
            uv, valid = view.model.project(local)
            initial_uv = uv if initial_uv is None else initial_uv
            late = row_time * (uv[:, 1] - 119.5)
        moved.append(np.abs(uv - initial_uv).max())
        uv = uv[valid & view.model.inside(uv, 15.0)]
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-5)
        start = uv.astype(np.float32).reshape(-1, 1, 2)
        refined = cv2.cornerSubPix(imager.image(k), start, (4, 4), (-1, -1), stop)
        errors.append(refined[:, 0] - uv)
    errors = np.concatenate(errors)
    assert len(errors) > 125
    # As on walls: below 0.1 px, of which the refinement's own share is most.
    assert np.sqrt((errors**2).mean()) < 0.12
    assert np.abs(errors.mean(axis=0)).max() < 0.03
    assert (max(moved) > 0.3) == (row_time > 0.0)


@pytest.mark.parametrize("rolling", [{}, ROLLING])
def test_landmarks_on_bodies_are_tracked_and_bodies_hide_what_is_behind(
    make_rig, hall, imager_of_hall, rolling
):
    """Every fifth landmark at rest of every other frame against the masks of the same flight."""
    values = {**TOUR, **rolling, "camera__rate": 5.0, "camera__max_features": 0}
    rig = make_rig("tour", duration=5.0, scene=hall.scene, **values)
    tracks = next(rig.tracks("cam0", 25))
    blocks = list(rig.tracks("cam0", 17)) if rolling else [tracks]  # the same code for both
    for name in ("uv", "uv_true", "id", "body", "depth"):
        whole = np.concatenate([getattr(block, name) for block in blocks])
        assert np.array_equal(getattr(tracks, name), whole)
    assert len(np.unique(tracks.body)) >= 4
    at_rest = tracks.landmark < len(rig.scene.landmarks)
    assert np.array_equal(tracks.body == 0, at_rest)
    without = Tracker(rig.views["cam0"], rig.scene._replace(crowd=None), rig.trajectory)
    static_tracks = without.tracks(0, 25)
    imager = Imager(rig.views["cam0"], rig.scene, imager_of_hall.atlas, rig.trajectory)
    good, count, checked = 0, 0, np.zeros(2, np.int64)
    for k in range(0, 25, 2):
        _, mask = imager.depth_and_mask(k)
        in_frame = tracks.frame == k
        for row in np.flatnonzero(in_frame & (tracks.body > 0)):
            good += (around(mask, tracks.uv_true[row]) == tracks.body[row]).any()
            count += 1
        # A landmark at rest is tracked unless its ray meets a body: a pixel may be wider than the
        # gap between two legs, or than the edge of a door.
        at_rest = tracks.landmark[in_frame & (tracks.body == 0)]
        rows = np.flatnonzero(static_tracks.frame == k)[::5]
        gone = ~np.isin(static_tracks.landmark[rows], at_rest)
        at_mask = [around(mask, uv).any() for uv in static_tracks.uv_true[rows]]
        rows, gone = rows[gone | at_mask], gone[gone | at_mask]
        points = rig.scene.landmarks[static_tracks.landmark[rows]]
        assert np.array_equal(behind_a_body(rig, k, static_tracks.uv_true[rows], points), gone)
        checked += np.bincount(gone, minlength=2)
    assert count > 30
    assert good == count
    assert checked.min() > 20


def around(image, uv):
    """Return the pixel at a place and those around it."""
    u, v = np.rint(uv).astype(int)
    return image[max(v - 1, 0) : v + 2, max(u - 1, 0) : u + 2]


def behind_a_body(rig, number, uv, points):
    """Tell which rays from the camera to points (n, 3) meet a body, when their rows are exposed."""
    view = rig.views["cam0"]
    t = time_of_row(view, number, uv[:, 1])
    eyes = view.poses(rig.trajectory, t).position
    bodies = rig.scene.crowd.bodies
    away = [nearest_front(body, t, eyes, points - eyes) for body in bodies]
    return np.min(away, axis=0) < 1.0


def time_of_row(view, number, row):
    """Return when a row of a frame is exposed [s]."""
    middle = view.seconds(view.frames(number, 1).true_t_ns)[0]
    return middle + view.parameters.row_time * (row - 0.5 * (view.model.height - 1))


@pytest.mark.parametrize("kind", ["person", "cart"])
def test_a_body_is_closed(kind):
    """The first face on a ray from any place above the floor shows its front."""
    site = Site(np.zeros(3), np.ones(3), np.zeros((0, 3)))
    surfaces = MovingBody(
        kind, kind, faces(kind, 1, site), Course(np.zeros((4, 3))), 0.0
    ).surfaces()
    stream = np.random.default_rng(1)
    angle = stream.uniform(0.0, 2.0 * np.pi, 40_000)
    eye = np.column_stack(
        [2.0 * np.cos(angle), 2.0 * np.sin(angle), stream.uniform(0.0, 2.6, len(angle))]
    )
    ways = stream.uniform((-0.5, -0.35, 0.0), (0.5, 0.35, 1.8), eye.shape) - eye
    hits = Caster(surfaces).cast(eye, ways)
    valid = (hits.surface >= 0) & ((eye + hits.distance[:, None] * ways)[:, 2] > 0.0)
    assert np.count_nonzero(valid) > 10_000
    assert ((surfaces.normal[hits.surface] * ways).sum(axis=1)[valid] < 0.0).all()


def test_wrong_numbers_of_bodies_are_refused(make_rig):
    placement = {k: v for k, v in TOUR.items() if not k.startswith("trajectory__")}
    street = {"scene__type": "street", "scene__size": [60.0, 16.0, 12.0]}
    with pytest.raises(ConfigurationError, match="this place has 0 doors that can move"):
        make_rig("figure_eight", **{**placement, **street, "scene__center": [0.0, 0.0, 6.0]})
    with pytest.raises(ConfigurationError, match="105 bodies in all; at most 100"):
        make_rig("tour", **{**TOUR, "scene__bodies__people": 50, "scene__bodies__carts": 50,
                            "scene__bodies__doors": 5})  # fmt: skip
    narrow = {"trajectory__place_size": [14.0, 2.4, 2.6], "scene__size": [14.0, 2.4, 2.6]}
    carts = {"scene__bodies__people": 0, "scene__bodies__carts": 2, "scene__bodies__doors": 0}
    with pytest.raises(ConfigurationError, match="scene.bodies.carts = 2: only 1 find a way"):
        make_rig("tour", **{**TOUR, **narrow, **carts})


GIVEN = {
    "imu": "adis16448",
    "trajectory": "tour",
    "duration": 1,
    "seed": 1,
    "cameras": ["euroc_cam0"],
    "scene": "corridor",
    **{k.replace("__", "."): v for k, v in SMALL.items() if k != "camera__mounting"},
    "camera.body_axes": "flu",
    "camera.depth": True,
    "camera.time_offset": -0.005,
    "trajectory.place_size": [12.0, 4.0, 2.6],
    "scene.size": [12.0, 4.0, 2.6],
    "scene.center": [0.0, 0.0, 1.3],
    "scene.texture": "blank",
    "scene.bodies.people": 2,
    "scene.bodies.doors": 1,
}


@pytest.fixture(name="mav0", scope="module")
def mav0_fixture(tmp_path_factory):
    path = tmp_path_factory.mktemp("bodies") / "mav0"
    ims.generate(path, format="euroc", **GIVEN)
    return path


def test_folders_hold_masks_poses_and_the_bodies_of_tracks(mav0, tmp_path):
    folder = mav0 / "cam0"
    names = [sorted(path.name for path in (folder / kind).iterdir()) for kind in ("data", "mask")]
    assert names[0] == names[1] == sorted(path.name for path in (folder / "depth").iterdir())
    masks = [decode_image((folder / "mask" / name).read_bytes()) for name in names[1]]
    assert all(mask.dtype == np.uint8 and mask.shape == (120, 188) for mask in masks)
    assert max(mask.max() for mask in masks) <= 3
    table = np.genfromtxt(mav0 / "bodies.csv", delimiter=",", names=True, dtype=None,
                          encoding="utf-8")  # fmt: skip
    assert list(table["name"][:3]) == ["door_1", "person_1", "person_2"]
    person = table[table["body"] == 2]
    assert np.diff(person["t_ns"]).tolist() == [10_000_000] * 100
    slope = np.diff(person["x"]) / 0.01
    middle = 0.5 * (person["vx"][1:] + person["vx"][:-1])
    assert np.abs(slope - middle).max() < 2e-3  # of a spline over 10 ms: 40 m/s^3 dt^2 / 12

    ims.generate(tmp_path / "tracks", format="tracks", **GIVEN)
    header, *rows = (tmp_path / "tracks" / "tracks.csv").read_text().splitlines()
    assert header.endswith(",depth,body")
    with np.load(tmp_path / "tracks" / "tracks.npz") as arrays:
        assert [int(row.rpartition(",")[2]) for row in rows] == arrays["body"].tolist()
    points = (tmp_path / "tracks" / "body_landmarks.csv").read_text().splitlines()
    assert points[0] == "id,body,x,y,z"
    assert points[1].startswith("2000,1,")
    assert len(points) == 1 + 3 * 60


def test_bags_hold_masks_and_odometry_of_bodies(mav0, tmp_path):
    ims.generate(tmp_path / "flight.mcap", **GIVEN)
    messages = {}
    with AnyReader([tmp_path / "flight.mcap"]) as bag:
        for connection, t_ns, data in bag.messages():
            message = bag.deserialize(data, connection.msgtype)
            messages.setdefault(connection.topic, []).append((t_ns, message))
    masks = messages["/cam0/mask/image_raw"]
    assert len(masks) == len(messages["/cam0/image_raw"]) == 20
    for t_ns, message in masks:
        file = mav0 / "cam0/mask" / f"{t_ns:019d}.png"
        assert message.encoding == "mono8"
        assert bytes(message.data) == decode_image(file.read_bytes()).tobytes()
    table = np.genfromtxt(mav0 / "bodies.csv", delimiter=",", names=True, dtype=None,
                          encoding="utf-8")  # fmt: skip
    for number, name in enumerate(("door_1", "person_1", "person_2"), start=1):
        poses = messages[f"/ground_truth/bodies/{name}"]
        rows = {row["t_ns"]: row for row in table[table["body"] == number]}
        assert len(poses) == 20
        for t_ns, message in poses:  # true times: the camera's stamps are 5 ms later
            row, position = rows[t_ns], message.pose.pose.position
            assert message.child_frame_id == name
            assert (position.x, position.y, position.z) == (row["x"], row["y"], row["z"])
            state = CameraPoses(
                np.zeros((1, 3)), np.array([[row[k] for k in ("qw", "qx", "qy", "qz")]])
            )
            world = rotation.rotate(state.q_wc, np.array([[message.twist.twist.linear.x,
                                    message.twist.twist.linear.y, 0.0]]))  # fmt: skip
            assert world[0, 0] == pytest.approx(row["vx"], abs=1e-12)
    channels = [channel.name for channel in messages["/feature_tracker/feature"][0][1].channels]
    assert channels[-1] == "body"
