# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimators that are programs and see cameras: tracks, images, the files of the whole rig."""

import re
import sys

import pytest

from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.runs import CellRuns
from imu_sim_ros.commands import generate
from imu_sim_ros.parameters import files

CAMERA = {
    "rate": 200.0,
    "duration": 1.0,
    "imu": "adis16448",
    "trajectory": "figure_eight",
    "camera": "euroc_cam0",
    "camera.body_axes": "flu",
    "camera.max_features": 20,
}


def test_a_camera_of_a_plan_gives_tracks(plan_file, tmp_path):
    """The same tracks as generate --format tracks writes, with the pixel noise of the cell."""
    program = tmp_path / "program.py"
    program.write_text("import shutil, sys; shutil.copytree(sys.argv[1], sys.argv[2])")
    plan = load_plan(
        plan_file(
            parameters=CAMERA,
            grid={"camera.pixel_noise": [0.5, 2.0]},
            estimators={
                "a": {
                    "command": f"{sys.executable} {program} {{dataset}} {tmp_path}/kept_{{seed}}",
                    "dataset": "tracks",
                }
            },
        )
    )
    _, cell = plan.cells()
    (row,) = CellRuns(plan, cell).rows([3], ["a"], tmp_path / "out")
    assert row["status"] == "failed: no estimate was written"
    generate_line = (
        f"-o {tmp_path}/made --format tracks --rate 200 --duration 1s --imu adis16448 --seed 3 "
        "--trajectory figure_eight --camera euroc_cam0 --set camera.body_axes=flu "
        "--set camera.max_features=20 --set camera.pixel_noise=2.0 --quiet"
    )
    assert generate.main(generate_line.split()) == 0
    for name in ("tracks.csv", "imu0.csv", "landmarks.csv", "groundtruth.tum"):
        generated_bytes = (tmp_path / "made" / name).read_bytes()
        assert (tmp_path / "kept_3" / name).read_bytes() == generated_bytes, name
    assert len(generated_bytes) > 1000


def test_a_program_gets_the_files_of_the_whole_rig(plan_file, tmp_path):
    """The same files as generate --with-configs writes for two cameras, sensor and seed."""
    program = tmp_path / "program.py"
    program.write_text("import shutil, sys; shutil.copytree(sys.argv[1], sys.argv[2])")
    stereo = {
        "cameras": ["cam0", "cam1"],
        "cam0.camera.preset": "euroc_cam0",
        "cam1.camera.preset": "euroc_cam1",
    }
    parameters = {name: value for name, value in CAMERA.items() if name != "camera"}
    plan = load_plan(
        plan_file(
            parameters={**parameters, **stereo},
            estimators={"a": {"command": f"{{python}} {program} {{config}} {tmp_path}/kept"}},
        )
    )
    (row,) = CellRuns(plan, next(plan.cells())).rows([3], ["a"], tmp_path / "out")
    assert row["status"] == "failed: no estimate was written"
    generate_line = (
        f"-o {tmp_path}/made --format tracks --rate 200 --duration 1s --imu adis16448 --seed 3 "
        "--trajectory figure_eight --camera euroc_cam0 --camera euroc_cam1 --quiet --with-configs "
        "--set camera.body_axes=flu --set camera.max_features=20"
    )
    assert generate.main(generate_line.split()) == 0
    generated_configs = {p.name: p.read_text() for p in (tmp_path / "made_configs").iterdir()}
    plan_configs = {p.name: p.read_text() for p in (tmp_path / "kept").iterdir()}
    assert plan_configs.keys() == generated_configs.keys()
    templates = [p.read_text() for p in (files.config_folder() / "estimators").glob("*.yaml")]
    of_cameras = [text for text in templates if "Needs a LiDAR" not in text]
    page_files = {name for text in of_cameras for name in re.findall(r"{config}/([\w.]+)", text)}
    assert len(page_files) > 3
    assert plan_configs.keys() >= page_files | {"orb_slam3_stereo_inertial.yaml", "camchain.yaml"}
    for name in plan_configs.keys() - {"simulation.yaml"}:  # its comment tells who wrote it
        # Only generate examines the flight for a start from which a stack initialises badly.
        warning = r"# WARNING:[^\n]*\n(#   [^\n]*\n)*"
        assert plan_configs[name] == re.sub(warning, "", generated_configs[name]), name


def test_tracks_without_a_camera_are_refused_before_the_start(plan_file, campaign, tmp_path):
    path = plan_file(estimators={"a": {"command": "true {dataset}", "dataset": "tracks"}})
    status, _, lines = campaign(path, "-o", tmp_path / "out")
    assert status == 2
    assert lines == [
        f"campaign: {path}: estimators.a.dataset = tracks: needs a camera; parameters: "
        "{camera: euroc_cam0} is one"
    ]


@pytest.mark.parametrize("form", ["euroc", "mcap"])
def test_a_camera_of_a_plan_gives_images(run_camera, form):
    row = run_camera(form)
    assert row["status"] == "failed: exit status 1: 4 images"


@pytest.fixture
def run_camera(plan_file, tmp_path):
    """Return a function that counts the images of a dataset, by a reader that did not write it."""
    pytest.importorskip("cv2")
    program = """
import sys
from pathlib import Path
if sys.argv[2] == "euroc":
    images = len(list(Path(sys.argv[1]).glob("mav0/cam0/data/*.png")))
else:
    from rosbags.highlevel import AnyReader
    with AnyReader([Path(sys.argv[1])]) as reader:
        images = sum(c.msgcount for c in reader.connections if c.topic == "/cam0/image_raw")
print(images, "images")
sys.exit(1)
"""

    def one(form):
        script = tmp_path / "count.py"
        script.write_text(program)
        command = f"{sys.executable} {script} {{dataset}} {form}"
        small = {"scene": "room", "duration": 0.2, "cam0.camera.rate": 20.0}
        plan = load_plan(
            plan_file(
                parameters={**CAMERA, **small},
                estimators={"a": {"command": command, "dataset": form}},
            )
        )
        (row,) = CellRuns(plan, next(plan.cells())).rows([1], ["a"], tmp_path / "out")
        return row

    return one


@pytest.mark.parametrize("axis", [False, True])
def test_images_of_a_mesh_that_a_plan_names(plan_file, tmp_path, axis):
    """Fixed or as an axis; the images are those that generate writes."""
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("embreex")
    for name, size in (("low", 6.0), ("high", 9.0)):
        trimesh.creation.box((14.0, 14.0, size)).export(tmp_path / f"{name}.stl")
    program = tmp_path / "program.py"
    program.write_text("import shutil, sys; shutil.copytree(sys.argv[1], sys.argv[2])")
    small = {
        "duration": 0.2,
        "camera.width": 40,
        "camera.height": 30,
        "camera.intrinsics": [25.0, 25.0, 19.5, 14.5],
    }
    command = f"{sys.executable} {program} {{dataset}} {tmp_path}/kept_{{seed}}"
    meshes = [str(tmp_path / f"{name}.stl") for name in ("low", "high")]
    fixed = {} if axis else {"scene.mesh": meshes[0]}
    plan = load_plan(
        plan_file(
            parameters={**CAMERA, **small, **fixed, "scene.type": "mesh"},
            **({"grid": {"scene.mesh": meshes}} if axis else {}),
            estimators={"a": {"command": command, "dataset": "euroc"}},
        )
    )
    images = []
    for cell, name in zip(plan.cells(), ("low", "high") if axis else ("low",), strict=True):
        (row,) = CellRuns(plan, cell).rows([3], ["a"], tmp_path / "out")
        assert row["status"] == "failed: no estimate was written"
        generate_line = (
            f"-o {tmp_path}/{name} --format euroc --rate 200 --duration 0.2s --imu adis16448 "
            f"--seed 3 --trajectory figure_eight --camera euroc_cam0 --scene {tmp_path}/{name}.stl "
            "--set camera.body_axes=flu --set camera.max_features=20 --set camera.width=40 "
            "--set camera.height=30 --set camera.intrinsics=[25,25,19.5,14.5] --quiet"
        )
        assert generate.main(generate_line.split()) == 0
        (run_folder,) = tmp_path.glob("kept_*")
        generated_images = sorted((tmp_path / name).rglob("cam0/data/*.png"))
        run_images = [
            next(run_folder.rglob(f"cam0/data/{image.name}")) for image in generated_images
        ]
        assert [p.read_bytes() for p in run_images] == [p.read_bytes() for p in generated_images]
        images.append([p.read_bytes() for p in generated_images])
        run_folder.rename(tmp_path / f"done_{name}")
    assert len(images[0]) == 4
    assert not axis or images[0] != images[1]
