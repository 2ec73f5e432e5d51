# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that a folder's form, or another file, names: absent is fine, unusable is an error."""

import os
import shutil

import pytest

from imu_sim_ros.commands import convert_bag, evaluate, generate
from imu_sim_ros.core.errors import ImuSimError
from imu_sim_ros.datasets.tracks import read_track_folder
from imu_sim_ros.inputs.rows import is_present, names_in

OBSTACLES = {
    "broken": lambda path: path.symlink_to("nowhere"),
    "loop": lambda path: path.symlink_to(path.name),
    "fifo": os.mkfifo,
    "folder": lambda path: path.mkdir(),
    "device": lambda path: path.symlink_to("/dev/zero"),
}
NAMED = [
    "imu0/data.csv",
    "mag0/data.csv",
    "cam0/data.csv",
    "cam1/data.csv",
    "cam0/sensor.yaml",
    "state_groundtruth_estimate0/data.csv",
]
SENSORS = ["imu0", "imu1", "mag0", "cam0", "cam0/data", "cam1", "state_groundtruth_estimate0"]
CAMERA = [
    *("--camera", "euroc_cam0", "--camera", "euroc_cam1", "--duration", "0.2s", "--quiet"),
    *("--set", "camera.width=32", "--set", "camera.height=24"),
    *("--set", "camera.intrinsics=[20,20,15.5,11.5]"),
]


@pytest.fixture(scope="module")
def complete_folder(tmp_path_factory):
    """Return a folder with readings, truth, magnetic field and two cameras."""
    folder = tmp_path_factory.mktemp("whole") / "set"
    topics = "imu/data_raw,ground_truth/odom,imu/mag"
    arguments = ["-o", str(folder), "--format", "euroc", "--topics", topics, *CAMERA]
    assert generate.main(arguments) == 0
    return folder


@pytest.fixture
def dataset(complete_folder, tmp_path):
    return shutil.copytree(complete_folder, tmp_path / "set")


def place_obstacle(path, obstacle):
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    OBSTACLES[obstacle](path)


def refusal(capsys, tmp_path, *arguments):
    """Return the one line of a conversion that is refused."""
    assert (
        convert_bag.main([*map(str, arguments), "-o", str(tmp_path / "out.mcap"), "--quiet"]) == 2
    )
    (line,) = capsys.readouterr().err.splitlines()
    assert not (tmp_path / "out.mcap").exists()
    return line


@pytest.mark.parametrize("obstacle", OBSTACLES)
@pytest.mark.parametrize("name", NAMED)
def test_a_file_of_a_folder_that_cannot_be_read_is_an_error(
    dataset, tmp_path, capsys, name, obstacle
):
    place_obstacle(dataset / name, obstacle)
    assert name in refusal(capsys, tmp_path, dataset)


@pytest.mark.parametrize("obstacle", ["broken", "loop", "fifo", "device", "file"])
@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_that_is_no_folder_is_an_error(dataset, tmp_path, capsys, name, obstacle):
    if obstacle == "file":
        shutil.rmtree(dataset / name, ignore_errors=True)
        (dataset / name).write_text("x")
    else:
        place_obstacle(dataset / name, obstacle)
    assert name in refusal(capsys, tmp_path, dataset)


@pytest.mark.parametrize("obstacle", OBSTACLES)
def test_camchain_and_motion_capture_of_tum_vi(dataset, tmp_path, capsys, obstacle):
    for camera in ("cam0", "cam1"):
        (dataset / camera / "sensor.yaml").unlink()
    (dataset / "dso").mkdir()
    place_obstacle(dataset / "dso" / "camchain.yaml", obstacle)
    assert "camchain.yaml" in refusal(capsys, tmp_path, dataset)
    shutil.rmtree(dataset / "dso")
    shutil.rmtree(dataset / "state_groundtruth_estimate0")
    (dataset / "mocap0").mkdir()
    place_obstacle(dataset / "mocap0" / "data.csv", obstacle)
    assert "mocap0" in refusal(capsys, tmp_path, dataset)


@pytest.mark.parametrize("name", [*NAMED[1:], *SENSORS[3:]])
def test_what_is_absent_is_left_out(dataset, tmp_path, name):
    path = dataset / name
    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    if name in ("cam0/data", "cam0/data.csv"):
        shutil.rmtree(dataset / "cam0")
    assert convert_bag.main([str(dataset), "-o", str(tmp_path / "out.mcap"), "--quiet"]) == 0


@pytest.mark.parametrize("obstacle", OBSTACLES)
def test_a_table_lists_an_image_that_is_none(dataset, tmp_path, capsys, obstacle):
    image = sorted((dataset / "cam0" / "data").iterdir())[0]
    place_obstacle(image, obstacle)
    assert image.name in refusal(capsys, tmp_path, dataset)


@pytest.mark.parametrize("obstacle", OBSTACLES)
def test_the_truth_of_evaluate(dataset, tmp_path, capsys, obstacle):
    (tmp_path / "x.tum").write_text("".join(f"{k} {k} 0 0 0 0 0 1\n" for k in range(9)))
    place_obstacle(dataset / "state_groundtruth_estimate0" / "data.csv", obstacle)
    assert evaluate.main([str(tmp_path / "x.tum"), str(dataset)]) == 2
    assert "state_groundtruth_estimate0/data.csv" in capsys.readouterr().err


@pytest.mark.parametrize("obstacle", OBSTACLES)
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_the_files_of_a_rosbag2_folder(tmp_path, capsys, storage, obstacle):
    bag = tmp_path / "bag"
    arguments = ["-o", str(bag), "--duration", "1s", "--storage", storage, "--quiet"]
    assert generate.main(arguments) == 0
    shutil.copytree(bag, tmp_path / "other")
    place_obstacle(bag / "metadata.yaml", obstacle)
    assert "metadata.yaml" in refusal(capsys, tmp_path, bag)
    part = next(p for p in (tmp_path / "other").iterdir() if p.suffix != ".yaml")
    place_obstacle(part, obstacle)
    assert part.name in refusal(capsys, tmp_path, part.parent)


@pytest.mark.parametrize("obstacle", OBSTACLES)
@pytest.mark.parametrize("name", ["tracks.npz", "landmarks.csv", "cameras.yaml"])
def test_the_files_of_tracks(tmp_path, name, obstacle):
    folder = tmp_path / "tracks"
    assert generate.main(["-o", str(folder), "--format", "tracks", *CAMERA]) == 0
    place_obstacle(folder / name, obstacle)
    with pytest.raises(ImuSimError, match=name):
        read_track_folder(folder)


@pytest.mark.parametrize("obstacle", OBSTACLES)
@pytest.mark.parametrize("name", ["imu.preset", "camera.preset", "scene.file"])
def test_a_parameter_that_names_a_file(tmp_path, capsys, name, obstacle):
    path = tmp_path / "named.yaml"
    place_obstacle(path, obstacle)
    arguments = ["--camera", str(path)] if name == "camera.preset" else ["--set", f"{name}={path}"]
    arguments += ["--duration", "0.2s", "-o", str(tmp_path / "x.mcap"), "--quiet"]
    if name == "scene.file":
        arguments += [*CAMERA, "--set", "scene.type=file"]
    assert generate.main(arguments) == 2
    assert "named.yaml" in capsys.readouterr().err


@pytest.mark.parametrize("obstacle", OBSTACLES)
@pytest.mark.parametrize("name", ["scene.obj", "scene.mtl", "scene.png", "scene.bin"])
def test_a_mesh_and_the_files_that_it_names(tmp_path, capsys, name, obstacle):
    for library in ("trimesh", "embreex", "PIL"):
        pytest.importorskip(library)
    (tmp_path / "scene.mtl").write_text("newmtl m\nmap_Kd scene.png\n")
    (tmp_path / "scene.obj").write_text(
        "mtllib scene.mtl\nusemtl m\nv 0 0 0\nv 1 0 1\nv 1 1 1\nvt 0 0\nvt 1 0\nvt 1 1\n"
        "f 1/1 2/2 3/3\n"
    )
    (tmp_path / "scene.gltf").write_text(
        '{"asset": {"version": "2.0"}, "buffers": [{"uri": "scene.bin", "byteLength": 36}]}'
    )
    place_obstacle(tmp_path / name, obstacle)
    mesh = tmp_path / ("scene.gltf" if name == "scene.bin" else "scene.obj")
    options = [*CAMERA, "--set", "scene.type=mesh", "--set", f"scene.mesh={mesh}"]
    assert generate.main([*options, "-o", str(tmp_path / "x.mcap")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert name in line


def test_only_what_does_not_exist_is_absent(tmp_path):
    assert not is_present(tmp_path / "x" / "y" / "z.yaml")
    assert names_in(tmp_path / "x") == []
    (tmp_path / "x").symlink_to("gone")
    for question in (is_present, names_in):
        with pytest.raises(ImuSimError, match="x: a broken link to gone"):
            question(tmp_path / "x" / "y" / "z.yaml")
    with pytest.raises(ImuSimError, match="not a file name"):
        is_present("a\0b")
