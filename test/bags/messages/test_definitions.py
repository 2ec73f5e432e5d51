# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The definitions that stand in this package against those that rosbags has."""

import subprocess
import sys

import pytest

from imu_sim_ros.bags.messages.definitions.ros1 import MD5_SUMS
from imu_sim_ros.bags.messages.definitions.ros2 import RIHS01
from imu_sim_ros.bags.messages.schemas import known_types, ros2_name, schema


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
@pytest.mark.parametrize("name", sorted(RIHS01))
def test_texts_and_digests_are_those_of_rosbags(name, encoding):
    name = ros2_name(name)
    ours, theirs = schema(name, encoding), schema(name, encoding, known_types(encoding))
    assert ours == theirs
    assert ours.text


def test_both_encodings_know_the_same_types():
    assert set(MD5_SUMS) == set(RIHS01)


def test_writing_reads_no_definitions_of_other_types(tmp_path):
    program = (
        "import sys; from imu_sim_ros.commands.generate import main; "
        "code = main(sys.argv[1:]); "
        "assert not any('typesys' in name for name in sys.modules); "
        "sys.exit(code)"
    )
    for name in ("a.mcap", "a.bag"):
        arguments = ["--duration", "0.1s", "--quiet", "-o", str(tmp_path / name)]
        subprocess.run([sys.executable, "-c", program, *arguments], check=True)
