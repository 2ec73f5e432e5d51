# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MINS: a folder with ``config.yaml`` and the files that it names, for IMU, GNSS and wheels.

Keys and meanings from mins/src/options and mins/src/update. Sensors without a file are off.
"""

from typing import Final

import numpy as np

from imu_sim_ros.core.rotation import pose_matrix
from imu_sim_ros.datasets.consumers.aiding import SPEED, Aiding
from imu_sim_ros.datasets.consumers.rig import yaml_list
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import comment, rows, yaml_float
from imu_sim_ros.simulation.topics import resolve_topic

_PARTS: Final = ("system", "estimator", "imu", "init", "gps", "wheel")
_MIN_SIGMA: Final = 1e-8
"""Standard deviation of a calibrated quantity that is known exactly."""


def files(subject: Subject) -> dict[str, str]:
    """Return the files of the folder ``mins`` for GNSS or wheels."""
    body = subject.aiding
    if body is None:
        return {}
    parts = {
        "system": _system(),
        "estimator": _estimator(body),
        "imu": _imu(body),
        "init": _init(body),
        "gps": _gps(body),
        "wheel": _wheel(body),
    }
    names = [name for name in _PARTS if parts[name]]
    whole = "".join(f'config_{name}: "config_{name}.yaml"\n' for name in names)
    head = comment(
        [
            "MINS, whole: rosrun mins bag config.yaml _sys_path_bag:=BAG. Written against its "
            "sources; it has not been run with them here.",
            "Cameras and LiDARs are off: add config_camera.yaml or config_lidar.yaml to use them.",
        ]
    )
    texts = {"mins/config.yaml": f"%YAML:1.0\n{head}{whole}"}
    for name in names:
        texts[f"mins/config_{name}.yaml"] = f"%YAML:1.0\n{parts[name]}"
    return texts


def _section(name: str, values: dict[str, str]) -> str:
    """Return a YAML section; a value that begins with a line break starts on the next line."""
    lines = (
        f"  {key}:{value}\n" if value.startswith("\n") else f"  {key}: {value}\n"
        for key, value in values.items()
    )
    return f"{name}:\n" + "".join(lines)


def _system() -> str:
    """Return the file of MINS that names the bag and the outputs."""
    head = comment(
        [
            "path_bag: give it as parameter sys_path_bag of the node. bag_durr: -1 is all of it.",
            "mins_output is made where MINS is started.",
        ]
    )
    return head + _section(
        "sys",
        {
            "verbosity": "2",
            "save_timing": "false",
            "path_timing": '"mins_output/timing.txt"',
            "save_state": "false",
            "path_state": '"mins_output/state/"',
            "save_trajectory": "true",
            "path_trajectory": '"mins_output/trajectory.txt"',
            "save_prints": "false",
            "exp_id": "0",
            "path_bag": '""',
            "bag_start": "0",
            "bag_durr": "-1",
        },
    )


def _estimator(body: Aiding) -> str:
    """Return the file of MINS about the estimator."""
    head = comment(
        [
            "Poses between clones come from the IMU (use_imu_res); the tables intr_ori and "
            "intr_pos, for cameras and dynamic cloning, are not here.",
        ]
    )
    return head + _section(
        "est",
        {
            "gravity_mag": yaml_float(body.values.gravity),
            "clone_freq": "20",
            "window_size": "1.0",
            "intr_order": "3",
            "intr_error_mlt": "1.0",
            "intr_error_ori_thr": "0.007",
            "intr_error_pos_thr": "0.003",
            "intr_error_thr_mlt": "1.0",
            "dt_extrapolation": "0.01",
            "use_imu_res": "true",
            "use_imu_cov": "false",
            "use_pol_cov": "false",
            "dynamic_cloning": "false",
        },
    )


def _imu(body: Aiding) -> str:
    """Return MINS' file about the IMU: densities, and the topic."""
    head = comment(["Continuous-time densities in kalibr's units."])
    densities = body.values.positive_densities()
    names = {
        "accel_noise": "accelerometer_noise_density",
        "accel_bias": "accelerometer_random_walk",
        "gyro_noise": "gyroscope_noise_density",
        "gyro_bias": "gyroscope_random_walk",
    }
    values = {key: yaml_float(densities[name]) for key, name in names.items()}
    return head + _section("imu", {**values, "topic": f'"{body.values.topic}"'})


def _init(body: Aiding) -> str:
    """Return the file of MINS about the initialisation."""
    head = comment(
        [
            "With wheels it starts from IMU and wheels, standing or moving; without, from a rest "
            "and a jerk after it (trajectory.lead_in.rest).",
        ]
    )
    return head + _section(
        "init",
        {
            "window_time": "1.0",
            "imu_thresh": "0.5",
            "imu_wheel_thresh": "0.05",
            "imu_only_init": str(not _is_planar(body)).lower(),
            "imu_gravity_aligned": "false",
            "use_gt": "false",
            "use_gt_gnss": "false",
            "use_gt_lidar": "false",
            "cov_size": "1e-4",
        },
    )


def _is_planar(body: Aiding) -> bool:
    """Return whether the body has wheels of a kind that MINS models."""
    return body.wheels is not None and body.wheels.model != "omnidirectional"


def _gps(body: Aiding) -> str:
    """Return the file of MINS about GNSS; empty without a receiver."""
    p = body.gnss
    if p is None:
        return ""
    horizontal, vertical = body.position_sigma
    head = comment(
        [
            "noise [m]: it takes the covariances of NavSatFix for standard deviations "
            "(ROSHelper::NavSatFix2Data, UpdaterGPS: R = noise^2), so that they are overwritten "
            "with what the receiver states at the start; of heights it takes twice the number, "
            f"stated are {yaml_float(vertical)} m. Changes of mode are not followed.",
            "It aligns the world with east and north itself, after init_distance [m].",
        ]
    )
    common = {
        "enabled": "true",
        "max_n": "1",
        "do_calib_ext": "false",
        "do_calib_dt": "false",
        "init_distance": "20.0",
        "init_closed_form": "true",
        "init_cov_dt": "1e-3",
        "init_cov_ex": "1e-3",
        "init_cov_inflation": "2.0",
        "chi2_mult": "1",
        "overwrite_noise": "true",
        "noise": yaml_float(horizontal),
    }
    sensor_values = {
        "timeoffset": yaml_float(body.stamp_correction(p)),
        "pGinI": yaml_list(body.point_in_imu(p.lever_arm).tolist()),
        "topic": f'"{resolve_topic("gps/fix")}"',
    }
    return head + _section("gps", common) + _section("gps0", sensor_values)


def _wheel(body: Aiding) -> str:
    """Return the file of MINS about wheels; empty without wheels on a plane."""
    p = body.wheels
    if p is None or not _is_planar(body):
        return ""
    head = comment(
        [
            f"noise_w [rad/s/sqrt(Hz)]: counts and random slip at {SPEED:g} m/s; noise_p: the "
            "stated side_slip_sigma as a density. Slip in turns and on patches is not in them.",
            "timeoffset: speeds are means over the interval before a stamp, which it takes for "
            "those of the stamp.",
            "Rates and base are those of the wheels that joint_states names first, left and right.",
        ]
    )
    share_r, share_b = 0.01 * p.radius_sigma_percent, 0.01 * p.base_sigma_percent
    rotation = body.rotation() @ np.reshape(p.mounting, (3, 3))
    pose = pose_matrix(rotation, body.point_in_imu(p.lever_arm))
    density = body.wheel_speed_density
    values = {
        "enabled": "true",
        "type": '"Wheel3DAng"',
        "do_calib_dt": "false",
        "do_calib_ext": "false",
        "do_calib_int": str(bool(share_r or share_b)).lower(),
        "noise_w": yaml_float(density),
        "noise_v": yaml_float(density * p.radius),
        "noise_p": yaml_float(p.side_slip_sigma / p.rate**0.5),
        "init_cov_dt": "1e-4",
        "init_cov_ex_o": "1e-4",
        "init_cov_ex_p": "1e-3",
        "init_cov_in_b": yaml_float(max((share_b * p.track) ** 2, _MIN_SIGMA)),
        "init_cov_in_r": yaml_float(max((share_r * p.radius) ** 2, _MIN_SIGMA)),
        "chi2_mult": "1",
        "timeoffset": yaml_float(body.stamp_correction(p, 0.5 / p.rate)),
        "intrinsics": yaml_list([p.radius, p.radius, p.track]),
        "reuse_of_information": "false",
        "T_imu_wheel": "\n" + rows(pose, "    ").rstrip("\n"),
        "topic": f'"{resolve_topic("joint_states")}"',
        "sub_topics": f'"{", ".join(p.joints[:2])}"',
    }
    return head + _section("wheel", values)
