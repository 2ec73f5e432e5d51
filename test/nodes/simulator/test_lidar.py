# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A LiDAR live: the bytes of a bag with the same parameters."""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dotted_names import nested

import imu_sim_ros as ims

pytestmark = pytest.mark.ros

GIVEN: dict[str, Any] = {
    "trajectory.type": "figure_eight",
    "duration": 2.0,
    "start_time": 1234.5,
    "seed": 7,
    "scene.type": "warehouse",
    "lidar.preset": "vlp16",
    "lidar.firing_period": 442.368e-6,
    "lidar.lever_arm": [0.3, 0.0, 0.1],
    "lidar.latency": 0.02,
}


def test_live_clouds_are_those_of_a_bag(start: Any, listener: Any, tmp_path: Path) -> None:
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, PointCloud2

    for topic, kind in {"imu/data_raw": Imu, "ground_truth/odom": Odometry}.items():
        listener.listen(topic, kind)
    topics = ("points", "ground_truth/points")
    for topic in topics:
        listener.listen(topic, PointCloud2)
    chosen = {name.replace(".", "__"): value for name, value in GIVEN.items()}
    waiting = {"wait_for_subscribers": 1, "wait_for_truth_subscribers": 1}
    node = start("simulator", "--sensors", "[lidar]", "--ros-args", **chosen, **waiting)
    assert listener.wait_for_end(node) == 0, node.output
    bag_settings = {name: value for name, value in GIVEN.items() if name != "scene.type"}
    ims.generate(tmp_path / "a.mcap", sensors=["lidar"], scene="warehouse", **nested(bag_settings))
    for topic in topics:
        live = listener.messages(topic)
        recorded = list(ims.read_points(tmp_path / "a.mcap", topic))
        assert len(live) == len(recorded) == 20
        for message, (t_ns, points) in zip(live, recorded, strict=True):
            stamp = message.header.stamp
            assert stamp.sec * 1_000_000_000 + stamp.nanosec == t_ns
            assert message.header.frame_id == "lidar"
            assert np.asarray(message.data).tobytes() == points.tobytes()
    missing = importlib.util.find_spec("livox_ros_driver2") is None
    assert ("livox/lidar is not published: livox_ros_driver2" in node.output) == missing
