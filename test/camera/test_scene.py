# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scenes: where landmarks are, what files give, and bad input."""

import struct

import numpy as np
import pytest

from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.sensors.camera.rig_parameters import (
    load_rig,
    rig_problems,
    scene_layer,
    select_rig_parameters,
)
from imu_sim_ros.sensors.camera.scene import read_points
from imu_sim_ros.simulation.parameters import load_simulation


def test_a_room_holds_the_path_and_its_landmarks_lie_on_surfaces(make_rig):
    rig = make_rig(scene__boxes=6, scene__margin=1.5)
    path = rig.views["cam0"].poses(rig.trajectory, np.linspace(0.0, 10.0, 500)).position
    walls = rig.scene.surfaces.origin[:6]
    corners = np.concatenate(
        [
            walls + a * rig.scene.surfaces.across[:6] + b * rig.scene.surfaces.up[:6]
            for a in (0, 1)
            for b in (0, 1)
        ]
    )
    assert np.allclose(corners.min(axis=0), path.min(axis=0) - 1.5, atol=0.01)
    assert np.allclose(corners.max(axis=0), path.max(axis=0) + 1.5, atol=0.01)
    s = rig.scene.surfaces
    offset = rig.scene.landmarks[:, None] - s.origin
    on_plane = np.abs((offset * s.normal).sum(axis=2)) < 1e-9
    within = np.ones_like(on_plane)
    for side in (s.across, s.up):
        place = (offset * side).sum(axis=2) / (side * side).sum(axis=1)
        within &= (place >= 0.0) & (place <= 1.0)
    assert (on_plane & within).any(axis=1).all()
    # Normals of walls point into the room, those of boxes out of them.
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    assert (((middle - s.origin[:6]) * s.normal[:6]).sum(axis=1) > 0.0).all()


def test_a_path_that_leaves_the_room_is_an_error(make_rig):
    with pytest.raises(ConfigurationError, match=r"scene\.size = .*leaves the room"):
        make_rig("circle", scene__size=[4.0, 4.0, 3.0])
    with pytest.raises(ConfigurationError, match=r"scene\.horizon = 5: .*leaves the room"):
        make_rig("line", scene__horizon=5.0)


def test_the_default_scene_is_an_office_or_a_room_where_none_fits(make_rig):
    """A path too large for an office is an error if a parameter of offices is set."""
    assert load_rig({"cameras": ["cam0"]}).scene.type == "auto"
    parameters = {"scene__type": "auto", "scene__seed": 4}
    auto = make_rig(**parameters, scene__landmarks=300).scene
    office = make_rig(**{**parameters, "scene__type": "office"}, scene__landmarks=300).scene
    assert auto.painter is not None
    assert auto.note == office.note
    assert np.array_equal(auto.landmarks, office.landmarks)
    fallen = make_rig("lecture", **parameters).scene
    room = make_rig("lecture", **{**parameters, "scene__type": "room"}).scene
    assert "a room, since an office is too small for a path of 30.1 x 40.1 m" in fallen.note
    assert np.array_equal(fallen.landmarks, room.landmarks)
    assert np.array_equal(fallen.surfaces.origin, room.surfaces.origin)
    for value in ({"scene__light": "dim"}, {"scene__bodies__people": 1}):
        with pytest.raises(
            ConfigurationError, match=r"'office': around the path it would be.*trajectory='tour'"
        ):
            make_rig("lecture", **parameters, **value)
    with pytest.raises(ConfigurationError, match=r"along x must be 8 to 26 m for office"):
        make_rig(**parameters, scene__size=[3.0, 9.0, 3.0])
    with pytest.raises(ConfigurationError, match=r"scene\.horizon = 5: .*leaves the office"):
        make_rig("line", **parameters, scene__horizon=5.0)


@pytest.mark.parametrize("scene", ["room", "cloud"])
def test_a_scene_does_not_depend_on_the_duration(make_rig, scene):
    values = {"scene__type": scene, "scene__horizon": 8.0, "cam0__camera__preset": "euroc_cam0"}
    short, long = (make_rig("figure_eight", d, scene__seed=4, **values).scene for d in (2.0, 11.0))
    assert len(short.landmarks) > 50
    assert np.array_equal(short.landmarks, long.landmarks)
    assert np.array_equal(short.surfaces.origin, long.surfaces.origin)
    other_seed = make_rig("figure_eight", 2.0, scene__seed=5, **values).scene
    assert not np.array_equal(other_seed.landmarks[:50], long.landmarks[:50])


@pytest.mark.parametrize(
    ("trajectory", "values"),
    [
        ("lecture", {"cam0__camera__preset": "tum_vi_cam0", "scene__spacing": 0.1}),
        ("spin", {}),
        ("excitation", {"camera__border": 20.0, "camera__dropout_probability": 0.2}),
        ("coning", {"camera__row_time": 5e-5}),
    ],
)
def test_every_frame_of_a_cloud_sees_enough(make_rig, trajectory, values):
    """Frames lie between the viewpoints at which the cloud is generated."""
    camera = {"cam0__camera__preset": "euroc_cam0", "cam0__camera__body_axes": "flu", **values}
    rig = make_rig(
        trajectory,
        duration=5.0,
        scene__type="cloud",
        scene__horizon=5.0,
        scene__visible=50,
        camera__max_features=0,
        camera__rate=30.0,
        **camera,
    )
    assert len(rig.scene.landmarks) > 50
    delivered = np.concatenate([t.frames.delivered for t in rig.tracks("cam0")])
    counts = np.concatenate(
        [np.bincount(t.frame, minlength=len(t.frames.number)) for t in rig.tracks("cam0")]
    )
    assert counts[delivered].min() >= 50
    assert np.array_equal(rig.tracker("cam0").counts(0, 30), np.where(delivered, counts, -1)[:30])


def test_a_cloud_beyond_the_depths_of_a_camera_is_refused(make_rig):
    """The refusal is immediate at the default horizon of 60 s."""
    cloud_range = {"scene__near": 500.0, "scene__far": 600.0, "cam1__camera__max_depth": 10.0}
    both = {"cam0__camera__max_depth": 1000.0, "camera__body_axes": "flu", "camera__rate": 20.0}
    names = {"cameras": ["cam0", "cam1"], "cam1__camera__preset": "euroc_cam0"}
    with pytest.raises(ConfigurationError) as refused:
        make_rig("static", scene__type="cloud", **names, **cloud_range, **both)
    assert refused.value.problems == (
        "scene.near = 500, scene.far = 600: no point between them is in the depths that cam1 sees, "
        "cam1.camera.min_depth = 0.1 to max_depth = 10 m",
    )


def test_the_house_is_that_of_the_other_simulator(make_rig):
    rig = make_rig("lecture", scene__type="house", duration=1.0)
    assert rig.scene.lines.shape == (23, 2, 3)
    assert len(rig.scene.landmarks) == 2 * 18
    assert rig.scene.landmarks[:2].tolist() == [[0, 0, 0], [0, 0, 6.5]]
    assert rig.scene.landmarks[18].tolist() == [0.5, 0.5, -0.5]


def test_targets_have_their_corners_in_kalibrs_order(make_rig):
    rig = make_rig("target", scene__type="aprilgrid", duration=5.0)
    corners = rig.scene.landmarks
    assert len(corners) == 144
    x_axis, up = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    pitch = 0.088 * 1.3
    assert np.allclose(corners[1] - corners[0], 0.088 * x_axis)
    assert np.allclose(corners[3] - corners[0], 0.088 * up)
    assert np.allclose(corners[4] - corners[0], pitch * x_axis)  # the next tag
    assert np.allclose(corners[24] - corners[0], pitch * up)  # the next row
    board = make_rig("target", scene__type="checkerboard", duration=5.0).scene.landmarks
    assert len(board) == 42
    assert np.allclose(board[7] - board[0], 0.06 * up)


@pytest.mark.parametrize("preset", ["euroc_cam0", "tum_vi_cam0", "realsense_t265_cam0"])
def test_the_calibration_motion_excites_all_axes_and_keeps_the_target_in_view(make_rig, preset):
    rig = make_rig(
        "target",
        duration=60.0,
        scene__type="aprilgrid",
        camera__max_features=0,
        cam0__camera__preset=preset,
        cam0__camera__body_axes="flu",
    )
    counts = np.concatenate(
        [np.bincount(t.frame, minlength=len(t.frames.number)) for t in rig.tracks("cam0")]
    )
    assert counts.min() == 144
    motion = rig.trajectory.sample(np.linspace(3.0, 60.0, 6000))
    assert motion.angular_velocity.std(axis=0).min() > 0.25
    assert motion.acceleration.std(axis=0).min() > 0.8


def test_points_come_from_csv_and_ply(tmp_path):
    points = np.array([[1.0, 2.0, 3.0], [-0.5, 1e-3, 4.25]])
    (tmp_path / "a.csv").write_text("x,y,z\n1,2,3\n-0.5,1e-3,4.25\n", encoding="utf-8")
    (tmp_path / "b.csv").write_text("# id x y z\n7,1,2,3\n8,-0.5,1e-3,4.25\n", encoding="utf-8")
    header = "ply\nformat {}\nelement vertex 2\nproperty float x\nproperty uchar red\n"
    header += "property double y\nproperty float z\nelement face 0\nproperty list uchar int i\n"
    header += "end_header\n"
    text = header.format("ascii 1.0") + "1 9 2 3\n-0.5 9 1e-3 4.25\n"
    (tmp_path / "c.ply").write_text(text, encoding="utf-8")
    for order, form in (("<", "binary_little_endian"), (">", "binary_big_endian")):
        body = b"".join(struct.pack(order + "fBdf", x, 9, y, z) for x, y, z in points)
        name = tmp_path / f"{form}.ply"
        name.write_bytes(header.format(f"{form} 1.0").encode() + body)
        assert np.array_equal(read_points(name), points)
    for name in ("a.csv", "b.csv", "c.ply"):
        assert np.array_equal(read_points(tmp_path / name), points)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "contains no points"),
        (b"x,y,z\n", "contains no points"),
        (b"1,2\n", "line 1: 2 columns"),
        (b"1,2,3\n1,2\n", "line 2: 2 columns"),
        (b"1,2,three\n1,2,3\n", "line 1"),
        (b"1,2,nan\n", "not finite"),
        (b"1,2,3\n4,5,inf\n", "point 2: a value that is not finite"),
        (b"\xff\xfe\x00", "neither CSV nor PLY"),
        (b"ply\nformat ascii 1.0\n", "header is not terminated"),
        (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
            "x, y and z",
        ),
        (
            b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\n"
            b"property float y\nproperty float z\nend_header\n1234",
            "ends before the 9 vertices",
        ),
    ],
)
def test_bad_files_of_points_are_one_line(tmp_path, content, message):
    file = tmp_path / "points"
    file.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_points(file)
    with pytest.raises(InputError, match="No such file"):
        read_points(tmp_path / "missing.csv")


def test_parameters_for_all_and_for_one_are_layered_above_the_preset():
    rig = load_rig(
        {
            "cameras": ["left", "right"],
            "camera.preset": "euroc_cam0",
            "camera.pixel_noise": 0.3,
            "right.camera.preset": "euroc_cam1",
            "right.camera.rate": 10.0,
        }
    )
    left_camera, right_camera = rig.camera("left"), rig.camera("right")
    assert (left_camera.intrinsics[0], right_camera.intrinsics[0]) == (458.654, 457.587)
    assert (left_camera.pixel_noise, right_camera.pixel_noise) == (0.3, 0.3)
    assert (left_camera.rate, right_camera.rate) == (20.0, 10.0)


def test_what_is_wrong_with_cameras_is_told_all_at_once():
    with pytest.raises(ConfigurationError) as error:
        load_rig({"cameras": ["a", "b"], "a.camera.rat": 1.0, "b.camera.rate": -1.0})
    assert [line.split(":")[0] for line in error.value.problems] == [
        "a.camera.rat",
        "b.camera.rate = -1.0",
    ]
    for parameters, message in (
        ({"cameras": ["a", "a"]}, "names must differ"),
        ({"cameras": ["camera"]}, "not a parameter's name"),
        ({"cameras": 3}, "a list of strings"),
        ({"camera.rate": 3.0}, "there is no camera; name them in cameras"),
        (
            {"cameras": ["a"], "camera.preset": "nothing"},
            "unknown camera 'nothing'; neither a file nor",
        ),
        ({"cameras": ["a"], "scene.type": "nothing"}, "scene.type = 'nothing': must be one of"),
    ):
        with pytest.raises(ConfigurationError, match=message):
            load_rig(parameters)


def test_a_synchronised_camera_divides_the_imus_rate():
    simulation = load_simulation({"rate": 200.0})
    rig = load_rig({"cameras": ["a"], "camera.rate": 30.0, "camera.trigger": "synchronised"})
    assert "must divide the IMU's rate, 200 Hz" in next(rig_problems(rig, simulation))
    free = load_rig({"cameras": ["a"], "camera.rate": 30.0})
    assert not list(rig_problems(free, simulation))


def test_the_same_camera_twice_is_an_error():
    simulation = load_simulation({})
    both = {"cameras": ["a", "b"], "camera.preset": "euroc_cam0"}
    [problem] = rig_problems(load_rig(both), simulation)
    assert problem.startswith("b.camera: is a again, with the same lens and mount")
    for difference in ({"b.camera.preset": "euroc_cam1"}, {"b.camera.lever_arm": [0.1, 0.0, 0.0]}):
        assert not list(rig_problems(load_rig({**both, **difference}), simulation))


def test_cameras_parameters_are_told_from_all_others(tmp_path):
    parameters = {"cameras": ["left"], "left.camera.rate": 10.0, "scene.seed": 1, "left.rate": 2.0}
    rig_parameters = {key: value for key, value in parameters.items() if key != "left.rate"}
    assert select_rig_parameters({**parameters, "rate": 100.0}) == rig_parameters
    assert scene_layer("house") == {"scene.type": "house"}
    (tmp_path / "p.csv").write_text("1,2,3\n", encoding="utf-8")
    assert scene_layer(str(tmp_path / "p.csv"))["scene.type"] == "file"
