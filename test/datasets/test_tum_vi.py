# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A TUM VI sequence, read as its readers read it, beside EuRoC's folder of the same flight."""

import json

import cv2
import numpy as np
import pytest
import yaml

from imu_sim_ros.commands import generate
from imu_sim_ros.core import rotation
from imu_sim_ros.datasets.tum_vi import dso_lens
from imu_sim_ros.sensors.camera.rig_parameters import load_rig

TURN = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
SETTINGS = {
    "camera.body_axes": "flu",
    "camera.width": "94",
    "camera.height": "60",
    "camera.intrinsics": "[57.3,57.2,45.9,31.0]",
    "camera.trigger": "synchronised",
    "camera.exposure_time": "0.01",
    "camera.exposure_change": "0.5",
    "camera.exposure_period": "0.4",
    "camera.blur_samples": "2",
    "imu.lever_arm": "[0.1, 0.2, -0.05]",
    "imu.mounting": str(TURN),
}
FLIGHT = [
    *("--camera", "euroc_cam0", "--camera", "euroc_cam1", "--trajectory", "target"),
    *("--duration", "0.5s", "--seed", "5", "--imu", "adis16448", "--scene", "aprilgrid"),
    *(word for key, value in SETTINGS.items() for word in ("--set", f"{key}={value}")),
]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    for name, form in (("seq", "tum_vi"), ("mav0", "euroc")):
        assert generate.main(["-o", str(folder / name), "--format", form, *FLIGHT, "--quiet"]) == 0
    return folder


def table(path, separator=","):
    return np.loadtxt(path, delimiter=separator, comments="#", ndmin=2)


def test_images_and_readings_are_those_of_euroc(place):
    seq, euroc = place / "seq" / "mav0", place / "mav0"
    for name in ("cam0/data.csv", "cam1/data.csv", "imu0/data.csv"):
        assert (seq / name).read_text() == (euroc / name).read_text()
    for camera in ("cam0", "cam1"):
        for path in (euroc / camera / "data").iterdir():
            deep = cv2.imread(str(seq / camera / "data" / path.name), cv2.IMREAD_UNCHANGED)
            image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            assert deep.dtype == np.uint16
            assert np.array_equal(deep, image.astype(np.uint16) * 256)
            # ORB_SLAM3 asks for 8 bits.
            grey = cv2.imread(str(seq / camera / "data" / path.name), cv2.IMREAD_GRAYSCALE)
            assert np.array_equal(grey, image)
    assert not list(seq.rglob("sensor.yaml"))  # the original has none
    readings = table(place / "seq" / "dso" / "imu.txt", " ")
    assert np.array_equal(readings, table(seq / "imu0" / "data.csv"))


def test_poses_are_those_of_the_imu(place):
    seq = place / "seq"
    poses = table(seq / "mav0" / "mocap0" / "data.csv")
    assert np.array_equal(poses, table(seq / "dso" / "gt_imu.csv"))
    header = (seq / "mav0" / "mocap0" / "data.csv").read_text().splitlines()[0]
    assert header.startswith("#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w []")
    body = table(place / "mav0" / "state_groundtruth_estimate0" / "data.csv")
    r_wb, r_wi = (rotation.to_matrix(t[:, 4:8]) for t in (body, poses))
    np.testing.assert_allclose(r_wi, r_wb @ np.reshape(TURN, (3, 3)), atol=1e-12)
    np.testing.assert_allclose(poses[:, 1:4], body[:, 1:4] + r_wb @ [0.1, 0.2, -0.05], atol=1e-12)


def test_times_say_name_second_and_exposure(place):
    dso = place / "seq" / "dso"
    for camera in ("cam0", "cam1"):
        rows = [line.split() for line in (dso / camera / "times.txt").read_text().splitlines()[1:]]
        assert len(rows) == 10
        for name, second, exposure in rows:
            image = cv2.imread(str(dso / camera / "images" / f"{name}.png"), cv2.IMREAD_UNCHANGED)
            assert image.shape == (60, 94)
            assert second == f"{int(name) // 10**9}.{int(name) % 10**9:09d}"
            t = (int(name) - 10**9) * 1e-9
            expected = 10.0 * (1.0 + 0.5 * np.sin(2.0 * np.pi * t / 0.4))
            assert float(exposure) == pytest.approx(expected, abs=1e-6)


def test_the_calibration_is_kalibrs(place):
    chain = yaml.safe_load((place / "seq" / "dso" / "camchain.yaml").read_text())
    pose = yaml.safe_load((place / "mav0" / "cam1" / "sensor.yaml").read_text())["T_BS"]["data"]
    t_bi = np.eye(4)
    t_bi[:3, :3], t_bi[:3, 3] = np.reshape(TURN, (3, 3)), (0.1, 0.2, -0.05)
    expected = np.linalg.inv(np.reshape(pose, (4, 4))) @ t_bi
    np.testing.assert_allclose(chain["cam1"]["T_cam_imu"], expected, atol=1e-9)
    noise = yaml.safe_load((place / "seq" / "dso" / "imu_config.yaml").read_text())
    assert noise["gyroscope_noise_density"] == pytest.approx(1.6968e-4)


def test_the_lens_in_dsos_form(place):
    """DSO's reader takes centres as (cx + 0.5) / width, and the vignette as 16-bit shares."""
    dso = place / "seq" / "dso"
    for camera in ("cam0", "cam1"):
        sensor = yaml.safe_load((place / "mav0" / camera / "sensor.yaml").read_text())
        lens, *rest = (dso / camera / "camera.txt").read_text().splitlines()
        name, *numbers = lens.split()
        assert (name, rest) == ("RadTan", ["94 60", "crop", "94 60"])
        fx, fy, cx, cy = np.array(numbers[:4], float) * [94, 60, 94, 60] - [0, 0, 0.5, 0.5]
        np.testing.assert_allclose([fx, fy, cx, cy], sensor["intrinsics"], rtol=1e-11)
        assert [float(x) for x in numbers[4:]] == sensor["distortion_coefficients"]
        vignette = cv2.imread(str(dso / camera / "vignette.png"), cv2.IMREAD_UNCHANGED)
        assert vignette.dtype == np.uint16
        assert vignette.shape == (60, 94)
        assert (vignette == 65535).all()


def test_the_form_of_the_original_lens():
    """The reference is dso/cam0/camera.txt of a published sequence of 512 x 512 pixels."""
    name = "EquiDistant"
    shares = [0.373004838186, 0.372994740336, 0.498890050897, 0.502729380663]
    distortion = [0.00348238940225, 0.000715034845216, -0.00205323614187, 0.000202936735918]
    rig = load_rig({"cameras": ["cam0"], "cam0.camera.preset": "tum_vi_cam0"})
    ours = dso_lens(rig.camera("cam0")).splitlines()
    assert ours[0].split()[0] == name
    parameters = np.array(ours[0].split()[1:], float)
    np.testing.assert_allclose(parameters, [*shares, *distortion], atol=1e-12)
    assert ours[1:] == ["512 512", "crop", "512 512"]


def test_a_free_camera_has_readings_at_its_times(tmp_path):
    """DM-VIO looks for a reading with the stamp of each image: interpolated ones are added."""
    options = ["--set", "camera.trigger=free", "--set", "camera.phase=0.0031", "--quiet"]
    sequence = tmp_path / "seq"
    assert generate.main(["-o", str(sequence), "--format", "tum_vi", *FLIGHT, *options]) == 0
    readings = table(sequence / "mav0" / "imu0" / "data.csv")
    rows = table(sequence / "dso" / "imu.txt", " ")
    stamps = table(sequence / "dso" / "cam0" / "times.txt", " ")[:, 0]
    image_stamps = stamps[(stamps >= readings[0, 0]) & (stamps <= readings[-1, 0])]
    assert len(image_stamps) >= 9
    assert not np.isin(image_stamps, readings[:, 0]).any()
    assert len(rows) == len(readings) + len(image_stamps)
    assert (np.diff(rows[:, 0]) > 0).all()
    added = np.isin(rows[:, 0], image_stamps)
    assert np.array_equal(rows[~added], readings)
    start = readings[0, 0]
    for column in range(1, 7):
        line = np.interp(image_stamps - start, readings[:, 0] - start, readings[:, column])
        np.testing.assert_allclose(rows[added, column], line, rtol=1e-12)


def test_what_it_cannot_hold_is_refused(tmp_path, capsys):
    arguments = ["-o", str(tmp_path / "out"), "--format", "tum_vi"]
    assert generate.main([*arguments, "--duration", "1s"]) == 2
    assert "format tum_vi: needs a camera; --camera names one" in capsys.readouterr().err
    assert generate.main([*arguments, *FLIGHT, "--set", "imus=[a, b]"]) == 2
    assert "format tum_vi: has room for one IMU, not 2" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    assert generate.main([*arguments, *FLIGHT, "--json"]) == 0
    counts = json.loads(capsys.readouterr().out)["messages"]
    assert counts == {
        "/imu/data_raw": 100,
        "/ground_truth/odom": 100,
        "/cam0/image_raw": 10,
        "/cam1/image_raw": 10,
    }


def test_poses_are_on_the_clock_of_the_imu(tmp_path):
    """The poses have the clock of the IMU, as in the original; the page says so."""
    folder = tmp_path / "late"
    arguments = ["--format", "tum_vi", "--camera", "tum_vi_cam0", "--duration", "0.2s", "--quiet"]
    shift = ["--set", "imu.stamp_offset=0.005", "--set", "imu.clock_skew_ppm=1000"]
    assert generate.main(["-o", str(folder), *arguments, *shift]) == 0
    readings = table(folder / "mav0" / "imu0" / "data.csv")
    for name in ("mav0/mocap0/data.csv", "dso/gt_imu.csv"):
        assert np.array_equal(table(folder / name)[:, 0], readings[:, 0])
    chain = yaml.safe_load((folder / "dso" / "camchain.yaml").read_text())
    assert chain["cam0"]["timeshift_cam_imu"] == 0.005
