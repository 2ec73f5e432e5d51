# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of an earlier version are read as before, and written as before."""

from pathlib import Path

import numpy as np
import pytest
from scripts import load_script

from imu_sim_ros.bags.read import read_imu, read_odometry
from imu_sim_ros.formats.door import read_states

DATA = Path(__file__).parents[1] / "data" / "bags"
golden = load_script(Path(__file__).with_name("golden.py"))


# The folders of 17 digits are older: their numbers have more digits than they need.
TEXT = ("golden_euroc", "golden_csv", "golden_euroc_17_digits", "golden_csv_17_digits")


@pytest.mark.parametrize("name", [*golden.FORMS, *TEXT])
def test_readings_of_earlier_files_are_read_bit_for_bit(name):
    imu = read_imu(DATA / name)
    np.testing.assert_array_equal(imu.t_ns, golden.T_NS)
    np.testing.assert_array_equal(imu.gyro, golden.GYRO)
    np.testing.assert_array_equal(imu.accel, golden.ACCEL)


@pytest.mark.parametrize("name", list(golden.FORMS))
def test_truth_of_earlier_bags_is_read_bit_for_bit(name):
    truth = read_odometry(DATA / name)
    np.testing.assert_array_equal(truth.position, golden.POSITION)
    np.testing.assert_array_equal(truth.q_wb, golden.Q_WB)


def test_poses_of_an_earlier_text_file_are_read_bit_for_bit():
    poses = read_states(DATA / "golden_csv" / "groundtruth.tum")
    np.testing.assert_array_equal(poses.t_ns, golden.T_NS)
    np.testing.assert_array_equal(poses.position, golden.POSITION)


@pytest.mark.parametrize("name", ["golden.bag", "golden_bz2.bag"])
def test_bytes_of_ros1_bags_are_as_before(name, tmp_path):
    golden.write_bag(tmp_path / name, *golden.FORMS[name])
    assert (tmp_path / name).read_bytes() == (DATA / name).read_bytes()


@pytest.mark.parametrize(
    "name",
    [
        "golden_euroc/imu0/data.csv",
        "golden_euroc/state_groundtruth_estimate0/data.csv",
        "golden_csv/imu0.csv",
        "golden_csv/groundtruth.tum",
    ],
)
def test_bytes_of_text_are_as_before(name, tmp_path):
    folder, _, rest = name.partition("/")
    golden.write_text(tmp_path / folder, folder.removeprefix("golden_"))
    assert (tmp_path / folder / rest).read_bytes() == (DATA / name).read_bytes()
