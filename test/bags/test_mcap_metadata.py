# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The metadata record that rosbag2 keeps in an MCAP file, read by the mcap library."""

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import ImuEncoder


@pytest.mark.parametrize("name", ["flight.mcap", "flight"])
def test_a_file_tells_the_distribution_and_what_rosbag2_tells_of_it(tmp_path, name):
    t_ns = 10**18 + np.arange(50) * 5_000_000
    rows = ImuEncoder("imu_link").encode(t_ns, np.ones((50, 3)), np.ones((50, 3)))
    with open_writer(tmp_path / name) as writer:
        writer.write(writer.add_topic("/imu/data_raw", "sensor_msgs/msg/Imu"), t_ns, rows)
    path = tmp_path / name
    (path,) = path.glob("*.mcap") if path.is_dir() else [path]
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        (record,) = reader.iter_metadata()
    assert summary.statistics.metadata_count == len(summary.metadata_indexes) == 1
    assert record.name == "rosbag2"
    assert record.metadata["ROS_DISTRO"] == "jazzy"
    content = yaml.safe_load(record.metadata["serialized_metadata"])
    assert content["ros_distro"] == "jazzy"
    assert content["version"] == 9
    assert content["message_count"] == 50
    assert content["starting_time"] == {"nanoseconds_since_epoch": 10**18}
    assert content["duration"] == {"nanoseconds": 245_000_000}
    (topic,) = content["topics_with_message_count"]
    assert topic["topic_metadata"]["type"] == "sensor_msgs/msg/Imu"
    if name == "flight":
        (information,) = yaml.safe_load((tmp_path / name / "metadata.yaml").read_text()).values()
        assert content == information
