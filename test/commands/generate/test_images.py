# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""generate with images: EuRoC's folder and kalibr_bagcreater's, read back."""

import hashlib
import json
import sys

import cv2
import numpy as np
import pytest
import yaml

from imu_sim_ros.camera import build_rig
from imu_sim_ros.commands import generate
from imu_sim_ros.datasets.images import millimetres
from imu_sim_ros.jobs import generate as job
from imu_sim_ros.trajectory.parameters import trajectory_layer

RIG = [
    "--camera",
    "euroc_cam0",
    "--camera",
    "euroc_cam1",
    "--trajectory",
    "target",
    "--duration",
    "0.5s",
    "--seed",
    "5",
    "--quiet",
    "--set",
    "camera.body_axes=flu",
    "--set",
    "camera.width=94",
    "--set",
    "camera.height=60",
    "--set",
    "camera.intrinsics=[57.3,57.2,45.9,31.0]",
    "--set",
    "camera.dropout_probability=0.3",
    "--set",
    "camera.time_offset=0.005",
    "--scene",
    "aprilgrid",
]


def hashes(folder):
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_a_euroc_folder_holds_images_under_their_stamps(tmp_path, capsys):
    folder = tmp_path / "mav0"
    assert generate.main(["-o", str(folder), "--format", "euroc", *RIG, "--json"]) == 0
    counts = json.loads(capsys.readouterr().out)["messages"]
    for name in ("cam0", "cam1"):
        lines = (folder / name / "data.csv").read_text(encoding="utf-8").splitlines()
        assert lines[0] == "#timestamp [ns],filename"
        stamps = [int(line.split(",")[0]) for line in lines[1:]]
        files = [line.split(",")[1] for line in lines[1:]]
        assert sorted(files) == sorted(path.name for path in (folder / name / "data").iterdir())
        assert files == [f"{stamp:019d}.png" for stamp in stamps]
        assert counts[f"/{name}/image_raw"] == len(stamps)
        assert 0 < len(stamps) < 10  # some are lost
        # 20 Hz from the start; the stamps are early by the offset.
        assert all((stamp + 5_000_000 - 10**9) % 50_000_000 == 0 for stamp in stamps)
        image = cv2.imread(str(folder / name / "data" / files[0]), cv2.IMREAD_UNCHANGED)
        assert (image.shape, image.dtype) == ((60, 94), np.uint8)
        assert image.std() > 20.0
        sensor = yaml.safe_load((folder / name / "sensor.yaml").read_text(encoding="utf-8"))
        assert sensor["resolution"] == [94, 60]
        assert sensor["intrinsics"] == [57.3, 57.2, 45.9, 31.0]
        pose = np.reshape(sensor["T_BS"]["data"], (4, 4))
        assert np.allclose(pose[:3, 2], [1.0, 0.0, 0.0], atol=0.05)  # looks along x
        assert sensor["distortion_model"] == "radial-tangential"
    assert (folder / "imu0" / "data.csv").is_file()
    assert (folder / "state_groundtruth_estimate0" / "data.csv").is_file()


def test_colours_and_depth_are_in_the_folder_too(tmp_path):
    folder = tmp_path / "mav0"
    options = ["--set", "camera.depth=true", "--set", "camera.encoding=rgb8", "--scene", "room"]
    options += ["--set", "scene.size=[200, 200, 200]", "--duration", "0.2s"]
    assert generate.main(["-o", str(folder), "--format", "euroc", *RIG, *options]) == 0
    names = sorted(path.name for path in (folder / "cam0" / "data").iterdir())
    assert names == sorted(path.name for path in (folder / "cam0" / "depth").iterdir())
    image = cv2.imread(str(folder / "cam0" / "data" / names[0]), cv2.IMREAD_UNCHANGED)
    depth = cv2.imread(str(folder / "cam0" / "depth" / names[0]), cv2.IMREAD_UNCHANGED)
    assert (image.shape, depth.shape, depth.dtype) == ((60, 94, 3), (60, 94), np.uint16)
    # The walls are 100 m away: beyond 65.5 m there is no number.
    assert (depth == 0).mean() > 0.5
    assert millimetres(np.array([[0.0, 1.2345, 65.535, 65.6]], np.float32)).tolist() == [
        [0, 1234, 65535, 0]
    ]


def test_python_gives_the_frames_of_the_command(tmp_path):
    folder = tmp_path / "mav0"
    assert generate.main(["-o", str(folder), "--format", "euroc", *RIG]) == 0
    rig = build_rig(
        {
            "cameras": ["cam0", "cam1"],
            "cam0.camera.preset": "euroc_cam0",
            "cam1.camera.preset": "euroc_cam1",
            **trajectory_layer("target"),
            "duration": 0.5,
            "seed": 5,
            "camera.body_axes": "flu",
            "camera.width": 94,
            "camera.height": 60,
            "camera.intrinsics": [57.3, 57.2, 45.9, 31.0],
            "camera.dropout_probability": 0.3,
            "camera.time_offset": 0.005,
            "scene.type": "aprilgrid",
        }
    )
    for name in ("cam0", "cam1"):
        frames = dict(rig.images(name))
        written = {int(path.stem): path for path in (folder / name / "data").iterdir()}
        assert set(frames) == set(written)
        for stamp, image in frames.items():
            assert np.array_equal(cv2.imread(str(written[stamp]), cv2.IMREAD_UNCHANGED), image)


def test_the_number_of_threads_and_the_block_change_nothing(tmp_path, monkeypatch):
    for name, jobs, size in (("a", "1", 16384), ("b", "3", 17)):
        monkeypatch.setattr(job, "BLOCK_SIZE", size)
        argv = ["-o", str(tmp_path / name), "--format", "euroc", "--jobs", jobs, *RIG]
        assert generate.main(argv) == 0
    assert hashes(tmp_path / "a") == hashes(tmp_path / "b")


def test_the_folder_of_kalibr_bagcreater(tmp_path):
    folder = tmp_path / "run"
    assert generate.main(["-o", str(folder), "--format", "csv", *RIG]) == 0
    assert (folder / "imu0.csv").is_file()
    names = sorted(path.name for path in (folder / "cam0").iterdir())
    assert names
    assert all(name.removesuffix(".png").isdigit() for name in names)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--format euroc --scene cloud", "nothing to make images of"),
        ("--format euroc --jobs 0", "--jobs 0: must be from 1 to 1024"),
        ("--format tum", "--camera: need a bag, or a folder and --format"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(tmp_path, capsys, options, message):
    assert generate.main(["-o", str(tmp_path / "out"), *RIG, *options.split()]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_missing_opencv_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    assert generate.main(["-o", str(tmp_path / "out"), "--format", "euroc", *RIG]) == 2
    error = capsys.readouterr().err
    assert "apt install python3-opencv, or pip install opencv-python-headless" in error
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("form", "start"),
    [
        *(("euroc", 0.0), ("euroc", 0.95), ("euroc", 9.9), ("euroc", 1_400_000_000.0)),
        *(("csv", 0.95), ("csv", 1_400_000_000.0), ("tum_vi", 0.0), ("tum_vi", 9.9)),
    ],
)
def test_names_have_one_width_and_sort_by_time(tmp_path, form, start):
    """Also where stamps have from 8 to 10 digits, or go from 10 to 11 of them."""
    folder = tmp_path / "seq"
    small = [*RIG[: RIG.index("camera.dropout_probability=0.3") - 1], "--scene", "aprilgrid"]
    options = ["--set", f"start_time={start}", "--set", "camera.depth=true"]
    assert generate.main(["-o", str(folder), "--format", form, *small, *options]) == 0
    root = {"euroc": folder, "csv": folder, "tum_vi": folder / "mav0"}[form]
    for camera in ("cam0", "cam1"):
        place = root / camera if form == "csv" else root / camera / "data"
        names = sorted(path.stem for path in place.glob("*.png"))
        stamps = [round(start * 1e9) + k * 50_000_000 for k in range(10)]
        assert {len(name) for name in names} == {19}
        assert [int(name) for name in names] == stamps
        if form == "euroc":
            assert names == sorted(p.stem for p in (root / camera / "depth").glob("*.png"))
        if form != "csv":
            rows = (root / camera / "data.csv").read_text().splitlines()[1:]
            assert rows == [f"{name},{name}.png" for name in names]
        if form == "tum_vi":
            rows = (folder / "dso" / camera / "times.txt").read_text().splitlines()[1:]
            assert [row.split()[0] for row in rows] == names


def test_an_image_before_time_0_is_one_line(tmp_path, capsys):
    folder = tmp_path / "seq"
    arguments = ["-o", str(folder), "--format", "euroc", *RIG, "--set", "camera.time_offset=2.0"]
    assert generate.main(arguments) == 2
    problems = capsys.readouterr().err.splitlines()
    assert len(problems) == 1
    assert "an image at -1 s, before 0" in problems[0]
    assert not folder.exists()
