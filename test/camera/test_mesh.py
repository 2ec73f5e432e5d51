# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Meshes before a camera: truth of depth, corners and tracks, and what is odd about a path."""

import numpy as np
import pytest
from corner_judge import WIDE_CAMERA, judged
from small_camera import SMALL_CAMERA, imager_of

from imu_sim_ros.commands import generate
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.places.mesh import MeshCaster
from imu_sim_ros.places.mesh_file import read_mesh
from imu_sim_ros.sensors.camera.images.loops import BACKGROUND
from imu_sim_ros.sensors.camera.images.mesh_look import Look
from imu_sim_ros.sensors.camera.images.mesh_renderer import MeshRenderer
from imu_sim_ros.sensors.camera.rig_parameters import scene_layer
from imu_sim_ros.sensors.camera.surroundings import scene_warnings
from imu_sim_ros.sensors.camera.view import CameraPoses, transform_to_camera

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("embreex")

from meshes import checkerboard, met, quads, room, textured  # noqa: E402 - after trimesh

SMALL = {**SMALL_CAMERA, "scene__type": "mesh", "scene__horizon": 10.0}
LENSES = {
    "radtan": {},
    "equidistant": {
        "camera__distortion_model": "equidistant",
        "camera__distortion": [0.0035, 0.0007, -0.002, 0.0002],
        "camera__intrinsics": [55.0, 55.0, 93.0, 60.0],
    },
    "unified": {
        "camera__model": "unified",
        "camera__xi": 1.2,
        "camera__intrinsics": [140.0, 140.0, 93.0, 60.0],
    },
    "double_sphere": {
        "camera__model": "double_sphere",
        "camera__xi": -0.2,
        "camera__alpha": 0.59,
        "camera__distortion_model": "none",
        "camera__distortion": [],
        "camera__intrinsics": [60.0, 60.0, 93.0, 60.0],
    },
}


def make_imager(make_rig, mesh, **values):
    rig = make_rig("figure_eight", **{**SMALL, "scene__mesh": str(mesh), **values})
    return rig, imager_of(rig)


def grid(columns, rows):
    """Return all places (n, 2) in these columns and rows, row by row."""
    return np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)


def pixel_rays(rig, number, pixels):
    """Return eye, directions in the world and their share along the axis of some pixels."""
    view = rig.views["cam0"]
    p = view.parameters
    t = view.seconds(view.frames(number, 1).true_t_ns)[0]
    rays = view.model.unproject(pixels).direction
    poses = view.poses(rig.trajectory, t + p.row_time * (pixels[:, 1] - 0.5 * (p.height - 1)))
    return poses.position, rotation.rotate(poses.q_wc, rays), rays[:, 2]


@pytest.mark.parametrize("shutter", [0.0, 1e-4])
@pytest.mark.parametrize("lens", LENSES)
def test_depth_is_that_of_the_triangles(make_rig, tmp_path, lens, shutter):
    """A sphere around the path against its own triangles, to 0.1 mm; at edges one in 50 may differ.

    The sphere's triangles are flat, so the depth is not that of a sphere, by up to 40 mm.
    """
    trimesh.creation.icosphere(subdivisions=3, radius=12.0).export(tmp_path / "sphere.ply")
    rig, imager = make_imager(
        make_rig, tmp_path / "sphere.ply", **LENSES[lens], camera__row_time=shutter
    )
    stream = np.random.default_rng(2)
    pixels = stream.integers(0, (188, 120), (80, 2)).astype(float)
    corners = rig.scene.mesh.corners
    for number in (10, 70):
        eye, ways, share = pixel_rays(rig, number, pixels)
        expected, _ = met(corners, eye, ways)
        depth = imager.depth(number)[pixels[:, 1].astype(int), pixels[:, 0].astype(int)]
        good = np.abs(depth - expected * share) < 1e-4
        assert good.mean() >= 0.98
        assert np.isfinite(expected).all()


def test_depth_of_a_plane_and_a_box_is_that_of_their_equations(make_rig, tmp_path):
    """Walls at +-7 m: a plane's depth is linear, to float32's 6e-8 of 7 m."""
    rig, imager = make_imager(make_rig, room(tmp_path))
    depth = imager.depth(30)
    pixels = grid(np.arange(188.0), np.arange(120.0))
    eye, ways, share = pixel_rays(rig, 30, pixels)
    size = np.array([7.0, 7.0, 3.0])
    with np.errstate(divide="ignore"):
        expected = ((np.sign(ways) * size - eye) / ways).min(axis=1) * share
    assert np.abs(depth.reshape(-1) - expected).max() < 1e-4
    assert (depth > 0.0).all()


def test_tracks_are_of_landmarks_that_nothing_hides(make_rig, tmp_path):
    things = [trimesh.creation.box((14, 14, 6))]
    for place in ((3, 3, 1), (-4, 2, 1), (0, -4, 1.5), (5, -3, 1)):
        things.append(trimesh.creation.icosphere(2, 1.0).apply_translation(place))
    trimesh.util.concatenate(things).export(tmp_path / "things.stl")
    rig = make_rig(
        "figure_eight", **SMALL, scene__mesh=str(tmp_path / "things.stl"), scene__landmarks=3000
    )
    corners = rig.scene.mesh.corners
    tracks = next(rig.tracks("cam0", 60))
    assert np.bincount(tracks.frame, minlength=60).min() > 5
    poses = rig.views["cam0"].poses(rig.trajectory, np.arange(60) / 20.0)
    subset = np.arange(0, len(tracks.frame), 7)
    points = rig.scene.landmarks[tracks.landmark[subset]]
    eye = poses.position[tracks.frame[subset]]
    distance, _ = met(corners, eye, points - eye)
    assert np.abs(distance - 1.0).max() < 1e-5
    local = transform_to_camera(CameraPoses(eye, poses.q_wc[tracks.frame[subset]]), points)
    uv, valid = rig.views["cam0"].model.project(local)
    assert valid.all()
    assert np.abs(uv - tracks.uv_true[subset]).max() < 1e-9
    # And those that are left out although they are in the image are hidden.
    eye = np.broadcast_to(poses.position[30], rig.scene.landmarks.shape)
    local = transform_to_camera(
        CameraPoses(eye, np.tile(poses.q_wc[30], (len(eye), 1))), rig.scene.landmarks
    )
    uv, valid = rig.views["cam0"].model.project(local)
    valid &= rig.views["cam0"].model.inside(uv) & (local[:, 2] > 0.2)
    tracked = set(tracks.landmark[tracks.frame == 30].tolist())
    hidden = [k for k in np.flatnonzero(valid).tolist() if k not in tracked]
    assert len(hidden) > 3
    distance, _ = met(corners, eye[hidden], rig.scene.landmarks[hidden] - eye[hidden])
    assert (distance < 1.0 - 1e-6).all()


def test_landmarks_are_on_what_the_path_sees(make_rig, tmp_path):
    """A second box around the first is never seen: no landmark is on it."""
    boxes = [trimesh.creation.box((14, 14, 6)), trimesh.creation.box((40, 40, 40))]
    trimesh.util.concatenate(boxes).export(tmp_path / "boxes.ply")
    mesh = {"scene__mesh": str(tmp_path / "boxes.ply"), "scene__landmarks": 300}
    rig = make_rig("figure_eight", **SMALL, **mesh)
    assert len(rig.scene.landmarks) == 300
    assert (np.abs(rig.scene.landmarks) < 7.1).all()
    short = make_rig("figure_eight", duration=2.0, **SMALL, **mesh)
    assert np.array_equal(short.scene.landmarks, rig.scene.landmarks)


@pytest.mark.parametrize(
    ("scale", "trilinear", "areas"), [(2, False, False), (2, True, False), (1, False, True)]
)
def test_corners_of_a_printed_checkerboard_are_unbiased(
    make_rig, tmp_path, scale, trilinear, areas
):
    """OpenCV's refinement is the judge; the texture's texels divide the squares."""
    board = quads([[4.0, 4.0, 0.0], [0.0, -4.0, 0.0], [0.0, 0.0, 3.0]])
    textured(*board, checkerboard(20, 15, 64)).export(tmp_path / "board.glb")
    mesh = read_mesh(tmp_path / "board.glb")
    view = make_rig("figure_eight", **{**SMALL, **WIDE_CAMERA, "scene__type": "room"}).views["cam0"]
    caster = MeshCaster(mesh)
    look = Look(mesh, caster.middle, colour=False, sun=False)
    renderer = MeshRenderer(view.model, caster, look, scale, trilinear, areas)
    inner = np.array([(4.0, 4.0 - 0.2 * j, 0.2 * i) for i in range(1, 15) for j in range(1, 20)])
    errors, _ = judged(renderer, view, inner, (0.5, 1.5, 1.0), (1.5, 2.5, 2.0))
    assert len(errors) > 200
    assert np.abs(errors.mean(axis=0)).max() < 0.01
    assert np.sqrt((errors**2).mean()) < 0.1


@pytest.mark.parametrize("antialiasing", [False, True])
def test_colours_are_those_of_the_vertices_in_between(make_rig, tmp_path, antialiasing):
    """On a wall whose red goes with y and green with z, to a half of a grey value.

    With antialiasing those of pixels that see the wall alone: it is convex, so a pixel does whose
    eight neighbours' centres meet it. At its edges blue tells how much of a pixel's area it takes.
    Eight looks at the places in a pixel are off by at most 0.23 of it with any straight edge, by
    0.062 in the mean over all edges (half-planes counted on a fine grid), and grey values of 50
    between wall and background are rounded by 0.01; a look at the centre is off by up to 0.5.
    """
    rectangle = [[7.0, 20.0, -20.0], [0.0, -40.0, 0.0], [0.0, 0.0, 40.0]]
    vertices, faces, _ = quads(rectangle)
    share = (vertices[:, 1:] + 20.0) / 40.0
    colours = np.column_stack([np.rint(255 * share), np.full(4, 60)]).astype(np.uint8)
    trimesh.Trimesh(vertices, faces, vertex_colors=colours, process=False).export(
        tmp_path / "wall.ply"
    )
    values = {"camera__encoding": "rgb8", "camera__images": "raw"}
    values["camera__antialiasing"] = antialiasing
    rig, imager = make_imager(make_rig, tmp_path / "wall.ply", **values)
    image = imager.image(0).astype(float)
    pixels = grid(np.arange(188.0), np.arange(120.0))

    def wall(places):
        """Return its colours (n, 3) at places in the image, and which of them see it (n,)."""
        eye, ways, _ = pixel_rays(rig, 0, places)
        t = (7.0 - eye[:, 0]) / ways[:, 0]
        intersection = (eye + t[:, None] * ways)[:, 1:]
        values = np.column_stack(
            [255 * (intersection + 20.0) / 40.0, np.full(len(intersection), 60.0)]
        )
        return values, (t > 0) & (np.abs(intersection) < 20.0).all(axis=1)

    expected, on_wall = wall(pixels)
    offsets = grid(np.arange(-1.0, 2.0), np.arange(-1.0, 2.0))
    neighbours = [wall(pixels + step)[1] for step in offsets]
    if antialiasing:
        on_wall = np.all(neighbours, axis=0)
    assert on_wall.mean() > 0.5
    image = image.reshape(-1, 3)
    assert np.abs(image[on_wall] - expected[on_wall]).max() < 0.51
    if not antialiasing:
        return
    edge = np.any(neighbours, axis=0) & ~on_wall
    assert edge.sum() > 100
    subpixels = (np.arange(16.0) + 0.5) / 16.0 - 0.5
    area = np.mean([wall(pixels[edge] + step)[1] for step in grid(subpixels, subpixels)], axis=0)
    error = (BACKGROUND - image[edge, 2]) / (BACKGROUND - 60.0) - area
    assert np.abs(error).max() < 0.23 + 0.01
    assert np.sqrt((error**2).mean()) < 0.062


def test_images_do_everything_that_images_do(make_rig, tmp_path):
    """Frames are the same in any order and from another rig; blur and light change them."""
    path = room(tmp_path)
    _, plain = make_imager(make_rig, path)
    _, again = make_imager(make_rig, path)
    images = {k: plain.image(k) for k in (0, 33, 90)}
    assert all(np.array_equal(again.image(k), images[k]) for k in (90, 0, 33))
    assert images[33].shape == (120, 188)
    assert images[33].std() > 5.0
    for change in (
        {"camera__exposure_time": 0.05, "camera__blur_samples": 3},
        {"camera__row_time": 3e-4},
        {"camera__vignetting": 0.4},
        {"camera__read_noise": 3.0},
        {"scene__light": "sun"},
    ):
        _, changed = make_imager(make_rig, path, **change)
        difference = np.abs(changed.image(33).astype(float) - images[33]).mean()
        assert 0.0 < difference < 100.0
    _, fine = make_imager(make_rig, path, camera__supersampling=3)
    assert np.abs(fine.image(33).astype(float) - images[33]).mean() < 0.5


def test_a_mesh_without_colours_is_shaded(make_rig, tmp_path):
    trimesh.creation.box((14, 14, 6)).export(tmp_path / "box.stl")
    _, shaded = make_imager(make_rig, tmp_path / "box.stl")
    assert len(np.unique(shaded.image(30))) > 1
    _, unlit = make_imager(make_rig, tmp_path / "box.stl", scene__light="unlit")
    assert np.unique(unlit.image(30)).tolist() == [200]


def test_a_mesh_is_put_where_the_trajectory_flies(make_rig, tmp_path):
    """Scale, up axis, turn and anchor put a box in millimetres, y up, around the path."""
    box = trimesh.creation.box((14e3, 6e3, 12e3)).apply_translation((5e6, 1e6, 0))
    box.export(tmp_path / "box.obj")
    rig = make_rig(
        "figure_eight",
        **SMALL,
        scene__mesh=str(tmp_path / "box.obj"),
        scene__scale=0.001,
        scene__up="y",
        scene__yaw=np.pi / 2,
        scene__anchor="path",
        scene__position=[0.5, 0.0, 0.25],
    )
    t = np.linspace(0.0, rig.trajectory.duration if rig.trajectory.duration < 1e3 else 10.0, 20_000)
    path = rig.views["cam0"].poses(rig.trajectory, t).position
    middle = 0.5 * (path.min(axis=0) + path.max(axis=0)) + np.array([0.5, 0.0, 0.25])
    half = np.array([6.0, 7.0, 3.0])
    corners = rig.scene.mesh.vertices
    assert np.abs(corners.min(axis=0) - (middle - half)).max() < 0.01
    assert np.abs(corners.max(axis=0) - (middle + half)).max() < 0.01
    for wrong, message in (({}, "scene.mesh = '': must name a file"),
                         ({"scene__mesh": "x.ply", "scene__orientation": [2.0, *[0.0] * 8]},
                          "scene.orientation.*rotation")):  # fmt: skip
        with pytest.raises(ConfigurationError, match=message):
            make_rig("figure_eight", **SMALL, **wrong)


def test_what_is_odd_about_a_path_is_said(make_rig, tmp_path):
    def lines(mesh, **values):
        mesh.export(tmp_path / "mesh.ply")
        rig = make_rig("figure_eight", **SMALL, scene__mesh=str(tmp_path / "mesh.ply"), **values)
        return "\n".join(scene_warnings(rig.cameras["cam0"], rig.world, 20.0))

    inwards = trimesh.creation.box((14, 14, 6))
    inwards.invert()
    assert lines(inwards) == ""
    assert "100% of what lies around the path shows its back: the mesh is inside out" in lines(
        trimesh.creation.box((14, 14, 6))
    )
    small = inwards.copy().apply_scale([0.5, 1.0, 1.0])
    text = lines(small)
    assert "the path goes through the mesh at" in text
    assert "the path is outside of the mesh for" in text
    assert "the path comes as close as 0.0" in text
    text = lines(trimesh.Trimesh(inwards.vertices, inwards.faces[1:]))
    assert text.startswith("scene: the mesh is not watertight: 3 edges belong to one face only")
    text = lines(inwards, scene__position=[300.0, 0.0, 0.0])
    assert "hardly anything of the mesh is around the path, in 0." in text
    assert "the mesh within (293.00, -7.00, -3.00) to (307.00, 7.00, 3.00) m" in text
    assert "scene.scale is the length of its unit in metres" in lines(inwards, scene__scale=1000.0)


def test_the_command_takes_a_mesh_and_refuses_a_bad_one(tmp_path, capfd):
    path = room(tmp_path)
    assert scene_layer(str(path)) == {"scene.type": "mesh", "scene.mesh": str(path)}
    arguments = ["--camera", "euroc_cam0", "--set", "camera.body_axes=flu", "--rate", "100",
             "--duration", "0.2s", "--quiet"]  # fmt: skip
    tracks = ["-o", str(tmp_path / "tracks"), "--format", "tracks"]
    assert generate.main([*arguments, *tracks, "--scene", str(path)]) == 0
    assert len((tmp_path / "tracks/landmarks.csv").read_text().splitlines()) == 2001
    capfd.readouterr()
    (tmp_path / "bad.obj").write_text("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")
    for scene in (["--scene", str(tmp_path / "bad.obj")],
                  ["--set", "scene.type=mesh", "--set", "scene.mesh=gone.glb"]):  # fmt: skip
        assert generate.main([*arguments, "-o", str(tmp_path / "x.mcap"), *scene]) == 2
        out, error = capfd.readouterr()
        assert out == ""
        assert error.count("\n") == 1
        assert "bad.obj: vertex 2" in error or "gone.glb: No such file" in error
