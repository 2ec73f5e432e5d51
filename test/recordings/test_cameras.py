# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Descriptions of cameras that contradict their images, and clouds without times of points."""

import json

import cv2
import numpy as np
import pytest
import yaml

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.messages.encode_cameras import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    POINT_CLOUD2,
    CameraInfoEncoder,
    CompressedImageEncoder,
    ImageEncoder,
    PointCloud2Encoder,
)
from imu_sim_ros.bags.writer import BagOptions, Block
from imu_sim_ros.commands import convert_bag, generate, inspect
from imu_sim_ros.parameters import files
from imu_sim_ros.recordings.cameras import CameraInfo, CameraRecord
from imu_sim_ros.recordings.findings.catalogue import camera_findings
from imu_sim_ros.sensors.camera.declaration import cameras_in, info_of_camera
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.sensors import mount_sensors

K = np.array([[57.0, 0.0, 47.0], [0.0, 56.0, 31.0], [0.0, 0.0, 1.0]])
P = np.column_stack([K, np.zeros(3)])
GOOD = CameraInfo(60, 94, "plumb_bob", (0.1, 0.0, 0.0, 0.0, 0.0), K, np.eye(3), P)
FAULTS = {
    "intrinsics_absent": [GOOD._replace(k=np.zeros((3, 3)), p=np.zeros((3, 4)), d=())],
    "intrinsics_changed": [GOOD, GOOD, GOOD._replace(k=K @ np.diag([1.1, 1.1, 1.0]))],
    "image_size": [GOOD._replace(height=120, width=188)],
    "distortion_count": [GOOD._replace(distortion_model="equidistant")],
}
NOT_FINITE = GOOD._replace(d=(np.nan,) * 5)
FRAMES = 4


def write_camera(path, infos, shape=(60, 94), jpeg=False, topic="image_raw"):
    """Write readings and images with descriptions, of which the last one repeats."""
    readings = ims.simulate(duration=0.2, rate=100).readings
    stamps = readings.t_ns[: 3 * FRAMES : 3]
    image = np.arange(shape[0] * shape[1]).reshape(shape).astype(np.uint8)
    with open_writer(path, BagOptions()) as writer:
        encoding = writer.encoding
        kind, encoder = IMAGE, ImageEncoder("cam", *shape, "mono8", encoding)
        payload = image
        if jpeg:
            kind = COMPRESSED_IMAGE
            encoder = CompressedImageEncoder("cam", "mono8", encoding, "jpeg")
            payload = cv2.imencode(".jpg", image)[1].tobytes()
        described = [
            CameraInfoEncoder("cam", info, encoding)
            for info in [*infos, *[infos[-1]] * (FRAMES - len(infos))]
        ]
        imu = ImuEncoder("imu", encoding).pattern(readings.t_ns, readings.gyro, readings.accel)
        images = [encoder.encode(t_ns, payload) for t_ns in stamps.tolist()]
        infos = [info.encode(t) for info, t in zip(described, stamps.tolist(), strict=True)]
        name = f"/cam0/{topic}/compressed" if jpeg else f"/cam0/{topic}"
        blocks = [
            Block(writer.add_topic("/imu/data_raw", IMU), readings.t_ns, imu),
            Block(writer.add_topic(name, kind), stamps, images),
            Block(writer.add_topic("/cam0/camera_info", CAMERA_INFO), stamps, infos),
        ]
        writer.write_blocks(blocks)
    return path


def converted(path, tmp_path, capsys):
    """Return the description of cam0 in the folder that a bag becomes, and standard error."""
    arguments = [str(path), "-o", str(tmp_path / "out"), "--format", "euroc", "--force"]
    assert convert_bag.main(arguments) == 0
    captured = capsys.readouterr()
    return yaml.safe_load((tmp_path / "out" / "cam0" / "sensor.yaml").read_text()), captured.err


def kinds_of(path, capsys):
    """Return the kinds of the findings of a file, as inspect prints them."""
    capsys.readouterr()
    assert inspect.main([str(path), "--json"]) == 0
    findings = json.loads(capsys.readouterr().out)["findings"]
    return {finding["kind"] for finding in findings}


@pytest.mark.parametrize("name", ["seen.bag", "seen.mcap"])
@pytest.mark.parametrize("kind", FAULTS)
def test_a_description_that_contradicts_images_is_told_and_not_written(
    tmp_path, capsys, name, kind
):
    path = write_camera(tmp_path / name, FAULTS[kind])
    assert kinds_of(path, capsys) == {kind}
    description, error_text = converted(path, tmp_path, capsys)
    assert "intrinsics" not in description
    assert "resolution" not in description
    assert f"{name}, /cam0/camera_info" in error_text
    assert "cam0/sensor.yaml: without intrinsics" in error_text


@pytest.mark.parametrize("jpeg", [False, True])
def test_a_description_that_fits_is_written_without_a_word(tmp_path, capsys, jpeg):
    path = write_camera(tmp_path / "seen.mcap", [GOOD], jpeg=jpeg)
    assert kinds_of(path, capsys) == set()
    description, error_text = converted(path, tmp_path, capsys)
    assert description["intrinsics"] == [57.0, 56.0, 47.0, 31.0]
    assert "camera_info" not in error_text
    wrong = write_camera(tmp_path / "wrong.mcap", [GOOD], (30, 47), jpeg)
    assert kinds_of(wrong, capsys) == {"image_size"}


@pytest.mark.parametrize("jpeg", [False, True])
@pytest.mark.parametrize("topic", ["image_rect", "image_rect_color"])
def test_rectified_images_have_the_intrinsics_of_p(tmp_path, capsys, topic, jpeg):
    """camera_info has K and D of the raw images; image_proc rectifies them to P."""
    p = P @ np.diag([0.9, 0.9, 1.0, 1.0])
    path = write_camera(tmp_path / "r.mcap", [GOOD._replace(p=p)], jpeg=jpeg, topic=topic)
    description, error_text = converted(path, tmp_path, capsys)
    np.testing.assert_allclose(description["intrinsics"], [p[0, 0], p[1, 1], p[0, 2], p[1, 2]])
    assert not any(description["distortion_coefficients"])
    assert f"/cam0/{topic}" in error_text
    assert "is rectified: intrinsics of P" in error_text
    path = write_camera(tmp_path / "z.mcap", [GOOD._replace(p=0.0 * P)], jpeg=jpeg, topic=topic)
    description, error_text = converted(path, tmp_path, capsys)
    assert "intrinsics" not in description
    assert "P of /cam0/camera_info has no focal length" in error_text


@pytest.mark.parametrize("name", ["seen.bag", "seen.mcap"])
def test_binning_and_region_are_converted_to_the_images(tmp_path, capsys, name):
    info = GOOD._replace(binning=(2, 2), region=(10, 4, 40, 60))
    path = write_camera(tmp_path / name, [info], (20, 30))
    assert kinds_of(path, capsys) == {"image_part"}
    description, error_text = converted(path, tmp_path, capsys)
    assert description["resolution"] == [30, 20]
    # A point projects to u = fx x + cx in the full image, (u - 10) / 2 in the binned region.
    assert description["intrinsics"] == [28.5, 28.0, 18.5, 13.5]
    assert "binning 2 x 2, region 60 x 40 at (10, 4)" in error_text


def test_models_of_distortion_that_are_not_known_are_told_in_both_directions(tmp_path, capsys):
    info = GOOD._replace(distortion_model="fov", d=(0.9,))
    path = write_camera(tmp_path / "seen.mcap", [info])
    assert kinds_of(path, capsys) == {"distortion_unknown"}
    _, error_text = converted(path, tmp_path, capsys)
    assert "fov with 1 coefficients; name the model as sensor_msgs does" in error_text
    folder = next(tmp_path.rglob("cam0")).parent
    assert convert_bag.main([str(folder), "-o", str(tmp_path / "back.mcap")]) == 0
    assert "fov with 1 coefficients" in capsys.readouterr().err
    fisheye = GOOD._replace(distortion_model="fisheye", d=(0.1, 0.0, 0.0, 0.0))
    assert not camera_findings(CameraRecord("/cam0", (fisheye,), (0,), (60, 94)))


def test_coefficients_that_are_not_finite_are_told_and_not_written(tmp_path, capsys):
    path = write_camera(tmp_path / "seen.mcap", [NOT_FINITE, NOT_FINITE])
    assert kinds_of(path, capsys) == {"distortion_count"}
    description, error_text = converted(path, tmp_path, capsys)
    assert "intrinsics" not in description
    assert "coefficients nan, nan, nan, nan, nan: not finite" in error_text


def test_a_size_that_camera_info_does_not_state_is_that_of_the_images(tmp_path, capsys):
    path = write_camera(tmp_path / "seen.mcap", [GOOD._replace(height=0, width=0)])
    description, _ = converted(path, tmp_path, capsys)
    assert description["resolution"] == [94, 60]


def test_zeros_before_the_calibration_was_loaded_are_left_out(tmp_path, capsys):
    path = write_camera(tmp_path / "late.mcap", [*FAULTS["intrinsics_absent"], GOOD])
    description, _ = converted(path, tmp_path, capsys)
    assert description["intrinsics"] == [57.0, 56.0, 47.0, 31.0]


def test_cameras_of_all_presets_fit_their_images():
    for name in files.names("cameras"):
        built = load_simulation({"cameras": ["cam0"], "camera.preset": name})
        info = info_of_camera(cameras_in(mount_sensors(built))["cam0"].parameters)
        record = CameraRecord(name, (info,), (0,), (info.height, info.width))
        assert camera_findings(record) == [], name


@pytest.mark.parametrize(
    ("entry", "contradiction", "message"),
    [
        ("resolution: [94, 60]", "resolution: [47, 30]", "described are 47 x 30 pixels, images"),
        ("[57, 56, 47, 31]", "[0, 56, 47, 31]", "fx and fy must be above 0 px"),
        ("[0.1, 0, 0, 0]", "[0.1, 0, 0]", "3 coefficients; plumb_bob has 0 or 4 or 5"),
        ("radial-tangential\n", "equidistant\n", "5 coefficients; equidistant has 4"),
    ],
)
def test_a_folder_whose_description_contradicts_its_images_is_refused(
    tmp_path, capsys, entry, contradiction, message
):
    info = GOOD._replace(d=(0.1, 0.0, 0.0, 0.0))
    converted(write_camera(tmp_path / "seen.mcap", [info]), tmp_path, capsys)
    file = tmp_path / "out" / "cam0" / "sensor.yaml"
    text = file.read_text()
    if "equidistant" in contradiction:
        text = text.replace("[0.1, 0, 0, 0]", "[0.1, 0, 0, 0, 0.2]")
    assert entry in text, text
    file.write_text(text.replace(entry, contradiction))
    assert convert_bag.main([str(tmp_path / "out"), "-o", str(tmp_path / "back.mcap")]) == 2
    error_text = capsys.readouterr().err.strip()
    assert message in error_text
    assert len(error_text.splitlines()) == 1


FIELDS = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")]


@pytest.mark.parametrize("name", ["scans.bag", "scans.mcap"])
@pytest.mark.parametrize(
    ("field", "times", "kind"),
    [
        (None, 0.0, {"point_times_absent"}),
        ("time", 0.0, {"point_times_constant"}),
        ("timestamp", 1.0e9, {"point_times_constant"}),
        ("t", np.arange(50.0), set()),
    ],
)
def test_clouds_without_times_of_points_are_told(tmp_path, capsys, name, field, times, kind):
    rows = np.zeros(50, np.dtype(FIELDS + ([(field, "<f8")] if field else [])))
    if field:
        rows[field] = times
    with open_writer(tmp_path / name, BagOptions()) as writer:
        encoder = PointCloud2Encoder("lidar", writer.encoding)
        topic = writer.add_topic("/points", POINT_CLOUD2)
        t_ns = np.array([10**9, 11 * 10**8])
        writer.write_blocks([Block(topic, t_ns, [encoder.encode(int(t), rows) for t in t_ns])])
    assert kinds_of(tmp_path / name, capsys) == kind


def test_depth_without_images_is_written_and_read(tmp_path, capsys):
    arguments = ["--camera", "euroc_cam0", "--scene", "aprilgrid", "--trajectory", "target"]
    small = {"width": "94", "height": "60", "intrinsics": "[57.3,57.2,45.9,31.0]"}
    settings = {**small, "depth": "true", "images": "none"}
    for key, value in settings.items():
        arguments += ["--set", f"camera.{key}={value}"]
    arguments += ["--duration", "0.2s", "--quiet"]
    folder, bag = tmp_path / "mav0", tmp_path / "seen.mcap"
    assert generate.main(["-o", str(folder), "--format", "euroc", *arguments]) == 0
    names = sorted(path.name for path in (folder / "cam0" / "depth").iterdir())
    assert len(names) == 4
    assert generate.main(["-o", str(bag), *arguments]) == 0
    for source, output in ((bag, "from_bag"), (folder, "copy")):
        out = tmp_path / output
        assert convert_bag.main([str(source), "-o", str(out), "--format", "euroc"]) == 0
        assert sorted(path.name for path in (out / "cam0" / "depth").iterdir()) == names
        assert "intrinsics" in yaml.safe_load((out / "cam0" / "sensor.yaml").read_text())
    capsys.readouterr()
    assert convert_bag.main([str(folder), "-o", str(tmp_path / "back.mcap"), "--json"]) == 0
    counts = json.loads(capsys.readouterr().out)["messages"]
    assert counts["/cam0/depth/image_raw"] == counts["/cam0/camera_info"] == 4


def test_a_run_without_a_frame_says_so(tmp_path, capsys):
    arguments = ["-o", str(tmp_path / "none"), "--camera", "euroc_cam0", "--duration", "0.1s"]
    assert generate.main([*arguments, "--format", "euroc", "--set", "camera.images=none"]) == 0
    error_text = capsys.readouterr().err
    assert "cam0: images, depth and flow are switched off: nothing of it is written" in error_text


@pytest.mark.parametrize("output", ["none.mcap", "none"])
def test_a_run_that_ends_before_the_first_frame_says_so(tmp_path, capsys, output):
    arguments = ["-o", str(tmp_path / output), "--camera", "euroc_cam0", "--duration", "0.1s"]
    arguments += ["--set", "camera.phase=0.5", *([] if "." in output else ["--format", "euroc"])]
    assert generate.main(arguments) == 0
    assert "cam0: not a single frame in the whole run, at 20 Hz" in capsys.readouterr().err


def test_a_run_that_ends_before_the_first_cloud_says_so(tmp_path, capsys):
    arguments = ["-o", str(tmp_path / "none.mcap"), "--lidar", "avia", "--duration", "0.05s"]
    assert generate.main([*arguments, "--set", "scene.type=ground"]) == 0
    assert "lidar: not a single frame in the whole run, at 10 Hz" in capsys.readouterr().err
