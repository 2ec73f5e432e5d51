# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""generate with cameras: tracks as tables, and the text files of another simulator."""

import json

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands import generate
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.inputs.poses import read_poses
from imu_sim_ros.jobs import generate as job
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.camera.rig_parameters import load_rig
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.parameters import TourParameters
from imu_sim_ros.trajectory.tour import waypoint_parameters

STEREO = [
    "--camera",
    "euroc_cam0",
    "--camera",
    "euroc_cam1",
    "--trajectory",
    "figure_eight",
    "--duration",
    "4s",
    "--seed",
    "5",
    "--set",
    "camera.body_axes=flu",
    "--quiet",
]
HOUSE = [
    "--camera",
    "vio_data_simulation",
    "--scene",
    "house",
    "--duration",
    "2s",
    "--seed",
    "5",
    "--quiet",
]


def test_tracks_are_tables_with_the_truth_beside_them(tmp_path, capsys):
    folder = tmp_path / "tracks"
    assert generate.main(["-o", str(folder), "--format", "tracks", *STEREO, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    rows = (folder / "tracks.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0] == "t_ns,camera,id,u,v,u_true,v_true,depth"
    assert result["messages"]["tracks"] == len(rows) - 1 > 1000
    arrays = np.load(folder / "tracks.npz")
    fields = [row.split(",") for row in rows[1:]]
    assert [int(f[0]) for f in fields] == arrays["t_ns"].tolist()
    assert [f[1] for f in fields] == [f"cam{k}" for k in arrays["camera"]]
    assert [int(f[2]) for f in fields] == arrays["id"].tolist()
    numbers = np.array([[float(x) for x in f[3:]] for f in fields])
    columns = (arrays["uv"], arrays["uv_true"], arrays["depth"][:, None])
    assert np.array_equal(numbers, np.concatenate(columns, axis=1))
    assert set(arrays["camera"]) == {0, 1}
    assert (np.diff(arrays["t_ns"]) >= 0).all()


def test_the_truth_of_the_tracks_is_that_of_the_poses(tmp_path):
    """Everything from the files alone: poses, landmarks, cameras."""
    folder = tmp_path / "tracks"
    argv = [*STEREO, "--set", "camera.pixel_noise=0"]
    assert generate.main(["-o", str(folder), "--format", "tracks", *argv]) == 0
    rig = load_rig(files.load(folder / "cameras.yaml"))
    truth = read_poses(folder / "groundtruth.tum")
    landmarks = np.loadtxt(folder / "landmarks.csv", delimiter=",", skiprows=1)
    arrays = np.load(folder / "tracks.npz")
    from imu_sim_ros.sensors.camera.model import CameraModel

    for k, name in enumerate(rig.cameras):
        mine = arrays["camera"] == k
        row = np.searchsorted(truth.t_ns, arrays["t_ns"][mine])
        assert (truth.t_ns[row] == arrays["t_ns"][mine]).all()
        r_bc, p_bc = rig.camera(name).pose()
        p_b = rotation.rotate_inverse(
            truth.q_wb[row], landmarks[arrays["id"][mine], 1:] - truth.position[row]
        )
        uv = CameraModel(rig.camera(name)).project((p_b - p_bc) @ r_bc).uv
        assert np.abs(uv - arrays["uv"][mine]).max() < 1e-9


def test_tracks_do_not_depend_on_how_they_are_written(tmp_path, monkeypatch):
    for name, size in (("a", 16384), ("b", 33)):
        monkeypatch.setattr(job, "BLOCK_SIZE", size)
        argv = ["-o", str(tmp_path / name), "--format", "tracks", *STEREO]
        assert generate.main(argv) == 0
    files_a = sorted(file.name for file in (tmp_path / "a").iterdir())
    assert files_a == sorted(file.name for file in (tmp_path / "b").iterdir())
    for name in files_a:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_a_place_says_how_large_it_is_around_the_path(tmp_path, capsys):
    """A note, simulation.yaml and Python's result have it, for cameras and for a LiDAR alone."""
    argv_of_both = [
        "-o",
        str(tmp_path / "a.mcap"),
        "--trajectory",
        "figure_eight",
        "--duration",
        "0.2s",
    ]
    camera_options = ["--camera", "euroc_cam0", "--set", "camera.images=none", "--scene", "office"]
    assert generate.main([*argv_of_both, *camera_options, "--with-configs"]) == 0
    notes = (line.partition(" note: ")[2] for line in capsys.readouterr().err.splitlines())
    scene_notes = [line for line in notes if line.startswith("scene.type")]
    assert len(scene_notes) == 1
    assert scene_notes[0].startswith(
        "scene.type office: 14.8 x 9.8 x 2.7 m around the path, 1.14 x 1.04"
    )
    text = (tmp_path / "a.mcap_configs" / "simulation.yaml").read_text(encoding="utf-8")
    assert f"# {scene_notes[0]}\n" in text
    settings = {"trajectory": "figure_eight", "duration": 0.2, "scene": "warehouse"}
    generated = ims.generate(tmp_path / "b.mcap", **settings, sensors=["lidar"])
    assert generated.notes == (
        "scene.type warehouse: 20.0 x 15.0 x 5.0 m around the path, 0.77 x 1.00 x 0.77 of the "
        "usual 26.0 x 15.0 x 6.5 m",
    )
    with pytest.raises(ConfigurationError, match="corridor': around the path it would be 6.2 m"):
        ims.generate(tmp_path / "c.mcap", **{**settings, "scene": "corridor"}, sensors=["lidar"])


def test_a_tour_goes_through_what_cameras_see(tmp_path):
    """Without a scene they see the place that the tour goes through, with its seed and size."""
    tour = ["--trajectory", "tour", "--duration", "0.2s", "--camera", "euroc_cam0", "--quiet"]
    tour_options = ["--set", "trajectory.place=warehouse", "--set", "trajectory.place_seed=2"]
    scene_options = ["--scene", "warehouse", "--set", "scene.seed=2"]
    for name, options in (("a", tour_options), ("b", scene_options)):
        argv = ["-o", str(tmp_path / name), "--format", "tracks"]
        assert generate.main([*argv, *tour, *options]) == 0
    tracks = [(tmp_path / name / "tracks.csv").read_bytes() for name in "ab"]
    assert tracks[0] == tracks[1]


def test_cameras_leave_the_samples_as_they_are(tmp_path):
    argv = ["--duration", "2s", "--seed", "5", "--quiet"]
    assert generate.main(["-o", str(tmp_path / "a"), "--format", "tracks", *HOUSE]) == 0
    assert generate.main(["-o", str(tmp_path / "b"), "--format", "csv", *argv]) == 0
    for name in ("imu0.csv", "groundtruth.tum"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_the_files_of_vio_data_simulation(tmp_path):
    folder = tmp_path / "sim"
    argv = [*HOUSE, "--set", "camera.pixel_noise=0.5"]
    assert generate.main(["-o", str(folder), "--format", "vio_data_simulation", *argv]) == 0
    imu = np.loadtxt(folder / "imu_pose.txt")
    noisy = np.loadtxt(folder / "imu_pose_noise.txt")
    cam = np.loadtxt(folder / "cam_pose.txt")
    tum = np.loadtxt(folder / "cam_pose_tum.txt")
    points = np.loadtxt(folder / "all_points.txt")
    assert (imu.shape, noisy.shape, cam.shape, tum.shape) == ((400, 14),) * 2 + ((60, 14), (60, 8))
    assert np.array_equal(imu[:, :8], noisy[:, :8])
    # The lecture's sensor: 0.015 rad/s/sqrt(Hz) and 0.019 m/s^2/sqrt(Hz) at 200 Hz.
    error = (noisy - imu)[:, 8:].reshape(400, 2, 3).std(axis=(0, 2)) / np.sqrt(200.0)
    assert np.abs(error / [0.015, 0.019] - 1.0).max() < 5.0 / np.sqrt(2.0 * 1200)
    assert points.shape == (36, 4)
    assert (points[:, 3] == 1.0).all()
    assert len(list((folder / "keyframe").iterdir())) == 120
    errors = []
    for k in range(60):
        keyframe_points = np.loadtxt(folder / f"keyframe/all_points_{k}.txt")
        local = rotation.rotate_inverse(cam[k, 1:5], keyframe_points[:, :3] - cam[k, 5:8])
        errors.append((keyframe_points[:, 4:] - local[:, :2] / local[:, 2:]) * 460.0)
        pixels = keyframe_points[:, 4:] * 460.0 + 255.0
        assert ((pixels > -3.0) & (pixels < 642.0)).all()  # the image's bounds, and noise
    error = np.concatenate(errors).ravel()
    assert abs(error.std() / 0.5 - 1.0) < 5.0 / np.sqrt(2.0 * len(error))
    lines = np.loadtxt(folder / "keyframe/all_lines_0.txt")
    assert lines.shape[1] == 4
    assert len(lines) > 5


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--format tracks", "format tracks: needs a camera"),
        ("--format tracks --camera nothing", "unknown camera 'nothing'; neither a file nor one of"),
        ("--format tracks --scene house", "there is no camera"),
        ("--format tracks --camera euroc_cam0 --rate 30", "must divide the IMU's rate, 30 Hz"),
        ("--format tracks --camera euroc_cam0 --scene nope", "unknown scene 'nope'"),
        (
            "--format tracks --camera euroc_cam0 --scene no.ply",
            "unknown scene 'no.ply'; neither a file",
        ),
        (
            "--format vio_data_simulation --camera euroc_cam0 --camera euroc_cam1",
            "has room for one camera, not 2",
        ),
        *(
            (f"--camera euroc_cam0 --set {name}=2", f"{name}: unknown parameter; {hint}")
            for name, hint in {
                "cameras.cam1.supersampling": "did you mean cam1.camera.supersampling, or "
                "camera.supersampling for all cameras?",
                "cameras.cam0.camera.rat": "did you mean cam0.camera.rate, or camera.rate for all",
                "cameras.supersampling": "did you mean camera.supersampling?",
                "cam0.supersampling": "did you mean cam0.camera.supersampling",
                "cam1.camera.supersampling": "there is no camera cam1; name it in cameras",
                "cameras.cam0.gravity_of_mars": "see the parameter reference",
                "gnss.rate": "those of a sensor need its name in sensors, as in sensors: [gnss]",
                "imuu.jitter": "did you mean imu.jitter?",
            }.items()
        ),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(tmp_path, capsys, options, message):
    target = tmp_path / "out"
    status = generate.main(["-o", str(target), "--duration", "1s", *options.split()])
    error = capsys.readouterr().err.strip()
    assert status == 2
    assert message in error
    assert len(error.splitlines()) == 1
    assert not target.exists()


def test_problems_of_imu_and_cameras_are_told_together(tmp_path, capsys):
    argv = [
        "--duration",
        "1s",
        "--camera",
        "euroc_cam0",
        "--set",
        "cam0.camera.rate=-1",
        "--set",
        "rate=-5",
    ]
    assert generate.main(["-o", str(tmp_path / "x"), "--format", "tracks", *argv]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 2


def test_cameras_of_the_command_line_are_above_those_of_a_file(tmp_path, capsys):
    path = tmp_path / "rig.yaml"
    path.write_text(
        "/**:\n  ros__parameters:\n    cameras: [cam0, cam1]\n"
        "    cam0: {camera: {preset: euroc_cam0}}\n    cam1: {camera: {preset: euroc_cam1}}\n"
    )
    argv = ["--format", "tracks", "--params-file", str(path), "--duration", "1s", "--quiet"]
    tables = []
    for name, options in (("file", []), ("both", ["--camera", "tum_vi_cam0"])):
        assert generate.main(["-o", str(tmp_path / name), *argv, *options]) == 0
        tables.append(set(np.load(tmp_path / name / "tracks.npz")["camera"]))
    assert tables == [{0, 1}, {0}]


def test_a_tour_is_listed_as_a_parameter_file(capsys, tmp_path):
    """The printed file flies the same way as the tour."""
    with pytest.raises(SystemExit) as ended:
        generate.main(["--list-tour", "corridor:2"])
    assert ended.value.code == 0
    (tmp_path / "tour.yaml").write_text(capsys.readouterr().out)
    values = files.load(tmp_path / "tour.yaml")
    expected = waypoint_parameters(TourParameters(place="corridor", place_seed=2))
    assert load_simulation(values).trajectory == load_simulation(expected).trajectory
    with pytest.raises(SystemExit) as ended:
        generate.main(["--list-tour", "corido"])
    assert ended.value.code == 2
    assert "did you mean corridor?" in capsys.readouterr().err
