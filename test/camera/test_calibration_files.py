# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cameras from the files of other tools, and from those that ``--with-configs`` writes."""

import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.core.errors import ConfigurationError, Remark
from imu_sim_ros.datasets.configurations import imu_values, rig_values
from imu_sim_ros.datasets.consumers import basalt, kalibr, openvins, orb_slam3, vins
from imu_sim_ros.datasets.consumers.rig import RigValues
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.recorded import Description, sensor_yaml
from imu_sim_ros.sensors.camera import calibration_files
from imu_sim_ros.sensors.camera.declaration import info_of_camera
from imu_sim_ros.sensors.camera.images.vignetting import vignette
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig_parameters import load_rig
from imu_sim_ros.simulation.parameters import load_simulation

TURN = [0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0]
MOUNT: dict[str, object] = {"lever_arm": [0.1, -0.05, 0.02], "mounting": TURN}
RADTAN: dict[str, object] = {
    "distortion_model": "radtan",
    "distortion": [-0.28, 0.07, 2e-4, 1.8e-5],
}
LENSES: dict[str, dict[str, object]] = {
    "radtan": RADTAN,
    "radtan5": {**RADTAN, "distortion": [-0.28, 0.07, 2e-4, 1.8e-5, 0.01]},
    "none": {"distortion_model": "none", "distortion": []},
    "equidistant": {
        "distortion_model": "equidistant",
        "distortion": [-0.01, 0.02, -0.01, 0.002],
    },
    "unified": {"model": "unified", "xi": 0.9, "distortion_model": "none", "distortion": []},
    "unified_radtan": {"model": "unified", "xi": 0.9, **RADTAN},
    "double_sphere": {
        "model": "double_sphere",
        "xi": -0.2,
        "alpha": 0.6,
        "distortion_model": "none",
        "distortion": [],
    },
}


def read_camera(file: str) -> tuple[CameraParameters, str]:
    """Return the camera of a file, and the remarks of its reading."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", Remark)
        rig = load_rig({"cameras": ["cam"], "cam.camera.preset": file})
    return rig.camera("cam"), "\n".join(str(line.message) for line in caught)


def configurations(lens: str) -> tuple[dict[str, CameraParameters], dict[str, str]]:
    """Return two cameras, and the texts of all stacks that support their lenses."""
    second = {**MOUNT, "lever_arm": [0.1, 0.06, 0.02], "time_offset": 0.003}
    cameras = {
        f"{name}.camera.{key}": value
        for name, mount in (("cam0", MOUNT), ("cam1", second))
        for key, value in {"preset": "euroc_cam0", **LENSES[lens], **mount}.items()
    }
    parameters = load_simulation(
        {
            "imu.preset": "perfect",
            "imu.stamp_offset": 0.005,
            "trajectory.type": "static",
            "imu.lever_arm": [0.0, 0.1, 0.0],
            "imu.mounting": TURN,
            "duration": 1.0,
            "cameras": ["cam0", "cam1"],
            "scene.type": "room",
            **cameras,
        }
    )
    imu = imu_values(parameters, "/imu")
    rig = rig_values(imu, parameters, {})
    assert rig is not None
    subject = Subject(imu, rig)
    texts = dict[str, str]()
    for stack in (kalibr, openvins, vins, basalt, orb_slam3):
        texts |= stack.files(subject)
    for name, camera in rig.cameras.items():
        description = Description(info_of_camera(camera), rig.imu_camera(name))
        texts[f"sensor_{name}.yaml"] = sensor_yaml(
            description, (0, 50_000_000, 100_000_000), "test"
        )
    return dict(rig.cameras), texts


def test_vignetting_and_rows_come_back_from_the_files_that_have_them(tmp_path: Path) -> None:
    """Basalt's spline equals the simulated share of light, evaluated as RdSpline does."""
    parameters = load_rig(
        {
            "cameras": ["cam0"],
            "camera.preset": "euroc_cam0",
            "camera.vignetting": 0.3,
            "camera.row_time": 2e-5,
        }
    )
    camera = parameters.camera("cam0")
    imu = imu_values(load_simulation({"imu.preset": "perfect", "duration": 1.0}), "/imu")
    rig = RigValues(imu, {"cam0": camera}, {"cam0": "/image"}, parameters.scene)
    text = basalt.files(Subject(imu, rig))["basalt_calibration.json"]
    (tmp_path / "basalt.json").write_text(text, encoding="utf-8")
    assert read_camera(str(tmp_path / "basalt.json"))[0].vignetting == pytest.approx(0.3, abs=1e-9)
    (spline,) = json.loads(text)["value0"]["vignette"]
    knots, interval = np.ravel(spline["value2"]), spline["value1"] * 1e-9
    rows, columns = np.array([0, 100, 240, 479]), np.array([0, 300, 367, 751])
    cx, cy = camera.intrinsics[2:]
    part, index = np.modf(np.hypot(columns - cx, rows - cy) / interval)
    knot_numbers = index.astype(int)[:, None] + np.arange(4)
    weights = np.stack(
        [
            (1 - part) ** 3,
            3 * part**3 - 6 * part**2 + 4,
            -3 * part**3 + 3 * part**2 + 3 * part + 1,
            part**3,
        ],
        axis=1,
    )
    shares = (knots[knot_numbers] * weights).sum(axis=1) / 6.0
    np.testing.assert_allclose(shares, vignette(camera)[rows, columns], atol=1e-6)
    (tmp_path / "chain.yaml").write_text(kalibr.camchain(rig), encoding="utf-8")
    assert read_camera(str(tmp_path / "chain.yaml"))[0].row_time == 2e-5


def test_a_vignette_of_another_form_is_fitted_and_named(tmp_path: Path) -> None:
    """The centre of the published TUM VI calibration: dark in the middle, black at the corners."""
    shares = [0.99, 0.993, 0.998, 0.997, 0.996, 0.98, 0.94, 0.88, 0.8, 0.5, 0.03, 0.01, 0.01]
    spline: dict[str, object] = {
        "value0": 0,
        "value1": 50_000_000_000,
        "value2": [[share] for share in shares],
    }
    calibration = {
        "T_imu_cam": [],
        "intrinsics": [
            {"camera_type": "pinhole", "intrinsics": {"fx": 200, "fy": 200, "cx": 256, "cy": 256}}
        ],
        "resolution": [[512, 512]],
        "vignette": [spline],
    }
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps({"value0": calibration}), encoding="utf-8")
    camera, remarks = read_camera(str(path))
    assert 0.1 < camera.vignetting < 0.9
    assert "vignette beyond vignetting" in remarks
    del spline["value1"]
    path.write_text(json.dumps({"value0": calibration}), encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"vignette.value1 = missing"):
        read_camera(str(path))


def test_a_recorded_camera_without_its_own_pose_has_that_of_the_chain(tmp_path: Path) -> None:
    """T_cn_cnm1 alone, as kalibr's calibration of cameras without an IMU writes it for cam1."""
    _, texts = configurations("radtan")
    (tmp_path / "whole.yaml").write_text(texts["camchain.yaml"], encoding="utf-8")
    lines = texts["camchain.yaml"].splitlines()
    begin = max(k for k, line in enumerate(lines) if line.startswith("  T_cam_imu"))
    shorter = "\n".join(lines[:begin] + lines[begin + 5 :])
    (tmp_path / "chain.yaml").write_text(shorter, encoding="utf-8")
    whole_info, whole_pose = calibration_files.description(tmp_path / "whole.yaml", "cam1")
    info, pose = calibration_files.description(tmp_path / "chain.yaml", "cam1")
    assert info is not None
    assert whole_info is not None
    assert info.is_equal(whole_info)
    assert pose is not None
    assert whole_pose is not None
    np.testing.assert_allclose(pose, whole_pose, atol=1e-9)
    assert calibration_files.description(tmp_path / "whole.yaml", "cam2") == (None, None)


FILES = {
    "camchain.yaml#cam1": tuple(LENSES),
    "kalibr_imucam_chain.yaml#cam1": ("radtan", "none", "equidistant"),
    "vins_fusion.yaml#cam1": ("radtan", "none", "equidistant", "unified", "unified_radtan"),
    "vins_mono.yaml": ("radtan", "none", "equidistant", "unified", "unified_radtan"),
    "basalt_calibration.json#cam1": (
        *("radtan", "radtan5", "none", "equidistant", "unified", "double_sphere"),
    ),
    "orb_slam3_stereo_inertial.yaml#Camera2": ("radtan", "radtan5", "none", "equidistant"),
    "orb_slam3_mono_inertial.yaml": ("radtan", "radtan5", "none", "equidistant"),
    "sensor_cam1.yaml": tuple(LENSES),
}
"""Files of the stacks, and the lenses that their forms can express."""


@pytest.mark.parametrize("lens", LENSES)
def test_what_is_written_is_the_same_camera(lens: str, tmp_path: Path) -> None:
    cameras, texts = configurations(lens)
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    turn = np.reshape(TURN, (3, 3))
    for file, lenses in FILES.items():
        if lens not in lenses:
            continue
        camera, _ = read_camera(str(tmp_path / file))
        name = "cam1" if file.endswith(("1", "2", "sensor_cam1.yaml")) else "cam0"
        truth = cameras[name]
        four = file.startswith(("camchain",)) and lens == "radtan5"
        assert (camera.model, camera.distortion_model) == (truth.model, truth.distortion_model)
        assert (camera.width, camera.height) == (truth.width, truth.height)
        assert camera.intrinsics == pytest.approx(truth.intrinsics), file
        assert camera.distortion == pytest.approx(truth.distortion[: 4 if four else 5]), file
        assert (camera.xi, camera.alpha) == pytest.approx((truth.xi, truth.alpha)), file
        # T_ic of an IMU at p_bi with R_bi on the body.
        r_bc, p_bc = truth.pose()
        r_ic, p_ic = camera.pose()
        np.testing.assert_allclose(r_ic, turn.T @ r_bc, atol=1e-6, err_msg=file)
        np.testing.assert_allclose(p_ic, turn.T @ (p_bc - [0.0, 0.1, 0.0]), atol=1e-6, err_msg=file)
        if not file.startswith(("orb", "sensor")):
            # VINS and Basalt have a single shift, that of the first camera.
            alone = file.startswith(("vins", "basalt"))
            shift = cameras["cam0"].time_offset if alone else truth.time_offset
            assert camera.time_offset == pytest.approx(shift + 0.005, abs=1e-9), file


@pytest.mark.parametrize("lens", ["radtan", "radtan5", "none", "equidistant", "unified_radtan"])
def test_a_recorded_camera_has_the_camera_info_of_the_simulated_one(
    lens: str, tmp_path: Path
) -> None:
    cameras, texts = configurations(lens)
    path = tmp_path / "sensor.yaml"
    path.write_text(texts["sensor_cam1.yaml"], encoding="utf-8")
    info, _ = calibration_files.description(path)
    assert info is not None
    assert info.is_equal(info_of_camera(cameras["cam1"])), (info, info_of_camera(cameras["cam1"]))


CHAIN = """cam0:
  T_cam_imu: [[0, -1, 0, 0.1], [0, 0, -1, 0.2], [1, 0, 0, 0.3], [0, 0, 0, 1]]
  camera_model: pinhole
  intrinsics: [400.0, 401.0, 320.0, 240.0]
  distortion_model: radtan
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [640, 480]
  timeshift_cam_imu: 0.002
cam1:
  T_cn_cnm1: [[1, 0, 0, -0.11], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  camera_model: eucm
  intrinsics: [0.5, 1.0, 200.0, 201.0, 320.0, 240.0]
  distortion_model: none
  distortion_coeffs: []
  resolution: [640, 480]
  rostopic: /cam1
"""


def test_chain_without_the_second_mount(tmp_path: Path) -> None:
    """T_c1_i = T_c1_c0 T_c0_i; the extended unified model with beta 1 is Mei's sphere."""
    file = tmp_path / "camchain.yaml"
    file.write_text(CHAIN)
    with pytest.raises(ConfigurationError, match=r"several cameras, name .* cam0, cam1: .*#cam0"):
        read_camera(str(file))
    with pytest.raises(ConfigurationError, match=r"has no camera 'cam2'; it has cam0, cam1"):
        read_camera(f"{file}#cam2")
    camera, remarks = read_camera(f"{file}#cam1")
    # p_ic = -R_ci^T p_ci with p_ci = (0.1 - 0.11, 0.2, 0.3).
    np.testing.assert_allclose(camera.lever_arm, [-0.3, -0.01, 0.2], atol=1e-12)
    assert (camera.model, camera.xi) == ("unified", 1.0)
    assert camera.intrinsics == (400.0, 402.0, 320.0, 240.0)
    assert "not used: rostopic" in remarks
    assert read_camera(f"{file}#cam0")[0].time_offset == 0.002


@pytest.mark.parametrize(
    ("text", "replacement", "line"),
    [
        ("timeshift_cam_imu", "timeshift_cam_im", "did you mean timeshift_cam_imu"),
        ("distortion_model: radtan", "distortion_model: fov", "'fov': not simulated"),
        ("camera_model: pinhole", "camera_model: ocam", "camera_model = 'ocam'"),
        ("[400.0, 401.0, 320.0, 240.0]", "[400.0, 401.0]", "intrinsics = .*4 finite numbers"),
        ("[0, 0, -1, 0.2]", "[0, 0, -2, 0.2]", "T_cam_imu: must be a rigid motion"),
        (
            "  camera_model: pinhole",
            "  T_imu_cam: [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n  camera_model: pinhole",
            "T_imu_cam.*contradicts T_cam_imu",
        ),
        ("0.002", "late", "timeshift_cam_imu = 'late'"),
        ("[640, 480]\n  timeshift", "[640.5, 480]\n  timeshift", "a whole number of pixels"),
    ],
)
def test_bad_values_of_a_chain_are_named(
    text: str, replacement: str, line: str, tmp_path: Path
) -> None:
    file = tmp_path / "camchain.yaml"
    assert text in CHAIN
    file.write_text(CHAIN.replace(text, replacement, 1))
    with pytest.raises(ConfigurationError, match=line):
        read_camera(f"{file}#cam0")


CAMERA_INFO = """image_width: 640
image_height: 480
camera_name: front
camera_matrix: {rows: 3, cols: 3, data: [400.0, 0, 320.0, 0, 401.0, 240.0, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.2, 0.05, 0.001, 0.002, 0.0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
"""
NCAMERA = """label: rig
cameras:
- camera:
    label: left
    image_width: 640
    image_height: 480
    type: pinhole
    intrinsics: {cols: 1, rows: 4, data: [400.0, 401.0, 320.0, 240.0]}
    distortion:
      type: radial-tangential
      parameters: {cols: 1, rows: 4, data: [-0.2, 0.05, 0.001, 0.002]}
  T_B_C: {rows: 4, cols: 4, data: [0, 0, 1, 0.1, -1, 0, 0, 0.2, 0, -1, 0, 0.3, 0, 0, 0, 1]}
"""
KIMERA = """%YAML:1.0
camera_id: left_cam
T_BS:
  cols: 4
  rows: 4
  data: [0, 0, 1, 0.1, -1, 0, 0, 0.2, 0, -1, 0, 0.3, 0, 0, 0, 1]
rate_hz: 30
resolution: [640, 480]
camera_model: pinhole
intrinsics: [400.0, 401.0, 320.0, 240.0]
distortion_model: radial-tangential
distortion_coefficients: [-0.2, 0.05, 0.001, 0.002]
"""
ORB = """%YAML:1.0
Camera.type: "PinHole"
Camera.fx: 400.0
Camera.fy: 401.0
Camera.cx: 320.0
Camera.cy: 240.0
Camera.k1: -0.2
Camera.k2: 0.05
Camera.p1: 0.001
Camera.p2: 0.002
Camera.width: 640
Camera.height: 480
Camera.fps: 30.0
Tbc: !!opencv-matrix
   rows: 4
   cols: 4
   dt: f
   data: [0, 0, 1, 0.1, -1, 0, 0, 0.2, 0, -1, 0, 0.3, 0, 0, 0, 1]
"""


@pytest.mark.parametrize(
    ("text", "remark"),
    [
        (CAMERA_INFO, "has no mount of the camera"),
        (NCAMERA, "not used: label"),
        (KIMERA, "camera_id"),
        (ORB, ""),
    ],
)
def test_files_of_other_tools(text: str, remark: str, tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(text)
    camera, remarks = read_camera(str(file))
    assert camera.intrinsics == (400.0, 401.0, 320.0, 240.0)
    assert (camera.width, camera.height) == (640, 480)
    assert camera.distortion == (-0.2, 0.05, 0.001, 0.002)
    assert remark in remarks
    if text is not CAMERA_INFO:
        assert camera.lever_arm == (0.1, 0.2, 0.3)
        np.testing.assert_allclose(camera.mounting, np.ravel([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]))
    assert camera.rate == (30.0 if re.search(r"rate_hz|fps", text) else 20.0)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (CAMERA_INFO.replace("plumb_bob", "thin_prism"), "thin_prism"),
        (CAMERA_INFO.replace("400.0, 0, 320", "400.0, 5, 320"), "skew"),
        (NCAMERA.replace("radial-tangential", "fisheye"), "'fov': not simulated"),
        (ORB.replace("PinHole", "Equirectangular"), "Camera.type = 'Equirectangular'"),
        (KIMERA.replace("distortion_coefficients", "distorsion_coefficients"), "did you mean"),
    ],
)
def test_models_that_are_not_simulated_are_named(text: str, line: str, tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=line):
        calibration_files.load(str(file))
