# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that ``--trajectory X`` stands for."""

import pytest

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.trajectory.parameters import trajectory_layer


def test_a_name_stands_for_its_file():
    assert trajectory_layer("spin")["trajectory.yaw.polynomial"] == [0.0, 1.0]


@pytest.mark.parametrize("kind", ["harmonic", "polar", "poses"])
def test_a_kind_without_a_file_stands_for_itself(kind):
    assert trajectory_layer(kind) == {"trajectory.type": kind}


def test_poses_and_bags_are_followed(tmp_path):
    text, bag, folder = tmp_path / "poses.txt", tmp_path / "a.mcap", tmp_path / "rosbag2"
    text.touch()
    bag.touch()
    folder.mkdir()
    for path in (text, bag, folder):
        expected = {"trajectory.type": "poses", "trajectory.file": str(path)}
        assert trajectory_layer(str(path)) == expected


def test_anything_else_is_refused_with_the_names():
    with pytest.raises(ConfigurationError, match=r"nonsense'; neither a file nor one of circle, "):
        trajectory_layer("nonsense")
