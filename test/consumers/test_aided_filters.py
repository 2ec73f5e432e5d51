# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""FusionCore's and MINS' files: keys that their sources read, and values of the simulation."""

import cv2
import numpy as np
import pymap3d
import pytest
import yaml

import imu_sim_ros as ims
from imu_sim_ros.commands import generate

# Looked up in manankharwar/fusioncore 0ff2e26, declare_parameter in fusioncore_ros/src/
# fusion_node.cpp: those that depend on the rig, with the type that is declared.
FUSIONCORE = {
    str: """
        base_frame odom_frame imu.topic imu.frame_id motion_model encoder.topic gnss.fix_topic
        input.gnss_crs output.crs
    """,
    float: """
        publish_rate imu.gyro_noise imu.accel_noise imu.lever_arm_x imu.lever_arm_y imu.lever_arm_z
        motion_model_params.wheelbase encoder.vel_noise encoder.yaw_noise encoder.nhc_vy_sigma
        gnss.base_noise_xy gnss.base_noise_z gnss.lever_arm_x gnss.lever_arm_y gnss.lever_arm_z
        reference.x reference.y reference.z
    """,
    bool: """
        imu.has_magnetometer imu.remove_gravitational_acceleration encoder.nhc_auto_detect
        gnss.use_gps_fix output.convert_to_enu_at_reference reference.use_first_fix
    """,
    int: "gnss.min_fix_type",
}
# Looked up in rpng/MINS bedf55e, parse_external in mins/src/options: all that are required where a
# file is there, and sub_topics, which names the joints.
MINS = {
    "system": """
        sys verbosity save_timing path_timing save_state path_state save_trajectory path_trajectory
        save_prints exp_id path_bag bag_start bag_durr
    """,
    "estimator": """
        est gravity_mag use_imu_res use_imu_cov use_pol_cov window_size clone_freq dt_extrapolation
        intr_order dynamic_cloning intr_error_mlt intr_error_ori_thr intr_error_pos_thr
        intr_error_thr_mlt
    """,
    "imu": "imu gyro_noise gyro_bias accel_noise accel_bias topic",
    "init": """
        init window_time imu_thresh imu_wheel_thresh imu_only_init imu_gravity_aligned use_gt
        use_gt_gnss use_gt_lidar cov_size
    """,
    "gps": """
        gps enabled max_n chi2_mult do_calib_ext do_calib_dt init_distance init_closed_form
        init_cov_dt init_cov_ex init_cov_inflation overwrite_noise noise
    """,
    "wheel": """
        wheel enabled chi2_mult noise_w noise_v noise_p do_calib_ext do_calib_dt do_calib_int
        init_cov_dt init_cov_ex_o init_cov_ex_p init_cov_in_b init_cov_in_r reuse_of_information
        topic sub_topics timeoffset T_imu_wheel intrinsics type
    """,
}
# Body to IMU: turned by 90 degrees about z.
TURNED = [
    *("--set", "imu.mounting=[0, -1, 0, 1, 0, 0, 0, 0, 1]"),
    *("--set", "imu.lever_arm=[0.1, 0, 0.2]", "--set", "gnss.lever_arm=[0.3, 0, 1]"),
]


@pytest.fixture(name="written")
def write(tmp_path):
    def configs(*arguments):
        options = ["-o", str(tmp_path / "a.bag"), "--duration", "1s", "--quiet", "--with-configs"]
        assert generate.main([*options, "--force", "--trajectory", "drive", *arguments]) == 0
        return tmp_path / "a.bag_configs"

    return configs


def fusioncore(folder):
    text = (folder / "fusioncore.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)["fusioncore"]["ros__parameters"]


class Mins:
    """A section of a file as OpenCV reads it, by which MINS does; the file stays open for it."""

    def __init__(self, folder, name, section):
        self.file = cv2.FileStorage(str(folder / f"mins/config_{name}.yaml"), cv2.FILE_STORAGE_READ)
        self.node = self.file.getNode(section)

    def number(self, key):
        return self.node.getNode(key).real()

    def numbers(self, key):
        node = self.node.getNode(key)
        return [node.at(k).real() for k in range(node.size())]


def test_fusioncore_has_keys_that_it_declares_of_the_types_it_declares(written):
    place = ["--set", "latitude_deg=48", "--set", "longitude_deg=11.5", "--set", "height=500"]
    wheels = ["--wheels", "f1tenth", "--set", "wheels.side_slip_sigma=0.07"]
    rig = ["--imu", "icm42688p", "--gnss", "trimble_5700", *wheels]
    parameters = fusioncore(written(*rig, *place, *TURNED))
    for kind, keys in FUSIONCORE.items():
        assert {key for key, value in parameters.items() if type(value) is kind} == set(
            keys.split()
        )
    assert (parameters["encoder.topic"], parameters["gnss.fix_topic"]) == (
        "/wheel/odom",
        "/gps/fix",
    )
    assert (parameters["motion_model"], parameters["encoder.nhc_vy_sigma"]) == ("Ackermann", 0.07)
    assert [parameters[f"imu.lever_arm_{axis}"] for axis in "xyz"] == [0.1, 0.0, 0.2]
    assert [parameters[f"gnss.lever_arm_{axis}"] for axis in "xyz"] == [0.3, 0.0, 1.0]
    # Of the world's origin; twelve digits leave ten micrometres.
    expected = pymap3d.geodetic2ecef(48.0, 11.5, 500.0)
    np.testing.assert_allclose(
        [parameters[f"reference.{axis}"] for axis in "xyz"], expected, atol=2e-5
    )


def test_mins_has_every_key_that_it_requires(written):
    """And in each file that config.yaml names nothing else is read."""
    wheels = ["--wheels", "turtlebot3_burger", "--set", "wheels.radius_sigma_percent=2.0"]
    folder = written("--imu", "icm42688p", "--gnss", "zed_f9p", *wheels, *TURNED)
    config = cv2.FileStorage(str(folder / "mins/config.yaml"), cv2.FILE_STORAGE_READ)
    assert list(config.root().keys()) == [f"config_{name}" for name in MINS]
    for name, text in MINS.items():
        section, *keys = text.split()
        file = Mins(folder, name, section)
        assert sorted(file.node.keys()) == sorted(keys), name
        assert all(not file.node.getNode(key).empty() for key in keys)
    gps = Mins(folder, "gps", "gps0")
    assert sorted(gps.node.keys()) == ["pGinI", "timeoffset", "topic"]
    np.testing.assert_allclose(gps.numbers("pGinI"), [0.0, -0.2, 0.8], atol=1e-12)
    wheel = Mins(folder, "wheel", "wheel")
    assert wheel.node.getNode("type").string() == "Wheel3DAng"
    assert wheel.node.getNode("sub_topics").string() == "wheel_left_joint, wheel_right_joint"
    assert wheel.numbers("intrinsics") == [0.033, 0.033, 0.16]
    # Half of the interval of 20 Hz (the preset's rate) before the stamp.
    assert wheel.number("timeoffset") == -0.5 / 20
    assert wheel.number("init_cov_in_r") == pytest.approx((0.02 * 0.033) ** 2)
    matrix = wheel.node.getNode("T_imu_wheel")
    rows = [[matrix.at(i).at(j).real() for j in range(4)] for i in range(4)]
    expected = [[0, 1, 0, 0], [-1, 0, 0, 0.1], [0, 0, 1, -0.2], [0, 0, 0, 1]]
    np.testing.assert_allclose(rows, expected, atol=1e-12)


def test_stamps_of_other_clocks_are_told_to_mins(written):
    """An IMU's stamp is 5 ms late, a receiver's 20 ms: those of the receiver have to lose 15."""
    late = ["--set", "imu.stamp_offset=0.005", "--set", "gnss.stamp_offset=0.02"]
    folder = written("--gnss", "phone", *late)
    assert Mins(folder, "gps", "gps0").number("timeoffset") == pytest.approx(-0.015)
    assert not (folder / "mins/config_wheel.yaml").exists()
    assert "  imu_only_init: true\n" in (folder / "mins/config_init.yaml").read_text()


def test_the_noise_of_wheels_is_that_of_their_rates(written):
    """Per sample ``density sqrt(rate)``, of 3000 readings at 1 m/s straight ahead.

    Counts are anticorrelated, so that the squares of neighbours are too: 2.2 % for one deviation of
    their sum at most (1 / sqrt(2 n) without, times sqrt(1.5)); five of these.
    """
    folder = written("--wheels", "turtlebot3_burger", "--set", "wheels.rate=50")
    density = Mins(folder, "wheel", "wheel").number("noise_w")
    motion = {"type": "harmonic", "x": {"polynomial": [0.0, 1.0]}}
    settings = {"preset": "turtlebot3_burger", "rate": 50.0, "true_radii": [0.033, 0.033]}
    wheels = ims.simulate(
        imu="perfect", trajectory=motion, duration=60, rate=50, sensors=["wheels"], wheels=settings
    ).wheels
    error = (wheels.speed - 1.0 / 0.033)[1:]
    assert error.std() == pytest.approx(density * np.sqrt(50.0), rel=0.08)


def test_only_what_the_body_has_is_configured(written):
    folder = written("--wheels", "rosbot_xl")
    parameters = fusioncore(folder)
    assert not any(key.startswith(("gnss.", "reference.")) for key in parameters)
    assert parameters["motion_model"] == "ConstantVelocityAcceleration"
    assert parameters["encoder.nhc_auto_detect"] is True
    # MINS has no model of wheels that go sideways.
    assert {path.name for path in (folder / "mins").iterdir()} == {
        *("config.yaml", "config_system.yaml", "config_estimator.yaml", "config_imu.yaml"),
        "config_init.yaml",
    }
