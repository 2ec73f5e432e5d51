# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images of a dataset's folder in bags: the full circle, other people's folders, broken ones."""

import json
import shutil

import cv2
import numpy as np
import pytest
import yaml
from ros_messages import stamp_ns
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from small_stereo import small_stereo

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU
from imu_sim_ros.bags.read import imu_blocks, open_bag
from imu_sim_ros.bags.writer import BagOptions, Block
from imu_sim_ros.commands import convert_bag, generate

FLIGHT = small_stereo("0.6s", {})
STAMPS = [10**9, 1_050_000_000, 1_100_000_000]


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    """Return the folder that generate writes."""
    folder = tmp_path_factory.mktemp("made") / "mav0"
    assert generate.main(["-o", str(folder), "--format", "euroc", *FLIGHT]) == 0
    return folder


def run(*arguments):
    return convert_bag.main([str(word) for word in arguments])


def decoded(path):
    """Return all messages by topic, as rosbags reads them."""
    messages = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, t_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            messages.setdefault(connection.topic, []).append((t_ns, message))
    return messages


def pngs(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.png")}


@pytest.mark.parametrize(
    ("name", "images"), [("a.bag", "raw"), ("a.mcap", "compressed"), ("a", "both")]
)
def test_the_images_of_a_folder_come_back_from_a_bag(sequence, tmp_path, name, images):
    storage = ["--storage", "sqlite3"] if name == "a" else []
    assert run(sequence, "-o", tmp_path / name, "--images", images, "--quiet", *storage) == 0
    assert run(tmp_path / name, "-o", tmp_path / "out", "--format", "euroc", "--quiet") == 0
    assert pngs(tmp_path / "out") == pngs(sequence)
    for camera in ("cam0", "cam1"):
        table = f"{camera}/data.csv"
        assert (tmp_path / "out" / table).read_text() == (sequence / table).read_text()
        written, true = (
            yaml.safe_load((folder / camera / "sensor.yaml").read_text())
            for folder in (tmp_path / "out", sequence)
        )
        pose, expected = written.pop("T_BS")["data"], true.pop("T_BS")["data"]
        np.testing.assert_allclose(pose, expected, atol=1e-11)  # by way of a quaternion
        assert written.pop("comment") != true.pop("comment")
        assert written == true


@pytest.mark.parametrize("name", ["a.bag", "a.mcap"])
def test_others_read_pixels_models_and_places(sequence, tmp_path, name):
    assert run(sequence, "-o", tmp_path / name, "--images", "both", "--quiet") == 0
    messages = decoded(tmp_path / name)
    for camera, pixels in (("cam0", "mono8"), ("cam1", "rgb8")):
        rows = (sequence / camera / "data.csv").read_text().splitlines()[1:]
        stamps = [int(row.split(",")[0]) for row in rows]
        for topic in ("image_raw", "image_raw/compressed", "camera_info"):
            assert [t_ns for t_ns, _ in messages[f"/{camera}/{topic}"]] == stamps
        for (_, raw), (_, small), t_ns in zip(
            messages[f"/{camera}/image_raw"],
            messages[f"/{camera}/image_raw/compressed"],
            stamps,
            strict=True,
        ):
            path = sequence / camera / "data" / f"{t_ns:019d}.png"
            image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            expected = image if image.ndim == 2 else image[..., ::-1]
            assert (raw.height, raw.width, raw.encoding) == (60, 94, pixels)
            assert raw.header.frame_id == f"{camera}_optical_frame"
            assert stamp_ns(raw) == t_ns
            assert np.array_equal(raw.data, expected.ravel())
            assert small.data.tobytes() == path.read_bytes()
            assert small.format == f"{pixels}; png compressed {'bgr8' * (pixels == 'rgb8')}"
        sensor = yaml.safe_load((sequence / camera / "sensor.yaml").read_text())
        info = messages[f"/{camera}/camera_info"][0][1]
        k, d = getattr(info, "k", getattr(info, "K", None)), getattr(info, "d", None)
        d = info.D if d is None else d
        assert [k[0], k[4], k[2], k[5]] == sensor["intrinsics"]
        assert d.tolist() == [*sensor["distortion_coefficients"], 0.0]
        assert (info.distortion_model, info.width, info.height) == ("plumb_bob", 94, 60)
    places = {t.child_frame_id: t for t in messages["/tf_static"][0][1].transforms}
    assert places.keys() == {"cam0_optical_frame", "cam1_optical_frame"}
    pose = np.reshape(
        yaml.safe_load((sequence / "cam1" / "sensor.yaml").read_text())["T_BS"]["data"], (4, 4)
    )
    transform = places["cam1_optical_frame"]
    assert transform.header.frame_id == "base_link"
    shift = transform.transform.translation
    np.testing.assert_allclose([shift.x, shift.y, shift.z], pose[:3, 3], atol=1e-12)
    depth = messages["/cam1/depth/image_raw"][0][1]
    assert depth.encoding == "16UC1"


def test_readings_between_images_come_in_blocks_that_have_a_rate(sequence, tmp_path):
    assert run(sequence, "-o", tmp_path / "a.mcap", "--quiet") == 0
    assert [len(block.t_ns) for block in imu_blocks(tmp_path / "a.mcap")] == [120]


def test_a_folder_into_another_folder(sequence, tmp_path):
    assert run(sequence, "-o", tmp_path / "e", "--format", "euroc", "--quiet") == 0
    assert pngs(tmp_path / "e") == pngs(sequence)
    sensor = "cam1/sensor.yaml"
    assert (tmp_path / "e" / sensor).read_text() == (sequence / sensor).read_text()
    assert run(sequence, "-o", tmp_path / "k", "--format", "csv", "--quiet") == 0
    assert {
        path.replace("data/", ""): data for path, data in pngs(sequence / "cam0").items()
    } == pngs(tmp_path / "k" / "cam0")
    # And kalibr_bagcreater's folder into a bag: stamps are the names.
    assert run(tmp_path / "k", "-o", tmp_path / "k.mcap", "--quiet") == 0
    messages = decoded(tmp_path / "k.mcap")
    stamps = sorted(int(path.stem) for path in (sequence / "cam0" / "data").iterdir())
    assert [t_ns for t_ns, _ in messages["/cam0/image_raw"]] == stamps
    assert "/cam0/camera_info" not in messages


def test_images_and_topics_of_a_folder_can_be_chosen_and_renamed(sequence, tmp_path, capsys):
    arguments = [sequence, "-o", tmp_path / "a.mcap", "--images", "none", "--json"]
    assert run(*arguments) == 0
    assert json.loads(capsys.readouterr().out)["messages"].keys() == {
        "/imu/data_raw",
        "/ground_truth/odom",
        "/ground_truth/gyroscope_bias",
        "/ground_truth/accelerometer_bias",
    }
    assert run(tmp_path / "a.mcap", "-o", tmp_path / "b.mcap", "--images", "raw") == 2
    assert "images raw: applies to folders only" in capsys.readouterr().err
    assert run(sequence, "-o", tmp_path / "c", "--format", "euroc", "--images", "raw") == 2
    assert "images raw: does not apply to euroc" in capsys.readouterr().err
    names = ["--topic", "cam0/image_raw=/left", "--topic", "cam0/camera_info=/left_info"]
    assert run(sequence, "-o", tmp_path / "d.mcap", "--quiet", *names) == 0
    assert {"/left", "/left_info", "/cam1/image_raw"} <= decoded(tmp_path / "d.mcap").keys()


@pytest.fixture
def tum_vi(tmp_path):
    """Return a folder with the form and the 16-bit images of a TUM VI sequence."""
    rng = np.random.default_rng(2)
    root = tmp_path / "room1"
    for folder in ("mav0/cam0/data", "mav0/imu0", "mav0/mocap0", "dso"):
        (root / folder).mkdir(parents=True)
    images = rng.integers(0, 65536, (len(STAMPS), 6, 8), np.uint16)
    rows = ["#timestamp [ns],filename"]
    for t_ns, image in zip(STAMPS, images, strict=True):
        cv2.imwrite(str(root / "mav0" / "cam0" / "data" / f"{t_ns}.png"), image)
        rows.append(f"{t_ns},{t_ns}.png")
    (root / "mav0" / "cam0" / "data.csv").write_text("\r\n".join(rows) + "\r\n")
    readings = [f"{10**9 + k * 5_000_000},0,0,0,0,0,9.81" for k in range(30)]
    (root / "mav0" / "imu0" / "data.csv").write_text("\n".join(["#t,w,a", *readings]))
    poses = [f"{10**9 + k * 8_000_000},{k},0,1,1,0,0,0" for k in range(10)]
    (root / "mav0" / "mocap0" / "data.csv").write_text("\n".join(["#t,p,q", *poses]))
    t_ci = [[0.0, 1, 0, 0.1], [0, 0, 1, 0.2], [1, 0, 0, 0.3], [0, 0, 0, 1]]
    chain = {
        "cam0": {
            "camera_model": "pinhole",
            "intrinsics": [190.9, 190.8, 254.9, 256.8],
            "distortion_model": "equidistant",
            "distortion_coeffs": [0.1, 0.2, 0.3, 0.4],
            "resolution": [8, 6],
            "T_cam_imu": t_ci,
            "rostopic": "/cam0/image_raw",
        }
    }
    (root / "dso" / "camchain.yaml").write_text(yaml.safe_dump(chain))
    return root, images


@pytest.mark.parametrize("subfolder", ["", "mav0"])
def test_a_sequence_of_tum_vi(tum_vi, tmp_path, subfolder):
    root, images = tum_vi
    assert run(root / subfolder, "-o", tmp_path / "a.bag", "--images", "both", "--quiet") == 0
    messages = decoded(tmp_path / "a.bag")
    for (_, raw), image in zip(messages["/cam0/image_raw"], images, strict=True):
        assert raw.encoding == "mono16"
        assert np.array_equal(raw.data.view("<u2"), image.ravel())
    assert messages["/cam0/image_raw/compressed"][0][1].format == "mono16; png compressed "
    info = messages["/cam0/camera_info"][0][1]
    assert (info.distortion_model, info.D.tolist()) == ("equidistant", [0.1, 0.2, 0.3, 0.4])
    shift = messages["/tf_static"][0][1].transforms[0].transform.translation
    np.testing.assert_allclose([shift.x, shift.y, shift.z], [-0.3, -0.1, -0.2], atol=1e-12)
    poses = [message.pose.position.x for _, message in messages["/ground_truth/pose"]]
    assert poses == list(range(10))
    assert len(messages["/imu/data_raw"]) == 30


def broken(root, table=None, sensor=None, image=None):
    """Change a folder: its table of images, a sensor.yaml, the bytes of the first image."""
    camera = root / "mav0" / "cam0"
    if table is not None:
        (camera / "data.csv").write_text(table)
    if sensor is not None:
        (camera / "sensor.yaml").write_text(yaml.safe_dump(sensor))
    if image is not None:
        image_path = camera / "data" / f"{STAMPS[0]}.png"
        image_path.write_bytes(image(image_path.read_bytes()))


GOOD = f"{STAMPS[0]},{STAMPS[0]}.png\n"
SENSOR = {"camera_model": "pinhole", "resolution": [8, 6], "intrinsics": [9.0, 9.0, 4.0, 3.0]}
SWAPPED = [0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        (
            {"table": f"{GOOD}5,{STAMPS[1]}.png\nx,a\n{STAMPS[1]}\n{STAMPS[2]},gone.png\n"},
            [
                "cam0/data.csv: line 2: the stamp is 0.999999995 s before that of an earlier line",
                "line 3: 'x' is not a stamp in nanoseconds",
                "line 4: 1 columns; expected nanoseconds and a file name",
                "line 5: the image 'gone.png' is not in data/",
            ],
        ),
        (
            {"table": f"{GOOD}{STAMPS[1]},../../imu0/data.csv\n"},
            ["line 2: the image '../../imu0/data.csv' is not in data/"],
        ),
        (
            {"image": lambda data: data[:-20]},
            ["1000000000.png: a PNG that is cut off after"],
        ),
        (
            {"image": lambda data: b"not an image"},
            ["1000000000.png: 12 bytes that are no image"],
        ),
        (
            {"image": lambda data: data[:8] + data[-12:]},
            ["1000000000.png: a PNG that is damaged: its header states no pixels"],
        ),
        (
            {"image": lambda data: b""},
            ["1000000000.png: 0 bytes that are no image; PNG, JPEG, BMP"],
        ),
        (
            {"sensor": {**SENSOR, "intrinsics": [1, 2, 3], "resolution": [8, -6]}},
            [
                "cam0/sensor.yaml: intrinsics = [1, 2, 3]: must be 4 finite numbers",
                "cam0/sensor.yaml: resolution = -6.0: must be a whole number of pixels from 1",
            ],
        ),
        (
            {"sensor": {**SENSOR, "T_BS": {"rows": 4, "cols": 4, "data": SWAPPED}}},
            ["sensor.yaml: T_BS: must be a rigid motion: a rotation, and 0 0 0 1 below"],
        ),
        (
            {"sensor": {**SENSOR, "T_BS": [1.0, 2.0]}},
            ["sensor.yaml: T_BS = [1.0, 2.0]: must be 16 or 12 finite numbers"],
        ),
        (
            {"sensor": {**SENSOR, "camera_model": "eye"}},
            ["camera_model = 'eye': this projection is none of the models here: pinhole, unified"],
        ),
        ({"sensor": [1, 2]}, ["sensor.yaml: not a camera's file"]),
        (
            {"sensor": {**{k: v for k, v in SENSOR.items() if k != "resolution"}, "resolutin": 1}},
            ["resolutin: unknown key; did you mean resolution?", "resolution = missing"],
        ),
    ],
)
@pytest.mark.parametrize("to", ["a.mcap", "out"])
def test_a_broken_folder_is_a_line_for_each_problem(tum_vi, tmp_path, capsys, changes, lines, to):
    broken(tum_vi[0], **changes)
    form = ["--format", "euroc"] if to == "out" else []
    assert run(tum_vi[0], "-o", tmp_path / to, *form) == 2
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == len(lines), errors
    for line, expected in zip(errors, lines, strict=True):
        assert expected in line
    assert not (tmp_path / to).exists()


def test_bad_rows_of_a_table_are_skipped_when_asked(tum_vi, tmp_path, capsys):
    broken(tum_vi[0], table=f"{GOOD}x,a\n{STAMPS[2]},{STAMPS[2]}.png\n")
    assert run(tum_vi[0], "-o", tmp_path / "a.mcap", "--skip-bad-rows", "--quiet") == 0
    assert "1 bad rows skipped" in capsys.readouterr().err
    stamps = [t_ns for t_ns, _ in decoded(tmp_path / "a.mcap")["/cam0/image_raw"]]
    assert stamps == [STAMPS[0], STAMPS[2]]


def test_other_files_than_png(tum_vi, tmp_path):
    data = tum_vi[0] / "mav0" / "cam0" / "data"
    jpeg = cv2.imencode(".jpg", np.full((6, 8), 77, np.uint8))[1].tobytes()
    (data / f"{STAMPS[0]}.png").write_bytes(jpeg)
    assert run(tum_vi[0], "-o", tmp_path / "a.mcap", "--images", "both", "--quiet") == 0
    messages = decoded(tmp_path / "a.mcap")
    assert messages["/cam0/image_raw"][0][1].encoding == "mono8"
    assert np.abs(messages["/cam0/image_raw"][0][1].data.astype(int) - 77).max() < 4
    small = messages["/cam0/image_raw/compressed"][0][1]
    assert (small.format, small.data.tobytes()) == ("mono8; jpeg compressed ", jpeg)
    # In a folder all images are PNG, whatever they were.
    shutil.rmtree(tum_vi[0] / "dso")
    assert run(tum_vi[0], "-o", tmp_path / "out", "--format", "euroc", "--quiet") == 0
    copied = cv2.imread(str(tmp_path / "out" / "cam0" / "data" / f"{STAMPS[0]:019d}.png"), 0)
    assert np.abs(copied.astype(int) - 77).max() < 4


@pytest.mark.parametrize("size", [(48, 64), (60, 95), (2000, 2000)])
@pytest.mark.parametrize("form", ["mcap", "euroc", "csv", "compressed"])
def test_an_image_of_another_size_than_its_neighbours_is_refused(
    sequence, tmp_path, capsys, size, form
):
    folder = shutil.copytree(sequence, tmp_path / "set")
    image = sorted((folder / "cam0" / "data").iterdir())[2]
    cv2.imwrite(str(image), np.zeros(size, np.uint8))
    options = {"mcap": [], "compressed": ["--images", "compressed"]}.get(form, ["--format", form])
    output = tmp_path / ("out" if options[:1] == ["--format"] else "out.mcap")
    assert run(folder, "-o", output, "--quiet", *options) == 2
    line = f"{image}: {size[1]} x {size[0]} pixels; the images before it have 94 x 60"
    assert line in capsys.readouterr().err


@pytest.mark.parametrize("images", ["raw", "compressed"])
def test_an_image_of_another_size_in_a_bag_is_refused(sequence, tmp_path, capsys, images):
    pair = [convert_bag, tmp_path / "a.mcap", tmp_path / "b.mcap"]
    small = shutil.copytree(sequence, tmp_path / "small")
    for image in (small / "cam0" / "data").iterdir():
        cv2.imwrite(str(image), np.zeros((48, 64), np.uint8))
    (small / "cam0" / "sensor.yaml").unlink()  # it would refuse them before
    for folder, bag in ((sequence, pair[1]), (small, pair[2])):
        assert run(folder, "-o", bag, "--images", images, "--quiet") == 0
    with (
        open_writer(tmp_path / "both.mcap", BagOptions("mcap")) as writer,
        open_bag(pair[1]) as large_bag,
        open_bag(pair[2]) as second,
    ):
        topics = [topic for topic in large_bag.topics if "cam0/image_raw" in topic.name]
        topics += [topic for topic in large_bag.topics if topic.type == IMU]
        handles = {t.name: writer.add_topic(t.name, t.type, t.qos, t.schema) for t in topics}
        for bag in (large_bag, second):
            for group in bag.groups(handles):
                blocks = [Block(handles[b.topic.name], b.t_ns, b.payloads) for b in group]
                writer.write_blocks(blocks)
    assert run(tmp_path / "both.mcap", "-o", tmp_path / "out", "--format", "euroc", "--quiet") == 2
    assert "64 x 48 pixels; the images before it have 94 x 60" in capsys.readouterr().err
