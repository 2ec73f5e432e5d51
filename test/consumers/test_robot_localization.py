# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""robot_localization's files: keys that its sources declare, and values of the simulation."""

import pytest
import yaml

from imu_sim_ros.commands import generate

# Looked up in cra-ros-pkg/robot_localization 1cb9533: declare_parameter in src/ros_filter.cpp and
# src/navsat_transform.cpp; those of a source N follow its name odomN or imuN.
FILTER = """
    frequency two_d_mode publish_tf map_frame odom_frame base_link_frame world_frame
    gravitational_acceleration
"""
SOURCE = ("", "_config", "_differential", "_relative", "_queue_size")
OF_IMU = ("_remove_gravitational_acceleration",)
NAVSAT = """
    frequency delay magnetic_declination_radians yaw_offset zero_altitude publish_filtered_gps
    broadcast_cartesian_transform use_local_cartesian use_odometry_yaw wait_for_datum datum
"""


@pytest.fixture(name="written")
def write(tmp_path):
    def configs(*arguments):
        path = tmp_path / "drive.mcap"
        options = ["-o", str(path), "--duration", "1s", "--quiet", "--with-configs", "--force"]
        assert generate.main([*options, "--trajectory", "drive", *arguments]) == 0
        folder = tmp_path / "drive.mcap_configs"
        return {
            name: yaml.safe_load((folder / name).read_text(encoding="utf-8"))
            for name in ("ekf.yaml", "navsat.yaml")
            if (folder / name).exists()
        }

    return configs


def filter_keys(odometries):
    keys = set(FILTER.split()) | {f"imu0{end}" for end in (*SOURCE, *OF_IMU)}
    return keys | {f"odom{k}{end}" for k in range(odometries) for end in SOURCE}


def test_every_key_is_declared_and_has_the_type_of_ros(written):
    place = ["--set", "latitude_deg=48", "--set", "longitude_deg=11.5"]
    files = written("--wheels", "husky_a200", "--gnss", "zed_f9p", *place)
    ekf, navsat = files["ekf.yaml"], files["navsat.yaml"]
    assert set(ekf) == {"ekf_filter_node_odom", "ekf_filter_node_map"}
    odom, world = (ekf[f"ekf_filter_node_{n}"]["ros__parameters"] for n in ("odom", "map"))
    assert set(odom) == filter_keys(1)
    assert set(world) == filter_keys(2)
    parameters = navsat["navsat_transform"]["ros__parameters"]
    assert set(parameters) == set(NAVSAT.split())
    assert parameters["datum"] == [48.0, 11.5, 0.0]
    assert all(isinstance(value, float) for value in parameters["datum"])
    for values in (odom, world):
        assert isinstance(values["frequency"], float)
        assert isinstance(values["gravitational_acceleration"], float)
        assert values["gravitational_acceleration"] == 9.81
        assert len(values["imu0_config"]) == len(values["odom0_config"]) == 15
        assert [k for k, used in enumerate(values["imu0_config"]) if used] == list(range(9, 15))
        assert [k for k, used in enumerate(values["odom0_config"]) if used] == [6, 7, 11]
        assert values["imu0"] == "/imu/data_raw"
        assert values["odom0"] == "/wheel/odom"
        assert values["base_link_frame"] == "base_link"
    assert (odom["world_frame"], world["world_frame"]) == ("odom", "map")
    assert [k for k, used in enumerate(world["odom1_config"]) if used] == [0, 1, 2]
    assert world["odom1"] == "odometry/gps"


def test_only_what_the_body_has_is_configured(written):
    assert set(written("--wheels", "f1tenth")) == {"ekf.yaml"}
    files = written("--gnss", "phone")
    world = files["ekf.yaml"]["ekf_filter_node_map"]["ros__parameters"]
    assert world["odom0"] == "odometry/gps"
    assert "odom1" not in world


def test_a_body_without_either_has_no_such_files(written):
    assert written() == {}
