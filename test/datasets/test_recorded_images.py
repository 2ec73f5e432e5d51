# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images of a bag as files: those that generate writes at once, and what cameras of others send."""

import json
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import yaml
from ros_messages import stamp_ns
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from small_stereo import small_stereo

from imu_sim_ros.bags.cameras import cameras_of_topics
from imu_sim_ros.commands import convert_bag, dead_reckon, generate
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.datasets.recorded_bag import pixels
from imu_sim_ros.datasets.transforms import transform_to_root

FLIGHT = small_stereo("0.6s", {"camera.time_offset": "0.005", "cam1.camera.images": "both"})


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    """Return the folder that generate writes, and a place for bags."""
    place = tmp_path_factory.mktemp("made")
    assert generate.main(["-o", str(place / "mav0"), "--format", "euroc", *FLIGHT]) == 0
    return place


def contents(folder):
    """Return all images of a folder by their names in it."""
    return {
        str(path.relative_to(folder)): cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        for path in folder.rglob("*.png")
    }


@pytest.mark.parametrize("bag", ["flight.bag", "flight.mcap", "flight"])
def test_the_images_of_a_bag_are_those_of_the_folder(sequence, tmp_path, capsys, bag):
    storage = ["--storage", "sqlite3"] if bag == "flight" else []
    assert generate.main(["-o", str(tmp_path / bag), *FLIGHT, *storage]) == 0
    arguments = [str(tmp_path / bag), "-o", str(tmp_path / "out"), "--format", "euroc", "--json"]
    assert convert_bag.main(arguments) == 0
    counts = json.loads(capsys.readouterr().out)["messages"]
    expected, actual = contents(sequence / "mav0"), contents(tmp_path / "out")
    assert actual.keys() == expected.keys()
    assert all(np.array_equal(actual[name], expected[name]) for name in expected)
    assert counts["/cam1/depth/image_raw"] == counts["/cam1/image_raw"] > 5
    for name in ("cam0", "cam1"):
        table = f"{name}/data.csv"
        assert (tmp_path / "out" / table).read_text() == (sequence / "mav0" / table).read_text()
        written, true = (
            yaml.safe_load((folder / name / "sensor.yaml").read_text())
            for folder in (tmp_path / "out", sequence / "mav0")
        )
        for key in ("resolution", "intrinsics", "distortion_model", "distortion_coefficients"):
            assert written[key] == true[key]
        assert "T_BS" not in written  # the bag has no /tf_static


def test_the_folder_of_kalibr_bagcreater_and_chosen_topics(sequence, tmp_path, capsys):
    assert generate.main(["-o", str(tmp_path / "flight.mcap"), *FLIGHT]) == 0
    arguments = [str(tmp_path / "flight.mcap"), "-o", str(tmp_path / "out"), "--format", "csv"]
    topics = "imu/data_raw,ground_truth/odom,cam1/image_raw/compressed"
    assert convert_bag.main([*arguments, "--topics", topics, "--quiet"]) == 0
    names = sorted(path.name for path in (tmp_path / "out" / "cam1").iterdir())
    assert names == sorted(path.name for path in (sequence / "mav0" / "cam1" / "data").iterdir())
    assert not (tmp_path / "out" / "cam0").exists()
    # One table of readings has no place for images, and needs no OpenCV.
    assert convert_bag.main([arguments[0], "-o", str(tmp_path / "a.csv"), "--quiet"]) == 0
    # What has images dead-reckons as what has none.
    assert dead_reckon.main([arguments[0], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["samples"] == 120


def image(encoding, array, step=None, big=False):
    """Return a sensor_msgs/Image as rosbags gives it."""
    data = np.ascontiguousarray(array).view(np.uint8).reshape(len(array), -1)
    padded = np.zeros((len(array), step or data.shape[1]), np.uint8)
    padded[:, : data.shape[1]] = data
    return SimpleNamespace(
        encoding=encoding,
        height=array.shape[0],
        width=array.shape[1],
        step=padded.shape[1],
        is_bigendian=big,
        data=padded.ravel(),
    )


def test_pixels_of_every_encoding():
    rng = np.random.default_rng(1)
    grey, deep = rng.integers(0, 256, (4, 6), np.uint8), rng.integers(0, 65536, (4, 6), np.uint16)
    colour = rng.integers(0, 256, (4, 6, 4), np.uint8)
    assert np.array_equal(pixels("/a", image("mono8", grey, step=9)), grey)
    assert np.array_equal(pixels("/a", image("bayer_rggb8", grey)), grey)
    assert np.array_equal(pixels("/a", image("mono16", deep)), deep)
    assert np.array_equal(pixels("/a", image("16UC1", deep.astype(">u2"), big=True)), deep)
    assert np.array_equal(pixels("/a", image("rgb8", colour[..., :3])), colour[..., :3])
    assert np.array_equal(pixels("/a", image("bgr8", colour[..., :3])), colour[..., 2::-1])
    assert np.array_equal(pixels("/a", image("bgra8", colour)), colour[..., 2::-1])
    assert np.array_equal(pixels("/a", image("rgba8", colour)), colour[..., :3])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"encoding": "yuv422"}, "encoding 'yuv422': must be one of mono8"),
        ({"height": 5}, "an image of 6 x 5 pixels, mono8, step 6, in 24 bytes"),
        ({"step": 5}, "step 5, in 24 bytes"),
        ({"width": 0}, "an image of 0 x 4 pixels"),
    ],
)
def test_an_image_that_contradicts_itself_is_one_line(changes, message):
    bad = image("mono8", np.zeros((4, 6), np.uint8))
    vars(bad).update(changes)
    with pytest.raises(InputError, match=message):
        pixels("/a", bad)


def write_other_cameras(path, ros1):
    """Write readings, and images of two cameras that are named as other drivers name them."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    types = store.types
    seq = {"seq": 0} if ros1 else {}

    def header(t_ns, frame):
        stamp = types["builtin_interfaces/msg/Time"](sec=t_ns // 10**9, nanosec=t_ns % 10**9)
        return types["std_msgs/msg/Header"](**seq, stamp=stamp, frame_id=frame)

    def imu(t_ns):
        vector, q = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
        none, up = np.zeros(9), vector(x=0.0, y=0.0, z=9.81)
        still = vector(x=0.0, y=0.0, z=0.0)
        level = q(x=0.0, y=0.0, z=0.0, w=1.0)
        kind = types["sensor_msgs/msg/Imu"]
        return kind(header(t_ns, "imu"), level, none, still, none, up, none)

    grey = np.arange(24, dtype=np.uint8).reshape(4, 6)
    jpeg = cv2.imencode(".jpg", np.full((8, 8, 3), (200, 100, 50), np.uint8))[1].ravel()
    raw = types["sensor_msgs/msg/Image"]
    small = types["sensor_msgs/msg/CompressedImage"]
    messages = [("/imu", imu(10**9 + k * 5_000_000)) for k in range(20)]
    for k in range(2):
        t_ns = 10**9 + k * 50_000_000
        head = header(t_ns, "left_eye")
        messages.append(("/left/image_raw", raw(head, 4, 6, "mono8", 0, 6, grey.ravel() + k)))
        messages.append(("/right/image/compressed", small(header(t_ns, "r"), "jpeg", jpeg)))
    writer = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP)
    encode = store.serialize_ros1 if ros1 else store.serialize_cdr
    with writer:
        topics = {}
        for name, message in messages:
            if name not in topics:
                topics[name] = writer.add_connection(name, message.__msgtype__, typestore=store)
            t_ns = stamp_ns(message)
            writer.write(topics[name], t_ns + 7, encode(message, message.__msgtype__))


@pytest.mark.parametrize("ros1", [True, False])
def test_cameras_of_other_drivers_are_numbered(tmp_path, capsys, ros1):
    path = tmp_path / ("a.bag" if ros1 else "a")
    write_other_cameras(path, ros1)
    arguments = [str(path), "-o", str(tmp_path / "out"), "--format", "euroc", "--json"]
    assert convert_bag.main(arguments) == 0, capsys.readouterr().err
    images = contents(tmp_path / "out")
    assert sorted(images) == sorted(
        f"cam{c}/data/{10**9 + k * 50_000_000:019d}.png" for c in (0, 1) for k in (0, 1)
    )
    grey = np.arange(24, dtype=np.uint8).reshape(4, 6)
    assert np.array_equal(images["cam0/data/0000000001050000000.png"], grey + 1)
    mean = images["cam1/data/0000000001000000000.png"].mean(axis=(0, 1))
    assert np.abs(mean - (200, 100, 50)).max() < 4.0  # JPEG is lossy
    sensor = yaml.safe_load((tmp_path / "out" / "cam0" / "sensor.yaml").read_text())
    assert sensor == {
        "sensor_type": "camera",
        "comment": f"converted from {path.name} by imu_sim_ros",
        "rate_hz": 20,
    }


def test_topics_of_one_camera_are_found():
    def topic(name, kind):
        return SimpleNamespace(name=name, type=f"sensor_msgs/msg/{kind}")

    names = {
        "/front/cam1/image_raw/compressed": "CompressedImage",
        "/front/cam1/image_raw": "Image",
        "/front/cam1/depth/image_raw": "Image",
        "/cam0/image_raw/compressed": "CompressedImage",
        "/front/cam1/camera_info": "CameraInfo",
    }
    cameras = cameras_of_topics([topic(*item) for item in names.items()])
    assert [(c.name, c.images.name, c.depth and c.depth.name) for c in cameras] == [
        ("cam0", "/cam0/image_raw/compressed", None),
        ("cam1", "/front/cam1/image_raw", "/front/cam1/depth/image_raw"),
    ]


def test_places_are_chained_to_the_root_and_no_loop_is_endless():
    turn = np.array([[0.0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])
    step = np.eye(4)
    step[:3, 3] = (1.0, 0.0, 0.0)
    chained = transform_to_root({"eye": ("head", step), "head": ("body", turn)}, "eye")
    np.testing.assert_allclose(chained, turn @ step)
    assert transform_to_root({}, "eye") is None
    assert transform_to_root({"a": ("b", step), "b": ("a", step)}, "a") is not None
