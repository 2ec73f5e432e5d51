# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cameras: a live stereo rig with an IMU, and what images and tracks cost.

``--parts live``: the simulator publishes a 200 Hz IMU, the truth and two cameras of 752 x 480 at
20 Hz; a subscriber of its own takes every topic, and in some rows a recorder too. Lost is what was
published and did not arrive; the lateness is that of the publishing call behind its deadline, over
all samples. ``--parts speed``: processor time of images, PNG and tracks, and wall time of a whole
dataset along EuRoC's V1_02 if its ground truth is next to the checkout, else figure_eight.
"""

import argparse
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from imu_sim_ros.terminal.text_tables import print_table

if TYPE_CHECKING:
    from imu_sim_ros.camera import Rig

HERE = Path(__file__).resolve()
FLIGHT = HERE.parents[4] / "shared" / "data" / "euroc_V1_02_medium_groundtruth.csv"
CAMERAS = ("cam0", "cam1")
IMU, TRUTH = "/imu/data_raw", "/ground_truth/odom"
TRACKS = "/feature_tracker/feature"
ROWS: tuple[tuple[str, str | None, list[str] | None], ...] = (
    ("no cameras", None, None),
    ("stereo, raw", "raw", None),
    ("stereo, raw, recorder", "raw", []),
    ("stereo, raw, recorder zstd", "raw", ["--compression", "zstd"]),
    ("stereo, PNG", "compressed", None),
    ("stereo, PNG, recorder", "compressed", []),
)
_START = 2.0


def topics(images: str | None) -> dict[str, str]:
    """Return the type of each topic of a run."""
    topic_types = {IMU: "sensor_msgs/msg/Imu", TRUTH: "nav_msgs/msg/Odometry"}
    if images is None:
        return topic_types
    raw = images == "raw"
    for camera in CAMERAS:
        name = f"/{camera}/image_raw" + ("" if raw else "/compressed")
        topic_types[name] = f"sensor_msgs/msg/{'Image' if raw else 'CompressedImage'}"
        topic_types[f"/{camera}/camera_info"] = "sensor_msgs/msg/CameraInfo"
    return {**topic_types, TRACKS: "sensor_msgs/msg/PointCloud"}


def listen(images: str | None) -> None:
    """Count what arrives on every topic, until a signal; print the counts."""
    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.qos import QoSProfile

    from imu_sim_ros.nodes.messages import message_class

    rclpy.init()
    node = rclpy.create_node("listener")
    counts = dict.fromkeys(topics(images), 0)

    def count(topic: str, _: bytes) -> None:
        counts[topic] += 1

    for topic, kind in topics(images).items():
        depth = 200 if "image" in topic else 8000
        node.create_subscription(
            message_class(kind),
            topic,
            partial(count, topic),
            QoSProfile(depth=depth),
            raw=True,
        )
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while True:
            executor.spin_once(timeout_sec=0.2)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    for topic, number in counts.items():
        print(f"listener: published {number} messages on {topic}", flush=True)
    rclpy.try_shutdown()


def simulator(images: str | None, duration: float, recorded: bool) -> list[str]:
    """Return the simulator's command line."""
    waits = str(2 if recorded else 1)
    command = [
        *(sys.executable, "-m", "imu_sim_ros.nodes.simulator.node", "--imu", "adis16448"),
        *("--trajectory", "figure_eight", "--rate", "200", "--duration", str(duration)),
        *("--wait-for-subscribers", waits, "--wait-for-truth-subscribers", waits),
    ]
    if images is None:
        return command
    values = {
        "cameras": "[cam0, cam1]",
        "cam0.camera.preset": "euroc_cam0",
        "cam1.camera.preset": "euroc_cam1",
        "camera.body_axes": "flu",
        "camera.images": images,
    }
    return [*command, "--ros-args", *(w for k, v in values.items() for w in ("-p", f"{k}:={v}"))]


def counts_by_topic(output: str) -> dict[str, int]:
    """Return the counts that a process printed, by topic."""
    counts = re.findall(r"published (\d+) messages on (\S+)", output)
    return {"/" + name.lstrip("/"): int(n) for n, name in counts}


def start(command: list[str], folder: str) -> subprocess.Popen[str]:
    """Start a process on the domain of this benchmark."""
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=folder
    )


def live(label: str, images: str | None, recorder: list[str] | None, duration: float) -> list[str]:
    """Run one row of the live table."""
    with tempfile.TemporaryDirectory() as folder:
        listener = start([sys.executable, str(HERE), "--listen", images or "none"], folder)
        recording = None
        if recorder is not None:
            command = [sys.executable, "-m", "imu_sim_ros.nodes.recorder.node", "-o", "bag"]
            recording = start([*command, *topics(images), *recorder], folder)
        time.sleep(_START)
        usage_start = resource.getrusage(resource.RUSAGE_CHILDREN)
        node = start(simulator(images, duration, recorder is not None), folder)
        output = node.communicate()[0]
        usage_end = resource.getrusage(resource.RUSAGE_CHILDREN)
        time.sleep(1.0)
        listener.send_signal(signal.SIGINT)
        heard = counts_by_topic(listener.communicate()[0])
        stored = "-"
        published = counts_by_topic(output)
        if recording is not None:
            recording.send_signal(signal.SIGINT)
            rows = re.findall(r"^\s*(/\S+)\s+(\d+)", recording.communicate()[0], re.MULTILINE)
            stored_counts = {name: int(number) for name, number in rows}
            stored = " ".join(
                str(published.get(t, 0) - stored_counts.get(t, 0)) for t in topics(images)
            )
    late = re.search(r"p50 (\d+) us, p99 (\d+) us, max (\d+) us", output)
    used = usage_end.ru_utime + usage_end.ru_stime - usage_start.ru_utime - usage_start.ru_stime
    lost = " ".join(str(published.get(t, 0) - heard.get(t, 0)) for t in topics(images))
    total = sum(published.get(topic, 0) for topic in topics(images))
    if not late:
        print(output)
    return [
        *(label, str(total), lost, stored),
        *(late.groups() if late else ("", "", "")),
        f"{100.0 * used / duration:.0f}",
    ]


def first_camera(trajectory: str, **overrides: object) -> "Rig":
    """Return EuRoC's first camera on a trajectory."""
    from imu_sim_ros.camera import build_rig
    from imu_sim_ros.trajectory.parameters import trajectory_layer

    parameters = {"cameras": ["cam0"], "cam0.camera.preset": "euroc_cam0", "duration": 60.0}
    axes = {} if trajectory.endswith(".csv") else {"camera.body_axes": "flu"}
    return build_rig({**parameters, **axes, **trajectory_layer(trajectory), **overrides})


def per_second(work: Callable[[], int]) -> str:
    """Return how much is done in a second of processor time of one core."""
    work()
    begun = time.process_time()
    count = work()
    return f"{count / (time.process_time() - begun):,.0f}"


def speeds(trajectory: str) -> list[list[str]]:
    """Return what one core makes: images, PNG, tracks."""
    from imu_sim_ros.sensors.camera.images.files import png
    from imu_sim_ros.sensors.camera.images.imager import Imager, textures
    from imu_sim_ros.sensors.camera.images.libraries import opencv

    opencv().setNumThreads(1)
    rows, frames = [], range(100, 700, 12)

    def plain(imager: Imager) -> int:
        return len([imager.image(k) for k in frames])

    def coded(imager: Imager) -> int:
        return len([png(imager.image(k)) for k in frames])

    for label, overrides in (
        ("nearest mip level", {}),
        ("trilinear", {"camera.mip_levels": "trilinear"}),
        ("colours", {"camera.encoding": "rgb8"}),
        ("2 x 2 rays a pixel", {"camera.supersampling": 2}),
        ("blur of 8 instants", {"camera.exposure_time": 0.01}),
    ):
        rig = first_camera(trajectory, **overrides)
        view = rig.views["cam0"]
        look = textures(rig.scene, rig.parameters.scene, view.parameters.encoding == "rgb8")
        imager = Imager(view, rig.scene, look, rig.trajectory)
        rows.append([f"images, {label}", per_second(partial(plain, imager))])
        rows.append([f"images to PNG, {label}", per_second(partial(coded, imager))])
    rig = first_camera(trajectory, **{"scene.landmarks": 1500, "camera.max_features": 200})
    count = per_second(lambda: sum(len(t.id) for t in rig.tracks("cam0")))
    return [*rows, ["features of tracks, at most 200 a frame", count]]


def dataset(trajectory: str, duration: float) -> list[str]:
    """Return wall and processor time of a stereo dataset in EuRoC's form, and its peak memory."""
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["-o", f"{folder}/mav0", "--format", "euroc", "--imu", "adis16448", "--quiet"]
        arguments += ["--trajectory", trajectory, "--duration", f"{duration}s"]
        arguments += ["--camera", "euroc_cam0", "--camera", "euroc_cam1"]
        if not trajectory.endswith(".csv"):
            arguments += ["--set", "camera.body_axes=flu"]
        usage_start, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        subprocess.run(
            [sys.executable, "-m", "imu_sim_ros.commands.generate", *arguments], check=True
        )
        wall, usage_end = time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
        images = len(list(Path(folder).rglob("*.png")))
    used = usage_end.ru_utime + usage_end.ru_stime - usage_start.ru_utime - usage_start.ru_stime
    return [
        *(f"{duration:g}", str(images), f"{wall:.1f}", f"{used:.1f}", f"{images / wall:.1f}"),
        f"{usage_end.ru_maxrss / 1024:.0f}",
    ]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=60.0, help="seconds of each live row")
    parser.add_argument("--rows", type=int, nargs="*", default=range(len(ROWS)), help="of live")
    parser.add_argument("--parts", nargs="*", default=["live", "speed"])
    parser.add_argument("--trajectory", default=str(FLIGHT if FLIGHT.exists() else "figure_eight"))
    parser.add_argument("--listen", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.listen:
        listen(None if arguments.listen == "none" else arguments.listen)
        return
    os.environ.setdefault("ROS_DOMAIN_ID", "96")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ["PYTHONPATH"] = str(HERE.parents[3])
    if "speed" in arguments.parts:
        # First: what this process has in memory would count for its children's peak.
        rows = [dataset(arguments.trajectory, duration) for duration in (10.0, 83.0)]
        header = ["simulated [s]", "images", "wall [s]", "CPU [s]", "images/s", "peak MiB"]
        print_table(header, rows, "Stereo dataset in EuRoC's form, all cores")
        print_table(
            ["one core, 752 x 480", "per s"], speeds(arguments.trajectory), "Processor time"
        )
    if "live" not in arguments.parts:
        return
    chosen = [row for k, row in enumerate(ROWS) if k in arguments.rows]
    rows = [live(*row, arguments.duration) for row in chosen]
    print_table(
        ["run", "published", "lost", "not in bag", "p50 [us]", "p99 [us]", "max [us]", "CPU [%]"],
        rows,
        f"200 Hz IMU, truth, stereo 752 x 480 at 20 Hz, {arguments.duration:g} s each",
    )


if __name__ == "__main__":
    main()
