# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cameras of the running simulator: the same bytes as in a file, and how they end."""

import os
import signal
import struct
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from imu_sim_ros.commands import generate
from imu_sim_ros.sensors.camera.rig_parameters import load_rig

pytestmark = pytest.mark.ros

RIG = {
    "cameras": "[cam0, cam1]",
    "cam0.camera.preset": "euroc_cam0",
    "cam1.camera.preset": "euroc_cam1",
    "camera.body_axes": "flu",
    "camera.width": 94,
    "camera.height": 60,
    "camera.intrinsics": "[57.3, 57.2, 45.9, 31.0]",
    "camera.dropout_probability": 0.1,
    "camera.latency": 0.02,
    "camera.images": "both",
    "cam1.camera.encoding": "rgb8",
    "cam1.camera.depth": True,
    "camera.time_offset": 0.01,
    "scene.type": "aprilgrid",
    "duration": 1.5,
    "start_time": 1.0,
    "seed": 4,
}
CAM0, CAM1 = (
    {key: value for key, value in RIG.items() if not key.startswith(other_camera)}
    | {"cameras": f"[{name}]"}
    for name, other_camera in (("cam0", "cam1"), ("cam1", "cam0"))
)
"""Each camera of the rig alone."""


def dotted(values: dict[str, Any]) -> dict[str, Any]:
    return {key.replace(".", "__"): value for key, value in values.items()}


def as_arguments(values: dict[str, Any]) -> list[str]:
    return [word for key, value in values.items() for word in ("--set", f"{key}={value}")]


def offline(folder: Path, trajectory: str, values: dict[str, Any]) -> dict[str, list[bytes]]:
    """Return the messages that generate writes, as bytes by topic."""
    path = folder / "a.mcap"
    generate_arguments = [
        "-o",
        str(path),
        "--quiet",
        "--trajectory",
        trajectory,
        *as_arguments(values),
    ]
    assert generate.main(generate_arguments) == 0
    return messages(path)


def messages(path: Path) -> dict[str, list[bytes]]:
    payloads: dict[str, list[bytes]] = {}
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            payloads.setdefault(connection.topic, []).append(bytes(raw))
    return payloads


def stamps(payloads: list[bytes]) -> list[tuple[int, int]]:
    return [struct.unpack_from("<iI", payload, 4) for payload in payloads]


def unpadded(received: list[bytes], expected: list[bytes]) -> list[bytes]:
    """Return messages without what Fast DDS appends up to a multiple of four bytes."""
    pairs = zip(received, expected, strict=False)
    return [a[: len(b)] if len(a) == -(-len(b) // 4) * 4 else a for a, b in pairs]


def listen_to_all(listener: Any) -> None:
    from nav_msgs.msg import Odometry
    from rclpy.qos import DurabilityPolicy
    from sensor_msgs.msg import CameraInfo, CompressedImage, Image, Imu, PointCloud, PointCloud2
    from visualization_msgs.msg import MarkerArray

    for name in ("cam0", "cam1"):
        listener.listen(f"/{name}/image_raw", Image)
        listener.listen(f"/{name}/image_raw/compressed", CompressedImage)
        listener.listen(f"/{name}/camera_info", CameraInfo)
    listener.listen("/cam1/depth/image_raw", Image)
    listener.listen("/feature_tracker/feature", PointCloud)
    listener.listen("/imu/data_raw", Imu)
    listener.listen("/ground_truth/odom", Odometry)
    latched = {"depth": 1, "durability": DurabilityPolicy.TRANSIENT_LOCAL}
    listener.listen("/ground_truth/landmarks", PointCloud2, **latched)
    listener.listen("/ground_truth/markers", MarkerArray, **latched)


def test_frames_are_those_of_a_file_bit_for_bit(tf2_msgs, start, listener, tmp_path, capsys):
    """A listener and a recorder receive the frames; dead_reckon and convert_bag read the bag.

    The bag also holds the cameras' frames on /tf_static. This run is in real time; the run with
    a moving body publishes as fast as the listener takes its frames.
    """
    import json

    import yaml

    from imu_sim_ros.commands import convert_bag, dead_reckon

    expected = offline(tmp_path, "target", RIG)
    listen_to_all(listener)
    bag = tmp_path / "recording"
    recorder = start("recorder", "-o", str(bag), *expected, "/tf_static")
    node = start(
        "simulator",
        *("--trajectory", "target"),
        **dotted(RIG),
        wait_for_subscribers=2,
        wait_for_truth_subscribers=2,
    )
    assert listener.wait_for_end(node) == 0, node.output
    assert recorder.end() == 0, recorder.output
    for topic, payloads in expected.items():
        if topic != "/ground_truth/landmarks":
            assert stamps(listener.raw[topic]) == stamps(payloads), topic
            assert unpadded(listener.raw[topic], payloads) == payloads, topic
            assert f"published {len(payloads)} messages on {topic[1:]}" in node.output
    assert len(expected["/cam1/image_raw"]) == len(expected["/cam1/depth/image_raw"]) < 30
    (cloud,) = listener.raw["/ground_truth/landmarks"]
    (in_file,) = expected["/ground_truth/landmarks"]
    assert cloud[12 : len(in_file)] == in_file[12:]  # all but the stamp
    (markers,) = listener.messages("/ground_truth/markers")
    shown = {marker.ns: len(marker.points) for marker in markers.markers}
    (points,) = listener.messages("/ground_truth/landmarks")
    assert points.width % 4 == 0  # four corners a tag; how many tags follows from the lens
    assert points.width >= 36
    assert shown == {"landmarks": points.width, "surfaces": 8, "cameras": 16}
    recorded = messages(bag)
    # The latched message may arrive twice, live and as what a late subscriber is given.
    assert len(recorded[latched := "/ground_truth/landmarks"]) in (1, 2)
    assert len(expected.pop(latched)) == 1
    for topic, payloads in expected.items():
        assert len(recorded[topic]) == len(payloads)
        assert unpadded(recorded[topic], payloads) == payloads, topic
    check_mounts(recorded["/tf_static"])
    assert dead_reckon.main([str(bag), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["samples"] == len(expected["/imu/data_raw"])
    convert_arguments = [str(bag), "-o", str(tmp_path / "mav0"), "--format", "euroc", "--quiet"]
    assert convert_bag.main(convert_arguments) == 0, capsys.readouterr().err
    for name in ("cam0", "cam1"):
        images = list((tmp_path / "mav0" / name / "data").iterdir())
        assert len(images) == len(expected[f"/{name}/image_raw"])
        sensor = yaml.safe_load((tmp_path / "mav0" / name / "sensor.yaml").read_text())
        assert sensor["intrinsics"] == [57.3, 57.2, 45.9, 31.0]
        pose = np.reshape(sensor["T_BS"]["data"], (4, 4))
        assert np.allclose(pose[:3, 2], [1.0, 0.0, 0.0], atol=0.05)  # looks along x


def check_mounts(payloads: list[bytes]) -> None:
    """Check that the cameras' frames on /tf_static are where their parameters put them."""
    from rosbags.typesys import Stores, get_typestore

    from imu_sim_ros.core import rotation

    store = get_typestore(Stores.ROS2_JAZZY)
    static_transforms = {
        t.child_frame_id: t
        for data in payloads
        for t in store.deserialize_cdr(data, "tf2_msgs/msg/TFMessage").transforms
    }
    values = {k: v for k, v in RIG.items() if "camera" in k and k != "cameras"}
    values["camera.intrinsics"] = [57.3, 57.2, 45.9, 31.0]
    rig = load_rig({**values, "cameras": ["cam0", "cam1"]})
    for name, camera in rig.camera_parameters().items():
        transform = static_transforms[f"{name}_optical_frame"]
        assert transform.header.frame_id == "base_link"
        r_bc, p_bc = camera.pose()
        p, q = transform.transform.translation, transform.transform.rotation
        np.testing.assert_allclose([p.x, p.y, p.z], p_bc, atol=1e-12)
        matrix = rotation.to_matrix(np.array([[q.w, q.x, q.y, q.z]]))[0]
        np.testing.assert_allclose(matrix, r_bc, atol=1e-6)


def test_frames_in_a_mesh_are_those_of_a_file_bit_for_bit(start, listener, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("embreex")
    room = trimesh.creation.box((14.0, 14.0, 6.0)).subdivide().subdivide()
    room.invert()
    colours = 128.0 + 100.0 * np.sin(2.0 * room.vertices)
    room.visual.vertex_colors = colours.astype(np.uint8)
    room.export(tmp_path / "room.ply")
    scene = {"scene.type": "mesh", "scene.mesh": str(tmp_path / "room.ply"), "duration": 0.6}
    values = CAM1 | scene | {"camera.row_time": 1e-4, "camera.exposure_time": 0.01}
    file_payloads = offline(tmp_path, "figure_eight", values)
    listen_to_all(listener)
    node = start(
        "simulator",
        *("--trajectory", "figure_eight"),
        **dotted(values),
        wait_for_subscribers=1,
        wait_for_truth_subscribers=1,
        real_time_factor=1.0,
    )
    assert listener.wait_for_end(node) == 0, node.output
    for topic in ("/cam1/image_raw", "/cam1/depth/image_raw", "/feature_tracker/feature"):
        payloads = file_payloads[topic]
        assert len(payloads) > 5, topic
        assert stamps(listener.raw[topic]) == stamps(payloads), topic
        assert unpadded(listener.raw[topic], payloads) == payloads, topic
    pixels = np.frombuffer(file_payloads["/cam1/image_raw"][5][-94 * 60 * 3 :], np.uint8)
    assert pixels.std() > 5.0


def test_a_paused_simulator_holds_its_frames_and_a_reset_begins_again(start, listener, tmp_path):
    from sensor_msgs.msg import Image
    from std_srvs.srv import SetBool, Trigger

    listener.listen("/cam1/image_raw", Image)
    node = start(
        "simulator", "--trajectory", "target", **dotted(CAM1 | {"duration": 100.0}), autostart=False
    )
    expected = offline(tmp_path, "target", CAM1)["/cam1/image_raw"]
    listener.call("/simulator/pause", SetBool, data=False)
    listener.wait_for("/cam1/image_raw", 5)
    listener.call("/simulator/pause", SetBool, data=True)
    paused_count = -1
    for _ in range(20):  # what is still on its way arrives, on a busy machine after a while
        if paused_count == len(listener.raw["/cam1/image_raw"]):
            break
        paused_count = len(listener.raw["/cam1/image_raw"])
        listener.spin(1.0)
    listener.spin(0.5)
    assert len(listener.raw["/cam1/image_raw"]) == paused_count
    listener.call("/simulator/pause", SetBool, data=False)
    listener.wait_for("/cam1/image_raw", paused_count + 3)
    count = len(listener.raw["/cam1/image_raw"])
    together = min(count, len(expected))
    received = listener.raw["/cam1/image_raw"][:together]
    assert unpadded(received, expected) == expected[:together]
    listener.call("/simulator/reset", Trigger)
    first_frame = expected[0]
    listener.wait_for("/cam1/image_raw", count + 3)
    listener.wait_until(
        lambda: listener.raw["/cam1/image_raw"].count(first_frame) == 2, "a new start"
    )
    (camera,) = children(node.process.pid)
    os.kill(camera, signal.SIGINT)  # the camera hears of it before the node
    assert node.end() == 0, node.output
    assert "unexpected" not in node.output


def test_what_is_wrong_with_a_camera_is_one_line(start):
    """The reader of parameters reports a camera's wrong scene; test_scene.py has all messages."""
    node = start("simulator", "--trajectory", "target", **dotted(CAM0 | {"scene.type": "cloud"}))
    assert node.status() == 2
    assert "scene.type = 'cloud': has points and lines only" in node.output
    assert "Traceback" not in node.output


def test_frames_are_made_ahead_up_to_the_end_of_the_run_and_again_after_a_reset():
    from imu_sim_ros.nodes.simulator.apart_process import Made, SampleQueue

    beyond, rendered = threading.Event(), []

    def make(number: int) -> Made:
        rendered.append(number)
        if number >= 5:
            beyond.set()
        return Made(number, [])

    queue = SampleQueue(make, lambda number: number < 5)
    threading.Thread(target=queue.work, daemon=True).start()
    queue.wait_for_first()
    for _ in range(2):
        assert [queue.take(number).true_t_ns for number in range(5)] == list(range(5))
    assert not beyond.wait(0.2)
    assert rendered == [*range(5), *range(5)]


def children(pid: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_a_camera_that_dies_ends_the_node_and_a_node_that_dies_its_cameras(start, listener):
    from sensor_msgs.msg import Image

    listener.listen("/cam0/image_raw", Image)
    endless = {"duration": 1000.0}
    node = start("simulator", "--trajectory", "target", **dotted(CAM0 | endless))
    listener.wait_for("/cam0/image_raw", 2)
    os.kill(children(node.process.pid)[0], signal.SIGKILL)
    assert node.status() == 1
    assert "the sensor's process ended, status -9" in node.output
    node = start("simulator", "--trajectory", "target", **dotted(CAM0 | endless))
    listener.wait_for("/cam0/image_raw", len(listener.raw["/cam0/image_raw"]) + 2)
    cameras = children(node.process.pid)
    assert len(cameras) == 1
    node.send(signal.SIGKILL)

    def gone() -> bool:
        return not any(_runs(pid) for pid in cameras)

    listener.wait_until(gone, "the end of the cameras")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_all_processes_of_a_node_ends_it_well(start, listener, number):
    """A terminal and a supervisor tell the whole group; the camera may hear of it first.

    The node of the paused frames ends by SIGINT.
    """
    from sensor_msgs.msg import Image

    listener.listen("/cam0/image_raw", Image)
    node = start("simulator", "--trajectory", "target", **dotted(CAM0 | {"duration": 1000.0}))
    listener.wait_until(lambda: children(node.process.pid), "the camera's process")
    (camera,) = children(node.process.pid)
    signals = {number, signal.SIGINT}
    for camera_number in signals:
        os.kill(camera, camera_number)  # as it begins
    listener.wait_for("/cam0/image_raw", 2)
    for camera_number in signals:
        os.kill(camera, camera_number)
    listener.wait_for("/cam0/image_raw", len(listener.raw["/cam0/image_raw"]) + 2)
    node.send(number)
    assert node.status() == 0, node.output
    assert "unexpected" not in node.output


def _runs(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False


def test_without_cameras_nothing_of_them_is_imported():
    import subprocess
    import sys

    code = (
        "import sys, imu_sim_ros.nodes.simulator.node\n"
        "heavy = 'cv2', 'numba', 'visualization_msgs'\n"
        "found = [m for m in sys.modules if 'camera' in m or m in heavy]\n"
        "assert not found, found"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


WALK = {
    "cameras": "[cam0]",
    "camera.preset": "euroc_cam0",
    "camera.body_axes": "flu",
    "camera.width": 94,
    "camera.height": 60,
    "camera.intrinsics": "[57.3, 57.2, 45.9, 31.0]",
    "camera.depth": True,
    "camera.time_offset": 0.01,
    "trajectory.place_size": "[12.0, 4.0, 2.6]",
    "scene.type": "corridor",
    "scene.size": "[12.0, 4.0, 2.6]",
    "scene.center": "[0.0, 0.0, 1.3]",
    "scene.texture": "blank",
    "scene.bodies.people": 1,
    "scene.bodies.doors": 1,
    "duration": 0.6,
    "start_time": 1.0,
    "seed": 4,
}


def test_bodies_that_move_are_those_of_a_file_bit_for_bit(start, listener, tmp_path):
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Image, Imu, PointCloud

    expected = offline(tmp_path, "tour", WALK)
    kinds = {
        "/imu/data_raw": Imu,
        "/ground_truth/odom": Odometry,
        "/cam0/image_raw": Image,
        "/cam0/depth/image_raw": Image,
        "/cam0/mask/image_raw": Image,
        "/feature_tracker/feature": PointCloud,
        "/ground_truth/bodies/door_1": Odometry,
        "/ground_truth/bodies/person_1": Odometry,
    }
    for topic, kind in kinds.items():
        listener.listen(topic, kind)
    node = start(
        "simulator",
        *("--trajectory", "tour"),
        **dotted(WALK),
        wait_for_subscribers=1,
        wait_for_truth_subscribers=1,
        real_time_factor=0.0,
    )
    assert listener.wait_for_end(node) == 0, node.output
    for topic in kinds:
        assert len(expected[topic]) >= 11
        assert unpadded(listener.raw[topic], expected[topic]) == expected[topic], topic
    assert any(any(mask[-94 * 60 :]) for mask in expected["/cam0/mask/image_raw"])
