# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Datasets of cameras that are interrupted: what is left is whole, and the message says it."""

import os
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from imu_sim_ros.commands import generate
from imu_sim_ros.datasets import columns
from imu_sim_ros.datasets.images import ImageFolders

COMMAND = [sys.executable, "-m", "imu_sim_ros.commands.generate"]
SMALL = [
    *("--set", "camera.width=94", "--set", "camera.height=60"),
    *("--set", "camera.intrinsics=[57.4,57.2,45.7,30.8]"),
]
STEREO = [
    *("--trajectory", "figure_eight", "--seed", "5", "--set", "camera.body_axes=flu"),
    *("--camera", "euroc_cam0", "--camera", "euroc_cam1", "--scene", "room"),
]


@pytest.mark.parametrize(("form", "place"), [("euroc", "."), ("tum_vi", "mav0")])
def test_an_interrupted_stereo_dataset_has_as_many_images_of_both_cameras(tmp_path, form, place):
    """The names in data.csv are the images that are there, of both cameras the same."""
    argv = ["-o", str(tmp_path / "x"), "--format", form, *STEREO, *SMALL, "--duration", "1h"]
    with subprocess.Popen([*COMMAND, *argv], stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 120
        while len(list(tmp_path.rglob("cam1/data/*.png"))) < 25:
            assert time.monotonic() < deadline
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        error = process.communicate(timeout=300)[1]
    assert process.returncode == 130
    assert sorted(os.listdir(tmp_path)) == ["x.partial", "x.partial_truth.yaml"]
    folder = tmp_path / "x.partial" / place
    images_by_camera = {
        name: sorted(os.listdir(folder / name / "data")) for name in ("cam0", "cam1")
    }
    assert images_by_camera["cam0"] == images_by_camera["cam1"]
    assert len(images_by_camera["cam0"]) >= 20
    for name, images in images_by_camera.items():
        rows = (folder / name / "data.csv").read_text(encoding="utf-8").splitlines()[1:]
        assert [row.split(",")[1] for row in rows] == images
        last_stamp = int(images[-1].removesuffix(".png"))
        assert f"{len(images):,} images of {name} up to stamp {last_stamp * 1e-9:.9f} s" in error
        sizes = [(folder / name / "data" / image).read_bytes()[-8:] for image in images]
        assert set(sizes) == {b"IEND\xaeB`\x82"}
    assert np.unique(np.diff([int(n.removesuffix(".png")) for n in images_by_camera["cam0"]])) == [
        50_000_000
    ]


@pytest.mark.parametrize("camera", [0, 1])
def test_no_image_stays_behind_one_that_was_cancelled(tmp_path, monkeypatch, camera):
    """A thread may begin an image while the ones before it are being cancelled."""
    make = ImageFolders._make

    def cancel_one(self, frame, ids, path):
        if (frame.camera, frame.number) == (camera, 12):
            return
        make(self, frame, ids, path)
        if (frame.camera, frame.number) == (1, 20):
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(ImageFolders, "_make", cancel_one)
    argv = ["-o", str(tmp_path / "x"), "--format", "euroc", *STEREO, *SMALL, "--duration", "60s"]
    assert generate.main([*argv, "--quiet"]) == 130
    folder = tmp_path / "x.partial"
    images_by_camera = {
        name: sorted(os.listdir(folder / name / "data")) for name in ("cam0", "cam1")
    }
    assert images_by_camera["cam0"] == images_by_camera["cam1"]
    assert len(images_by_camera["cam0"]) == 12


def test_images_under_way_are_not_waited_for(tmp_path, monkeypatch, capsys):
    """A large image takes minutes: it is given up, and those before it are whole."""
    make, released, expired = ImageFolders._make, threading.Event(), []
    complete = threading.Semaphore(0)

    def hold(self, frame, samples, path):
        if frame.number < 3:
            make(self, frame, samples, path)
            complete.release()
            return
        if frame.number == 3:
            assert all(complete.acquire(timeout=60) for _ in range(3))
            os.kill(os.getpid(), signal.SIGTERM)
        if not released.wait(120):
            expired.append(frame.number)

    monkeypatch.setattr(ImageFolders, "_make", hold)
    camera = ["--trajectory", "figure_eight", "--camera", "euroc_cam0", "--scene", "room", *SMALL]
    arguments = ["-o", str(tmp_path / "x"), "--format", "euroc", *camera, "--duration", "60s"]
    try:
        assert generate.main([*arguments, "--quiet"]) == 143
    finally:
        released.set()
    assert not expired
    assert "3 images of cam0 up to stamp 1.100000000 s" in capsys.readouterr().err
    images = sorted((tmp_path / "x.partial/cam0/data").glob("*.png"))
    assert [image.read_bytes()[-8:] for image in images] == [b"IEND\xaeB`\x82"] * 3


def interrupted_while_compiling(folder):
    """Interrupt a program that has just begun to compile; return True if it did not go on."""
    arguments = ["-o", str(folder / "x"), "--format", "euroc", *STEREO, "--duration", "1h"]
    command = [sys.executable, "-m", "imu_sim_ros", "generate", *arguments]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "compiled")}
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stderr is not None
        lines = iter(process.stderr.readline, "")
        assert any("images is compiled first" in line for line in lines)
        process.send_signal(signal.SIGINT)
        error = process.communicate(timeout=300)[1]
    assert process.returncode == 130
    assert error.startswith(f"generate: interrupted; {folder / 'x'}.partial: ")
    return "0 images of cam0" in error and not list(folder.rglob("*.nbc"))


def test_compiling_is_not_waited_for(tmp_path):
    """Compilation takes up to 15 s and cannot be interrupted: nothing of it is kept.

    On a busy machine the signal may come after the last function was compiled, but not each time.
    """
    folders = [tmp_path / str(attempt) for attempt in range(3)]
    for folder in folders:
        folder.mkdir()
    assert any(map(interrupted_while_compiling, folders))


@pytest.mark.parametrize("table", [columns.CsvTable, columns.NpzTable])
def test_tables_of_tracks_end_with_the_same_rows(tmp_path, capsys, monkeypatch, table):
    """A signal comes just before and just after the rows of a block are in the first table."""
    write, calls = table.write, []

    def write_and_signal(self, *values):
        calls.append(self)
        if len(calls) == 4:
            os.kill(os.getpid(), signal.SIGINT)
        write(self, *values)

    monkeypatch.setattr(table, "write", write_and_signal)
    argv = ["-o", str(tmp_path / "x"), "--format", "tracks", *STEREO, "--duration", "60s"]
    assert generate.main([*argv, "--quiet"]) == 130
    [folder] = tmp_path.glob("x.partial")
    [path] = folder.glob("tracks*.csv")
    rows = path.read_text(encoding="utf-8").splitlines()[1:]
    [track_count] = re.findall(r"([\d,]+) tracks", capsys.readouterr().err)
    arrays = np.load(folder / "tracks.npz")
    assert len(rows) == int(track_count.replace(",", "")) > 1000
    assert {name: len(arrays[name]) for name in arrays} == dict.fromkeys(arrays, len(rows))
    assert [int(row.split(",")[0]) for row in rows] == arrays["t_ns"].tolist()
