# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""OpenVINS: ``estimator_config.yaml``, ``kalibr_imu_chain.yaml`` and ``kalibr_imucam_chain.yaml``.

Keys and meanings from ov_msckf/src/core/VioManagerOptions.h and ov_core/utils/opencv_yaml_parse.h.
"""

from typing import Final

import numpy as np

from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.core.types import Array
from imu_sim_ros.datasets.consumers.rig import (
    REST_THRESHOLD,
    RigValues,
    four_coefficients,
    lens_kind,
    yaml_list,
)
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import ImuValues, comment, number_notes, rows, yaml_float

_EXPRESSED: Final = (
    "gyroscope_scale_misalignment",
    "accelerometer_scale_misalignment",
    "gyroscope_g_sensitivity",
)

_ESTIMATOR: Final = {
    "verbosity": '"INFO"',
    "use_fej": "true",
    "integration": '"rk4"',
    "use_imuavg": "true",
    "use_rk4int": "true",
    "use_stereo": "true",
    "max_cameras": "2",
    "calib_cam_extrinsics": "false",
    "calib_cam_intrinsics": "false",
    "calib_cam_timeoffset": "true",
    "calib_imu_intrinsics": "false",
    "calib_imu_g_sensitivity": "false",
    "max_clones": "11",
    "max_slam": "50",
    "max_slam_in_update": "25",
    "max_msckf_in_update": "40",
    "dt_slam_delay": "1",
    "gravity_mag": "9.81",
    "feat_rep_msckf": '"GLOBAL_3D"',
    "feat_rep_slam": '"ANCHORED_MSCKF_INVERSE_DEPTH"',
    "feat_rep_aruco": '"ANCHORED_MSCKF_INVERSE_DEPTH"',
    "try_zupt": "false",
    "zupt_chi2_multipler": "0",
    "zupt_max_velocity": "0.1",
    "zupt_noise_multiplier": "10",
    "zupt_max_disparity": "0.5",
    "zupt_only_at_beginning": "false",
    "init_window_time": "2.0",
    "init_imu_thresh": "1.5",
    "init_max_disparity": "10.0",
    "init_max_features": "75",
    "init_dyn_use": "false",
    "init_dyn_mle_opt_calib": "false",
    "init_dyn_mle_max_iter": "50",
    "init_dyn_mle_max_time": "0.05",
    "init_dyn_mle_max_threads": "6",
    "init_dyn_num_pose": "6",
    "init_dyn_min_deg": "10.0",
    "init_dyn_inflation_ori": "10",
    "init_dyn_inflation_vel": "100",
    "init_dyn_inflation_bg": "10",
    "init_dyn_inflation_ba": "100",
    "init_dyn_min_rec_cond": "1.0e-12",
    "init_dyn_bias_g": "[0.0, 0.0, 0.0]",
    "init_dyn_bias_a": "[0.0, 0.0, 0.0]",
    "record_timing_information": "false",
    "record_timing_filepath": '"/tmp/traj_timing.txt"',
    "save_total_state": "false",
    "filepath_est": '"/tmp/ov_estimate.txt"',
    "filepath_std": '"/tmp/ov_estimate_std.txt"',
    "filepath_gt": '"/tmp/ov_groundtruth.txt"',
    "use_klt": "true",
    "num_pts": "200",
    "fast_threshold": "20",
    "grid_x": "5",
    "grid_y": "5",
    "min_px_dist": "10",
    "knn_ratio": "0.70",
    "track_frequency": "21.0",
    "downsample_cameras": "false",
    "num_opencv_threads": "4",
    "histogram_method": '"HISTOGRAM"',
    "use_aruco": "false",
    "num_aruco": "1024",
    "downsize_aruco": "true",
    "up_msckf_sigma_px": "1",
    "up_msckf_chi2_multipler": "1",
    "up_slam_sigma_px": "1",
    "up_slam_chi2_multipler": "1",
    "up_aruco_sigma_px": "1",
    "up_aruco_chi2_multipler": "1",
    "use_mask": "false",
    "relative_config_imu": '"kalibr_imu_chain.yaml"',
    "relative_config_imucam": '"kalibr_imucam_chain.yaml"',
}
"""Values of config/euroc_mav/estimator_config.yaml; ``integration`` is read by version 2.7, the two
keys after it by earlier versions."""


def files(subject: Subject) -> dict[str, str]:
    """Return the IMU's chain, and with cameras their chain and the estimator's configuration."""
    has_rig = subject.rig is not None and subject.rig.fits("radtan", "equidistant")
    texts = {"kalibr_imu_chain.yaml": imu_chain(subject.imu, has_rig)}
    if subject.rig is not None and has_rig:
        texts["kalibr_imucam_chain.yaml"] = imucam_chain(subject.rig)
        texts["estimator_config.yaml"] = estimator_config(subject.rig)
    return texts


def triangular_and_rotation(response: Array) -> tuple[Array, Array]:
    """Return T and R with ``S = T R``: T lower triangular, R a rotation.

    OpenVINS' model ``kalibr`` reads ``w_m = T_w R_IMUtoGYRO w + T_g a + b`` (Simulator.cpp) and
    keeps nothing but the lower triangle of T's inverse: a full S has to be divided between the two.

    :param response: (3, 3) S, invertible.
    """
    q, r = np.linalg.qr(response.T)  # S^T = Q R, so S = R^T Q^T
    signs = np.where(np.diag(r) < 0.0, -1.0, 1.0)
    # A triangular S keeps its exact digits.
    if not np.triu(response, 1).any() and (np.diag(response) > 0.0).all():
        return response, np.eye(3)
    return np.tril(r.T * signs), signs[:, None] * q.T


def imu_chain(values: ImuValues, has_rig: bool = False) -> str:
    """Return OpenVINS' kalibr_imu_chain.yaml.

    :param has_rig: True if the camera chain, which has the time shift, is written next to it.
    """
    shift = ("stamp_offset",) if has_rig else ()
    head = comment(
        [
            "OpenVINS kalibr_imu_chain.yaml, whole: continuous-time densities in kalibr's units, "
            "as the simulation has them.",
            "w_m = Tw R_IMUtoGYRO w + Tg a + b and a_m = Ta R_IMUtoACC a + b",
            *number_notes(values, (*_EXPRESSED, *shift), above_zero=True),
        ]
    )
    densities = "".join(
        f"  {name}: {decimal(value)}\n" for name, value in values.positive_densities().items()
    )
    tw, r_gyro = triangular_and_rotation(values.response("gyroscope"))
    ta, r_acc = triangular_and_rotation(values.response("accelerometer"))
    tg = np.reshape(values.axes("gyroscope_g_sensitivity"), (3, 3))
    intrinsics = "".join(
        f"  {name}:\n{rows(matrix, '    ')}"
        for name, matrix in (
            ("Tw", tw),
            ("R_IMUtoGYRO", r_gyro),
            ("Ta", ta),
            ("R_IMUtoACC", r_acc),
            ("Tg", tg),
        )
    )
    return (
        f"%YAML:1.0\n{head}imu0:\n  T_i_b:\n{rows(np.eye(4), '    ')}{densities}"
        f"  rostopic: {values.topic}\n  time_offset: 0.0\n"
        f'  update_rate: {decimal(values.rate)}\n  model: "kalibr"\n{intrinsics}'
    )


def imucam_chain(rig: RigValues) -> str:
    """Return kalibr_imucam_chain.yaml; ``T_imu_cam`` maps from the camera to the IMU."""
    head = comment(
        [
            "OpenVINS kalibr_imucam_chain.yaml, whole: the cameras as they are simulated.",
            *rig.remarks(("time_offset",), one_shift="OpenVINS"),
        ]
    )
    text = f"%YAML:1.0\n{head}"
    for number, (name, camera) in enumerate(rig.cameras.items()):
        overlaps = [k for k in range(len(rig.cameras)) if k != number]
        text += (
            f"cam{number}:\n  T_imu_cam:\n{rows(rig.imu_camera(name), '    ')}"
            f"  cam_overlaps: {overlaps}\n  camera_model: pinhole\n"
            f"  distortion_coeffs: {yaml_list(four_coefficients(camera))}\n"
            f"  distortion_model: {lens_kind(camera)}\n"
            f"  intrinsics: {yaml_list(camera.intrinsics)}\n"
            f"  resolution: [{camera.width}, {camera.height}]\n"
            f"  rostopic: {rig.topics[name]}\n"
            f"  timeshift_cam_imu: {yaml_float(rig.time_shift(name))}\n"
        )
    return text


def estimator_config(rig: RigValues) -> str:
    """Return estimator_config.yaml: EuRoC's settings, changed where the simulation differs."""
    count = len(rig.cameras)
    fastest = max(camera.rate for camera in rig.cameras.values())
    head = comment(
        [
            "OpenVINS estimator_config.yaml, whole. Estimator and front end as for EuRoC.",
            "init_imu_thresh: EuRoC's 1.5 never fires on a simulated IMU, which no rotor shakes: "
            "a second's accelerometer deviation is 0.07 at rest and 1.3 at most in its flights. "
            "0.5 fires; it needs 2 s of rest and then a jerk (trajectory.lead_in). On tours with "
            "the cameras of EuRoC, init_max_disparity has to be 5, and 3 in the street: features "
            "move little in the second of the jerk, in proportion to the focal length. A tour "
            "that begins gently (trajectory.rest_before) needs 5, in the street 2, and an "
            "init_imu_thresh of 0.1, which must be above the accelerometer's deviation at rest; "
            "that of this one is "
            f"{rig.imu.rest_deviation:.2g}.",
            "Extrinsics and intrinsics are exact, so only the time offset is estimated.",
            *rig.start_remarks("OpenVINS"),
            *rig.remarks(("time_offset",), one_shift="OpenVINS"),
        ]
    )
    changed = {
        "use_stereo": "true" if count > 1 else "false",
        "max_cameras": str(count),
        "gravity_mag": decimal(rig.imu.gravity),
        "init_imu_thresh": decimal(REST_THRESHOLD),
        "track_frequency": decimal(fastest + 1.0),
    }
    lines = "".join(f"{key}: {value}\n" for key, value in {**_ESTIMATOR, **changed}.items())
    return f"%YAML:1.0\n{head}{lines}"
