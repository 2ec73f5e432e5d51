# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stacks' files of cameras, read as the stacks read them, see what our cameras see.

From each file a point of the IMU's frame is brought to pixels by the stack's own equations:
OpenCV's for pinholes and fisheyes, those of the stack's headers, written down again, for spheres.
"""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from imu_sim_ros.datasets.consumers.folder import write_all
from imu_sim_ros.datasets.consumers.rig import RigValues
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.rig_parameters import load_rig
from imu_sim_ros.sensors.imu.parameters import ImuParameters

DATA = Path(__file__).parents[1] / "data"

IMU = {
    "mounting": [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    "lever_arm": [0.05, -0.02, 0.01],
    "gyroscope_noise_density": 1.7e-4,
    "accelerometer_noise_density": 2e-3,
    "gyroscope_random_walk": 2e-5,
    "accelerometer_random_walk": 3e-3,
}
LENSES = {
    "radtan": {"cam0.camera.preset": "euroc_cam0", "cam1.camera.preset": "euroc_cam1"},
    "equidistant": {"cam0.camera.preset": "tum_vi_cam0", "cam1.camera.preset": "tum_vi_cam1"},
    "none": {"camera.preset": "realsense_d435i_cam0", "cam1.camera.lever_arm": [0.1, 0.0, 0.0]},
    "unified": {
        "camera.preset": "euroc_cam0",
        "camera.model": "unified",
        "camera.xi": 0.7,
        "camera.distortion": [],
        "camera.distortion_model": "none",
    },
    "double_sphere": {
        "camera.preset": "tum_vi_cam0",
        "camera.model": "double_sphere",
        "camera.xi": -0.2,
        "camera.alpha": 0.55,
        "camera.distortion": [],
        "camera.distortion_model": "none",
    },
}
EXTRA = {"camera.time_offset": 0.004, "camera.body_axes": "flu", "camera.row_time": 1e-5}


@pytest.fixture(scope="module", params=LENSES)
def case(request, tmp_path_factory):
    """Write all files of a stereo rig; returns the rig and the folder."""
    parameters = load_rig(
        {"cameras": ["cam0", "cam1"], "scene.type": "aprilgrid", **EXTRA, **LENSES[request.param]}
    )
    imu = ImuValues(build(ImuParameters, {"preset": "perfect", **IMU}), 200.0, 9.81, "/imu0")
    topics = {"cam0": "/cam0/image_raw", "cam1": "/right"}
    rig = RigValues(imu, parameters.camera_parameters(), topics, parameters.scene)
    folder = tmp_path_factory.mktemp("files") / "configs"
    write_all(folder, imu, rig)
    return rig, folder


def points(rig, name):
    """Return points in the IMU's frame that the camera sees, and their pixels by our models."""
    camera = rig.cameras[name]
    rng = np.random.default_rng(1)
    local = rng.uniform([-0.6, -0.5, 1.0], [0.6, 0.5, 3.0], (50, 3))
    uv, valid = CameraModel(camera).project(local)
    assert valid.all()
    r_bc, p_bc = camera.pose()
    in_body = local @ r_bc.T + p_bc
    r_bi, p_bi = np.reshape(IMU["mounting"], (3, 3)), np.array(IMU["lever_arm"])
    return (in_body - p_bi) @ r_bi, uv


def compare(rig, name, t_ic, pixels):
    """Check the extrinsics (4, 4), camera to IMU, and the lens: points in the camera to pixels."""
    in_imu, uv = points(rig, name)
    t_ic = np.array(t_ic, dtype=float)
    local = (in_imu - t_ic[:3, 3]) @ t_ic[:3, :3]
    # OpenCV's float matrices and twelve digits in text.
    assert np.abs(pixels(local) - uv).max() < 2e-3


def opencv(k, d, fisheye=False):
    """Return the projection of OpenCV."""
    fx, fy, cx, cy = k
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    project = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    zero, d = np.zeros(3), np.array(d, dtype=float)

    def pixels(local):
        if fisheye:
            return project(local[:, None], zero, zero, matrix, d)[0][:, 0]
        return project(local, zero, zero, matrix, d)[0][:, 0]

    return pixels


def sphere(k, xi, alpha=None):
    """Return Mei's unified sphere, or the double sphere where alpha is given."""
    fx, fy, cx, cy = k

    def pixels(local):
        x, y, z = local.T
        d1 = np.sqrt(x * x + y * y + z * z)
        bottom = z + xi * d1
        if alpha is not None:
            z = xi * d1 + z
            bottom = alpha * np.sqrt(x * x + y * y + z * z) + (1.0 - alpha) * z
        return np.stack([fx * x / bottom + cx, fy * y / bottom + cy], axis=1)

    return pixels


def kalibr_lens(entry):
    k, d = entry["intrinsics"], entry["distortion_coeffs"]
    match entry["camera_model"], entry["distortion_model"]:
        case "pinhole", model:
            return opencv(k, d, model == "equidistant")
        case "omni", _:
            assert not any(d)
            return sphere(k[1:], k[0])
        case "ds", "none":
            return sphere(k[2:], k[0], k[1])


def test_kalibr_gets_the_rigs_poses_lenses_topics_and_target(case):
    rig, folder = case
    chain = yaml.safe_load((folder / "camchain.yaml").read_text())
    for name, topic in rig.topics.items():
        entry = chain[name]
        compare(rig, name, np.linalg.inv(entry["T_cam_imu"]), kalibr_lens(entry))
        assert (entry["rostopic"], entry["timeshift_cam_imu"]) == (topic, 0.004)
        # What kalibr's ConfigReader checks.
        assert all(isinstance(value, int) for value in entry["resolution"])
        assert all(isinstance(value, float) for value in entry["intrinsics"])
        assert len(entry["distortion_coeffs"]) == (0 if entry["camera_model"] == "ds" else 4)
    between = np.array(chain["cam1"]["T_cn_cnm1"]) @ np.array(chain["cam0"]["T_cam_imu"])
    np.testing.assert_allclose(between, chain["cam1"]["T_cam_imu"], atol=1e-9)
    target = yaml.safe_load((folder / "target.yaml").read_text())
    assert target == {
        "target_type": "aprilgrid",
        "tagCols": 6,
        "tagRows": 6,
        "tagSize": 0.088,
        "tagSpacing": 0.3,
    }


@pytest.mark.parametrize(
    "scene",
    [
        {"scene.type": "aprilgrid", "scene.tag_size": 1.0, "scene.tag_spacing": 1.0},
        {"scene.type": "checkerboard", "scene.square": 1.0},
    ],
)
def test_kalibr_takes_whole_numbers_for_real_ones(tmp_path, scene):
    """kalibr_common/ConfigReader.py refuses 0 and 1, which are no floats in YAML."""
    parameters = load_rig({"cameras": ["cam0"], "camera.preset": "euroc_cam0", **scene})
    imu = ImuValues(build(ImuParameters, {"preset": "perfect", **IMU}), 200.0, 9.81, "/imu0")
    rig = RigValues(
        imu, parameters.camera_parameters(), {"cam0": "/cam0/image_raw"}, parameters.scene
    )
    write_all(tmp_path / "configs", imu, rig)
    target = yaml.safe_load((tmp_path / "configs" / "target.yaml").read_text())
    lengths = [v for k, v in target.items() if k.endswith(("Size", "Spacing", "Meters"))]
    assert lengths == [1.0, 1.0]
    chain = yaml.safe_load((tmp_path / "configs" / "camchain.yaml").read_text())
    assert all(isinstance(v, float) for v in [*lengths, chain["cam0"]["timeshift_cam_imu"]])


def storage(path):
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert file.isOpened(), path
    return file


def numbers(node):
    return [node.at(k).real() for k in range(node.size())]


def skip_unless(path, rig, models):
    """Return True, having asserted that there is no file, if the stack does not know a lens."""
    if rig.fits(*models):
        return False
    assert not path.exists() or "fragment" in path.read_text()
    return True


def test_openvins_gets_the_rigs_poses_lenses_and_gravity(case):
    rig, folder = case
    path = folder / "kalibr_imucam_chain.yaml"
    if skip_unless(path, rig, ("radtan", "equidistant")):
        return
    chain = storage(path)
    for name, topic in rig.topics.items():
        entry = chain.getNode(name)
        matrix = entry.getNode("T_imu_cam")
        t_ic = [numbers(matrix.at(k)) for k in range(4)]
        model = entry.getNode("distortion_model").string()
        k, d = (numbers(entry.getNode(key)) for key in ("intrinsics", "distortion_coeffs"))
        compare(rig, name, t_ic, opencv(k, d, model == "equidistant"))
        assert entry.getNode("rostopic").string() == topic
        assert entry.getNode("timeshift_cam_imu").real() == 0.004
    config = storage(folder / "estimator_config.yaml")
    assert config.getNode("init_imu_thresh").real() == 0.5
    assert config.getNode("max_cameras").real() == 2
    stereo = config.getNode("use_stereo")  # OpenVINS takes both; what it is depends on OpenCV
    assert stereo.real() == 1 if stereo.isInt() else stereo.string() == "true"
    assert config.getNode("gravity_mag").real() == 9.81
    for key in ("relative_config_imu", "relative_config_imucam"):
        assert (folder / config.getNode(key).string()).exists()


def camodocal(document):
    values = document.getNode("projection_parameters")
    d = document.getNode("distortion_parameters")
    match document.getNode("model_type").string():
        case "PINHOLE":
            k = [values.getNode(key).real() for key in ("fx", "fy", "cx", "cy")]
            return opencv(k, [d.getNode(key).real() for key in ("k1", "k2", "p1", "p2")])
        case "KANNALA_BRANDT":
            k = [values.getNode(key).real() for key in ("mu", "mv", "u0", "v0")]
            return opencv(k, [values.getNode(f"k{j}").real() for j in (2, 3, 4, 5)], True)
        case "MEI":
            k = [values.getNode(key).real() for key in ("gamma1", "gamma2", "u0", "v0")]
            return sphere(k, document.getNode("mirror_parameters").getNode("xi").real())


def test_vins_mono_and_fusion_get_the_rigs_poses_lenses_and_topics(case):
    rig, folder = case
    models = ("radtan", "equidistant", "unified")
    if skip_unless(folder / "vins_mono.yaml", rig, models):
        return
    mono = storage(folder / "vins_mono.yaml")
    t_ic = np.eye(4)
    t_ic[:3, :3] = mono.getNode("extrinsicRotation").mat()
    t_ic[:3, 3:] = mono.getNode("extrinsicTranslation").mat()
    compare(rig, "cam0", t_ic, camodocal(mono))
    assert mono.getNode("image_topic").string() == "/cam0/image_raw"
    assert mono.getNode("imu_topic").string() == "/imu0"
    assert mono.getNode("td").real() == 0.004
    assert mono.getNode("acc_n").real() == pytest.approx(2e-3 * np.sqrt(200.0))
    assert mono.getNode("rolling_shutter").real() == 1
    height = rig.cameras["cam0"].height
    assert mono.getNode("rolling_shutter_tr").real() == pytest.approx(1e-5 * height)
    fusion = storage(folder / "vins_fusion.yaml")
    assert fusion.getNode("imu").real() == 1
    assert fusion.getNode("num_of_cam").real() == 2
    for k, (name, topic) in enumerate(rig.topics.items()):
        lens = storage(folder / fusion.getNode(f"cam{k}_calib").string())
        compare(rig, name, fusion.getNode(f"body_T_cam{k}").mat(), camodocal(lens))
        assert fusion.getNode(f"image{k}_topic").string() == topic


def test_orb_slam3_gets_the_rigs_poses_lenses_and_noise(case):
    rig, folder = case
    path = folder / "orb_slam3_stereo_inertial.yaml"
    if skip_unless(path, rig, ("radtan", "equidistant")):
        return
    for name in ("orb_slam3_mono_inertial.yaml", "orb_slam3_stereo_inertial.yaml"):
        document = storage(folder / name)
        t_ic = document.getNode("IMU.T_b_c1").mat()
        compare(rig, "cam0", t_ic, orb_lens(document, 1))
        for key in ("Camera.width", "Camera.height", "Camera.fps", "Camera.RGB"):
            assert document.getNode(key).isInt()
        for key in ("IMU.NoiseGyro", "IMU.Frequency", "ORBextractor.scaleFactor"):
            assert document.getNode(key).isReal()
        assert document.getNode("IMU.NoiseAcc").real() == pytest.approx(2e-3)
        assert document.getNode("File.version").string() == "1.0"
    # The TUM VI presets' fisheyes differ; it would read the first one's distortion for both.
    warned = "reads a second fisheye's distortion from Camera1.k1" in (folder / name).read_text()
    assert warned == rig.fits("equidistant")
    second = t_ic.astype(float) @ document.getNode("Stereo.T_c1_c2").mat()
    compare(rig, "cam1", second, orb_lens(document, 2))


def orb_lens(document, number):
    def read(*keys):
        nodes = [document.getNode(f"Camera{number}.{key}") for key in keys]
        assert all(node.isReal() for node in nodes)
        return [node.real() for node in nodes]

    k = read("fx", "fy", "cx", "cy")
    if document.getNode("Camera.type").string() == "PinHole":
        return opencv(k, read("k1", "k2", "p1", "p2"))
    return opencv(k, read("k1", "k2", "k3", "k4"), True)


def test_basalt_gets_the_rigs_poses_lenses_and_time_offset(case):
    rig, folder = case
    calibration = json.loads((folder / "basalt_calibration.json").read_text())["value0"]
    assert calibration["cam_time_offset_ns"] == 4_000_000
    for k, (name, camera) in enumerate(rig.cameras.items()):
        assert calibration["resolution"][k] == [camera.width, camera.height]
        pose, lens = calibration["T_imu_cam"][k], calibration["intrinsics"][k]
        x, y, z, w = (pose[key] for key in ("qx", "qy", "qz", "qw"))
        t_ic = np.eye(4)
        t_ic[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        t_ic[:3, 3] = [pose[key] for key in ("px", "py", "pz")]
        compare(rig, name, t_ic, basalt_lens(lens["camera_type"], lens["intrinsics"]))
    assert any("needs a Basalt" in note for note in calibration["comment"]) == (
        lens["camera_type"] == "pinhole-radtan8"
    )


def basalt_lens(kind, v):
    k = [v[key] for key in ("fx", "fy", "cx", "cy")]
    match kind:
        case "pinhole":
            return opencv(k, np.zeros(4))
        case "pinhole-radtan8":
            return opencv(k, [v[key] for key in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")])
        case "kb4":
            return opencv(k, [v[key] for key in ("k1", "k2", "k3", "k4")], True)
        case "ds":
            return sphere(k, v["xi"], v["alpha"])
        case "ucm":  # basalt/camera/unified_camera.hpp: x / (alpha d + (1 - alpha) z)
            a = v["alpha"]
            scaled = [k[0] / (1.0 - a), k[1] / (1.0 - a), k[2], k[3]]
            return sphere(scaled, a / (1.0 - a))


def keys_read():
    table = yaml.safe_load((DATA / "stack_keys.yaml").read_text(encoding="utf-8"))
    return {entry["file"]: entry for entry in table["stacks"]}


@pytest.mark.parametrize("name", keys_read())
def test_every_key_that_a_stack_reads_is_there(case, name):
    """The keys were looked up in the stacks' sources, at the commits that the table names."""
    rig, folder = case
    entry, path = keys_read()[name], folder / name
    if not path.exists() or "fragment" in path.read_text():
        assert not rig.fits("radtan"), f"{name}: every stack knows this lens"
        return
    lens = (
        "equidistant" if rig.fits("equidistant") else "unified" if rig.fits("unified") else "radtan"
    )
    content = json.loads(path.read_text()) if name.endswith(".json") else storage_or_yaml(path)
    for key in f"{entry.get('keys', '')} {entry.get(lens, '')}".split():
        assert has_key(content, key.split(".")), f"{name}: {key}"
    for key in f"{entry.get('flat', '')} {entry.get(f'{lens}_flat', '')}".split():
        assert has_key(content, [key]), f"{name}: {key}"


def storage_or_yaml(path):
    """Return what OpenCV reads of a file where the stack uses OpenCV, else what PyYAML does."""
    if path.read_text().startswith("%YAML:1.0"):
        return storage(path)
    return yaml.safe_load(path.read_text())


def has_key(content, path):
    for name in path:
        if isinstance(content, dict):
            content = content.get(name)
            if content is None:
                return False
        else:
            content = content.getNode(name)
            if content.empty():
                return False
    return True


def test_no_choice_of_a_camera_is_an_error_that_a_format_misses():
    """Only numbers are said with their values."""
    choices = {"camera.response": "linear", "camera.depth": True, "camera.mip_levels": "trilinear"}
    rig = load_rig({"cameras": ["cam0"], "camera.preset": "euroc_cam0", **choices})
    imu = ImuValues(build(ImuParameters, {"preset": "perfect", **IMU}), 200.0, 9.81, "/imu0")
    values = RigValues(imu, rig.camera_parameters(), {"cam0": "/image"}, rig.scene)
    assert list(values.remarks()) == []


def test_what_a_format_cannot_express_of_a_camera_is_said_at_its_top(tmp_path):
    """The shutter and the offsets of a T265 whose rows are read one after the other."""
    presets = {f"cam{k}.camera.preset": f"realsense_t265_cam{k}" for k in (0, 1)}
    errors = {
        "camera.row_time": 2e-5,
        "camera.jitter": 1e-4,
        "camera.vignetting": 0.3,
        "cam1.camera.time_offset": 0.004,
    }
    rig = load_rig({"cameras": ["cam0", "cam1"], **presets, **errors})
    imu = ImuValues(build(ImuParameters, {"preset": "perfect", **IMU}), 200.0, 9.81, "/imu0")
    values = RigValues(
        imu, rig.camera_parameters(), dict.fromkeys(rig.cameras, "/image"), rig.scene
    )
    write_all(tmp_path / "configs", imu, values)
    rolling, jitter = "row_time = 2.0e-05 s (rolling shutter)", "jitter = 0.0001 s"
    dark, second = "vignetting = 0.3", "time_offset = 0.004 s"
    expected = {  # names of terms that are missing, and how many cameras have a line
        "camchain.yaml": ([dark, jitter], [second, "row_time"], 2),
        "kalibr_imucam_chain.yaml": ([rolling, jitter, dark], [second], 2),
        "estimator_config.yaml": ([rolling, jitter, dark], [second], 2),
        "orb_slam3_mono_inertial.yaml": ([rolling, jitter, "time_offset = 0.0056"], [second], 1),
        "orb_slam3_stereo_inertial.yaml": ([rolling, jitter, second], [], 2),
        "basalt_calibration.json": ([rolling, jitter], [dark, second], 2),
        "vins_mono.yaml": ([jitter, dark], ["row_time", second], 1),
        "vins_fusion.yaml": ([rolling, jitter, dark], [second], 2),
    }
    for name, (missing, unsaid, cameras) in expected.items():
        text = (tmp_path / "configs" / name).read_text()
        text = " ".join(text.replace("\n#", " ").split())
        assert text.count(": simulated, but not expressible in this format:") == cameras, name
        assert "expresses everything" not in text, (
            name
        )  # what is said of the IMU is said of it alone
        assert all(term in text for term in missing), name
        assert not any(term in text for term in unsaid), name
    for name in ("camchain.yaml", "vins_mono.yaml", "orb_slam3_stereo_inertial.yaml"):
        assert "has one for all cameras" not in (tmp_path / "configs" / name).read_text(), name


@pytest.mark.parametrize("offsets", [(0.0, 0.004), (0.004, 0.0), (0.004, 0.004)])
def test_stacks_with_one_time_shift_name_the_cameras_with_another(tmp_path, offsets):
    """A camera without any offset is named, too, if the shift of the first one is used for it."""
    cameras = {f"cam{k}.camera.time_offset": offset for k, offset in enumerate(offsets)}
    rig = load_rig({"cameras": ["cam0", "cam1"], "camera.preset": "euroc_cam0", **cameras})
    imu = ImuValues(build(ImuParameters, {"preset": "perfect"}), 200.0, 9.81, "/imu0")
    values = RigValues(
        imu, rig.camera_parameters(), dict.fromkeys(rig.cameras, "/image"), rig.scene
    )
    write_all(tmp_path / "configs", imu, values)
    for name, stack in (
        ("kalibr_imucam_chain.yaml", "OpenVINS"),
        ("vins_fusion.yaml", "VINS-Fusion"),
        ("basalt_calibration.json", "Basalt"),
    ):
        text = " ".join((tmp_path / "configs" / name).read_text().replace("\n#", " ").split())
        line = (
            f"cam1: its time shift is {offsets[1]:g} s, but {stack} has one for all cameras: "
            f"that of cam0, {offsets[0]:g} s"
        )
        assert (line in text) == (offsets[0] != offsets[1]), name
