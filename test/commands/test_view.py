# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``view --save``: all of a flight is in rerun's file, on one time line, without a screen."""

import json
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands import dead_reckon, generate, view

SMALL = [
    *("--scene", "room", "--duration", "0.2s", "--quiet"),
    *("--set", "camera.width=188", "--set", "camera.height=120"),
    *("--set", "camera.intrinsics=[114.7,114.3,91.8,62.1]"),
]
TOPICS = "imu/data_raw,ground_truth/odom,ground_truth/gyroscope_bias"


def rows(path):
    """Return what rerun's own program finds in a file: entities and its time lines."""
    argv = ["-m", "rerun", "rrd", "stats", str(path)]
    done = subprocess.run([sys.executable, *argv], capture_output=True, text=True, check=True)
    entities = re.findall(r"^(/\S+): (\d+)$", done.stdout, re.M)
    return dict(entities), re.search(r"num_rows = (.*)", done.stdout)[1], done.stdout


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    pytest.importorskip("rerun")
    folder = tmp_path_factory.mktemp("view")
    argv = ["--trajectory", "figure_eight", "--duration", "2s", "--quiet"]
    assert generate.main(["-o", str(folder / "flight.mcap"), "--topics", TOPICS, *argv]) == 0
    track = ["-o", str(folder / "track.csv"), "--quiet"]
    assert dead_reckon.main([str(folder / "flight.mcap"), *track]) == 0
    return folder


def test_truth_estimate_readings_and_biases_are_in_the_file(flight, capsys):
    saved = flight / "flight.rrd"
    inputs = [str(flight / "flight.mcap"), str(flight / "track.csv")]
    assert view.main([*inputs, "--save", str(saved), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["paths"], result["readings"], result["biases"]) == (2, 400, 1)
    entities, count, printed = rows(saved)
    expected = {"/world/truth/path", "/world/truth/body", "/world/track/body"}
    expected |= {"/imu/data_raw/gyroscope", "/imu/data_raw/accelerometer"}
    assert expected | {"/ground_truth/gyroscope_bias"} <= set(entities)
    assert "stamp" in printed
    # Two paths, two triads and a bias of 400 rows each, and a few static ones.
    assert 2000 <= int(re.sub(r"\D", "", count)) < 2100


def test_the_images_of_a_folder_are_those_of_the_same_flight_as_a_bag(flight, capsys):
    pytest.importorskip("cv2")
    argv = ["--camera", "euroc_cam0", "--camera", "euroc_cam1", *SMALL]
    assert generate.main(["-o", str(flight / "euroc"), "--format", "euroc", *argv]) == 0
    assert generate.main(["-o", str(flight / "same.mcap"), *argv]) == 0
    capsys.readouterr()
    saved = flight / "euroc.rrd"
    assert view.main([str(flight / "euroc"), "--save", str(saved), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["images"] == 2
    assert {"/cam0", "/cam1"} <= set(rows(saved)[0])
    bag = list(ims.read_images(flight / "same.mcap", "cam1/image_raw"))
    folder = list(ims.read_images(flight / "euroc", "cam1"))
    assert [t_ns for t_ns, _ in folder] == [t_ns for t_ns, _ in bag]
    assert len(bag) == 4
    assert all(np.array_equal(a, b) for (_, a), (_, b) in zip(folder, bag, strict=True))
    with pytest.raises(ims.InputError, match="has cam0, cam1; topic= names one"):
        ims.read_images(flight / "euroc")


def test_images_and_landmarks_are_in_the_file(flight, capsys):
    pytest.importorskip("cv2")
    bag = flight / "seen.mcap"
    argv = ["--camera", "euroc_cam0", *SMALL]
    assert generate.main(["-o", str(bag), *argv]) == 0
    assert view.main([str(bag), "--save", str(flight / "seen.rrd"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["images"] == 1
    assert result["landmarks"] > 100
    entities, _, _ = rows(flight / "seen.rrd")
    assert {"/cam0/image_raw", "/world/landmarks"} <= set(entities)


def test_an_existing_file_is_kept_and_a_missing_library_is_named(flight, capsys, monkeypatch):
    occupied = flight / "taken.rrd"
    occupied.write_text("mine")
    assert view.main([str(flight / "flight.mcap"), "--save", str(occupied)]) == 2
    assert "already exists" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert view.main([str(flight / "flight.mcap"), "--save", "x.rrd"]) == 2
    assert "pip install rerun-sdk" in capsys.readouterr().err


def test_what_cannot_be_shown_is_said_before_a_viewer_starts(flight, capsys, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    bag = str(flight / "flight.mcap")
    assert view.main([bag]) == 2
    assert capsys.readouterr().err == (
        "view: there is no screen for rerun's viewer; --save FILE writes what rerun opens "
        "elsewhere\n"
    )
    for gone in (["gone.mcap"], ["gone.csv", "x.tum"], ["gone.mcap", "gone.csv"]):
        argv = gone if gone[0] == "gone.mcap" else [bag, *gone]
        assert view.main(argv) == 2
        lines = [f"view: {name}: No such file or directory" for name in gone]
        assert capsys.readouterr().err.splitlines() == lines


def test_estimates_of_the_same_name_are_two_paths(flight, capsys):
    second_folder = flight / "other"
    second_folder.mkdir()
    shutil.copy(flight / "track.csv", second_folder)
    tracks = [str(flight / "track.csv"), str(second_folder / "track.csv")]
    saved = flight / "two.rrd"
    assert view.main([str(flight / "flight.mcap"), *tracks, "--save", str(saved), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["paths"] == 3
    bodies = [name for name in rows(saved)[0] if re.fullmatch(r"/world/.*track/body", name)]
    assert len(bodies) == 2


def test_scans_of_a_lidar_are_in_the_file(flight, capsys):
    bag = flight / "ranged.mcap"
    argv = ["--lidar", "vlp16", "--scene", "ground", "--duration", "0.3s", "--quiet"]
    argv += ["--set", "lidar.lever_arm=[0.1, -0.2, 0.3]"]
    argv += ["--set", "lidar.mounting=[0, -1, 0, 1, 0, 0, 0, 0, 1]"]
    assert generate.main(["-o", str(bag), *argv]) == 0
    assert view.main([str(bag), "--save", str(flight / "ranged.rrd"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scans"] == 1
    entities, _, _ = rows(flight / "ranged.rrd")
    assert {"/world/truth/body/lidar", "/world/truth/body/lidar/points"} <= set(entities)
    assert not any("ground_truth" in name for name in entities)
    argv = ["-m", "rerun", "rrd", "print", "-vvv", "--entity", "/world/truth/body/lidar"]
    done = subprocess.run(
        [sys.executable, *argv, str(flight / "ranged.rrd")],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert "[[0.1, -0.2, 0.3]]" in done.stdout
    # Column by column.
    assert "[[0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0]]" in done.stdout


def test_scans_that_have_no_place_are_in_their_own_frame(flight, capsys):
    bag = flight / "placeless.mcap"
    argv = ["--lidar", "perfect", "--scene", "ground", "--duration", "0.2s", "--quiet"]
    argv += ["--topics", "imu/data_raw,ground_truth/odom,points"]
    assert generate.main(["-o", str(bag), *argv]) == 0
    assert view.main([str(bag), "--save", str(flight / "placeless.rrd"), "--quiet"]) == 0
    assert "/points: in its own frame, because the bag does not say where lidar is" in (
        capsys.readouterr().err
    )
    entities, _, _ = rows(flight / "placeless.rrd")
    assert "/points" in entities
