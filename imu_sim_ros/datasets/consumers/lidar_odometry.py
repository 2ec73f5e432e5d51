# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""LiDAR stacks: KISS-ICP 1.3.0, RKO-LIO 0.4.0, FAST-LIO2 (7cc4175), LIO-SAM (0be1fbe)."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from imu_sim_ros.core.conventions import IMU_TOPIC
from imu_sim_ros.core.rotation import from_matrix
from imu_sim_ros.core.types import Array
from imu_sim_ros.datasets.consumers.rig import yaml_list
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import ImuValues, comment, number_notes, yaml_float
from imu_sim_ros.sensors.lidar.declaration import CUSTOM_TOPIC, TOPIC
from imu_sim_ros.sensors.lidar.parameters import LidarParameters
from imu_sim_ros.sensors.lidar.pattern import build_pattern
from imu_sim_ros.sensors.orientation.declaration import TOPIC as NINE_AXES
from imu_sim_ros.simulation.parameters import SimulationParameters
from imu_sim_ros.simulation.topics import resolve_topic

_FAST_LIO: Final = {"livox": (1, 3), "velodyne": (2, 0), "ouster": (3, 3)}
"""lidar_type and timestamp_unit (0: s, 3: ns) of the layouts that FAST-LIO2 reads."""
_INDOORS: Final = 30.0
"""Range below which a LiDAR is assumed to be used in rooms [m]."""


@dataclass(frozen=True)
class Ranging:
    """One LiDAR and one IMU of a body."""

    values: ImuValues
    lidar: LidarParameters
    space: str
    """Namespace of the LiDAR's topics, with a slash, if there are several LiDARs."""
    frame: str
    """Frame of the LiDAR's clouds."""

    @property
    def topic(self) -> str:
        """Full name of the topic of the LiDAR's clouds."""
        return resolve_topic(f"{self.space}{TOPIC}")

    @property
    def farthest(self) -> float:
        """Range at which white surfaces are detected [m]."""
        lidar = self.lidar
        detected = lidar.detection_range / math.sqrt(lidar.detection_reflectivity) or math.inf
        return min(lidar.maximum_range, detected)

    @property
    def voxel(self) -> float:
        """Size of a voxel of maps [m]."""
        return 0.3 if self.farthest < _INDOORS else 0.5

    def rays_per_ring(self) -> list[int]:
        """Return the number of rays of a scan in each ring."""
        rays: list[int] = np.bincount(build_pattern(self.lidar).ring).tolist()
        return rays

    def pose(self) -> tuple[Array, Array]:
        """Return R_bl (3, 3) and p_bl (3,), the pose of the LiDAR in the body."""
        return np.reshape(self.lidar.mounting, (3, 3)), np.asarray(self.lidar.lever_arm)

    def imu_pose(self) -> tuple[Array, Array]:
        """Return R_bi (3, 3) and p_bi (3,), the pose of the IMU in the body."""
        imu = self.values.imu
        return np.reshape(imu.mounting, (3, 3)), np.asarray(imu.lever_arm)

    def pose_in_imu(self) -> tuple[Array, Array]:
        """Return R_il (3, 3) and p_il (3,), the pose of the LiDAR in the IMU's frame."""
        (r_bl, p_bl), (r_bi, p_bi) = self.pose(), self.imu_pose()
        return r_bi.T @ r_bl, r_bi.T @ (p_bl - p_bi)


def files(subject: Subject) -> dict[str, str]:
    """Return the texts of the files for each LiDAR; those of further LiDARs end in its name."""
    values, parameters = subject.imu, subject.parameters
    texts: dict[str, str] = {}
    if parameters is None:
        return texts
    for name, lidar in parameters.each_sensor.items():
        if not isinstance(lidar, LidarParameters):
            continue
        frame = lidar.own_frame(name, parameters.body_frame)
        ranging = Ranging(values, lidar, f"{name}/" if lidar.type else "", frame)
        stacks = {"kiss_icp": _kiss_icp(ranging), "rko_lio": _rko_lio(ranging)}
        if lidar.layout in _FAST_LIO:
            stacks["fast_lio"] = _fast_lio(ranging)
        if lidar.layout == "velodyne" or (lidar.layout == "ouster" and lidar.pattern == "spinning"):
            stacks["lio_sam"] = _lio_sam(ranging, parameters)
        texts.update(
            {f"{k}_{name}.yaml" if lidar.type else f"{k}.yaml": v for k, v in stacks.items()}
        )
    return texts


def _list(numbers: Array) -> str:
    """Return an array as a flat YAML list, row by row."""
    return yaml_list((np.ravel(numbers) + 0.0).tolist())  # -0 becomes 0


def _kiss_icp(ranging: Ranging) -> str:
    """Return the text of KISS-ICP's configuration file for a LiDAR."""
    head = comment(
        [
            f"KISS-ICP 1.3.0: kiss_icp_pipeline BAG --topic {ranging.topic} --config this file; it "
            "is run so in the tests. It uses no IMU: it expects of each scan the motion of the one "
            "before.",
        ]
    )
    return (
        f"{head}data:\n  deskew: true\n  max_range: {yaml_float(ranging.farthest)}\n"
        f"  min_range: {yaml_float(ranging.lidar.minimum_range)}\n"
        f"mapping:\n  voxel_size: {yaml_float(ranging.voxel)}\n  max_points_per_voxel: 20\n"
    )


def _rko_lio(ranging: Ranging) -> str:
    """Return the text of RKO-LIO's configuration file for a LiDAR and an IMU."""
    head = comment(
        [
            f"RKO-LIO 0.4.0: rko_lio FOLDER --config this file --imu {ranging.values.topic} "
            f"--lidar {ranging.topic}, with a rosbag2 folder; it is run so in the tests. Estimates "
            "are of the body. With initialization_phase it takes the first readings for gravity "
            "and biases, which needs a start at rest; without, it starts level.",
            *number_notes(ranging.values),
        ]
    )
    lines = []
    for name, (rotation, position) in (("imu", ranging.imu_pose()), ("lidar", ranging.pose())):
        w, x, y, z = from_matrix(rotation).tolist()
        lines.append(
            f"extrinsic_{name}2base_quat_xyzw_xyz: {_list(np.array([x, y, z, w, *position]))}\n"
        )
    return (
        f"{head}{''.join(lines)}lio:\n  deskew: true\n  voxel_size: {yaml_float(ranging.voxel)}\n"
        f"  max_range: {yaml_float(ranging.farthest)}\n  min_range: "
        f"{yaml_float(ranging.lidar.minimum_range)}\n"
        "  initialization_phase: false\n"
    )


def _fast_lio(ranging: Ranging) -> str:
    """Return the text of FAST-LIO2's configuration file for a LiDAR and an IMU."""
    kind, unit = _FAST_LIO[ranging.lidar.layout]
    lidar, values = ranging.lidar, ranging.values
    livox = lidar.layout == "livox"
    rotation, position = ranging.pose_in_imu()
    head = comment(
        [
            "FAST-LIO2, a config for ROS 1, in place of that of its launch file; with ROS 2, under "
            "/**: ros__parameters. Run by hand with ROS 1. The simulation has to begin at rest "
            "(trajectory.rest_before). Estimates are of the IMU.",
            *(
                [f"It reads {CUSTOM_TOPIC} of Livox: write it with --topics, or publish it."]
                if livox
                else []
            ),
            "Covariances are those of one reading, density^2 rate: src/IMU_Processing.hpp adds "
            "(dt G) Q (dt G)^T with each.",
            *values.delay_remarks(),
            *number_notes(values, ("stamp_offset",)),
        ]
    )
    covariances = {
        "acc_cov": "accelerometer_noise_density",
        "gyr_cov": "gyroscope_noise_density",
        "b_acc_cov": "accelerometer_random_walk",
        "b_gyr_cov": "gyroscope_random_walk",
    }
    densities = values.positive_densities()
    lines = "".join(
        f"  {key}: {yaml_float(densities[name] ** 2 * values.rate)}\n"
        for key, name in covariances.items()
    )
    topic = resolve_topic(f"{ranging.space}{CUSTOM_TOPIC}") if livox else ranging.topic
    offset = values.lateness - lidar.stamp_offset
    return (
        f'{head}common:\n  lid_topic: "{topic}"\n  imu_topic: "{values.topic}"\n'
        f"  time_sync_en: false\n  time_offset_lidar_to_imu: {yaml_float(offset)}\n"
        f"preprocess:\n  lidar_type: {kind}\n  scan_line: {len(ranging.rays_per_ring())}\n"
        f"  scan_rate: {round(lidar.rate)}\n  timestamp_unit: {unit}\n"
        f"  blind: {yaml_float(lidar.minimum_range)}\n"
        f"mapping:\n{lines}"
        f"  fov_degree: {360 if lidar.pattern in ('spinning', 'nodding') else 90}\n"
        f"  det_range: {yaml_float(ranging.farthest)}\n  extrinsic_est_en: false\n"
        f"  extrinsic_T: {_list(position)}\n  extrinsic_R: {_list(rotation)}\n"
        "publish:\n  path_en: true\n  scan_publish_en: true\n  dense_publish_en: true\n"
        "  scan_bodyframe_pub_en: true\npcd_save:\n  pcd_save_en: false\n  interval: -1\n"
    )


def _lio_sam(ranging: Ranging, parameters: SimulationParameters) -> str:
    """Return the text of LIO-SAM's parameter file for a LiDAR and a nine-axis IMU."""
    lidar, values = ranging.lidar, ranging.values
    rotation, position = ranging.pose_in_imu()
    densities = values.positive_densities()
    # LIO-SAM's "livox" reads the fields of Velodyne, and a point's place in its line as its column.
    kind = lidar.layout if lidar.pattern == "spinning" else "livox"
    rays = ranging.rays_per_ring()
    raw, nine = values.topic, values.topic.replace(IMU_TOPIC, NINE_AXES)
    head = comment(
        [
            "LIO-SAM for ROS 1 (params.yaml); with ROS 2, the same keys under /**: "
            "ros__parameters. What is missing keeps its default there. Run by hand with ROS 1. "
            "Estimates are of the LiDAR.",
            f"It needs an orientation: {nine} (publish.orientation or --topics), not {raw}. Its tf "
            "needs that of the mount, /tf_static, from its start on.",
            "imuAccNoise and the others are densities, as gtsam takes them.",
            *number_notes(values),
        ]
    )
    # R_li maps from the IMU's axes to the LiDAR's, in which the IMU's position is expressed.
    r_li, p_li = rotation.T, -(rotation.T @ position)
    numbers = {
        "lidarMinRange": lidar.minimum_range,
        "lidarMaxRange": ranging.farthest,
        "imuAccNoise": densities["accelerometer_noise_density"],
        "imuGyrNoise": densities["gyroscope_noise_density"],
        "imuAccBiasN": densities["accelerometer_random_walk"],
        "imuGyrBiasN": densities["gyroscope_random_walk"],
        "imuGravity": values.gravity,
        "imuRPYWeight": 0.01,
    }
    indoors = ranging.farthest < _INDOORS
    numbers |= {
        "odometrySurfLeafSize": 0.2 if indoors else 0.4,
        "mappingCornerLeafSize": 0.1 if indoors else 0.2,
        "mappingSurfLeafSize": 0.2 if indoors else 0.4,
    }
    lines = "".join(f"  {key}: {yaml_float(value)}\n" for key, value in numbers.items())
    frame = parameters.body_frame
    return (
        f'{head}lio_sam:\n  pointCloudTopic: "{ranging.topic}"\n  imuTopic: "{nine}"\n'
        '  odomTopic: "odometry/imu"\n  gpsTopic: "odometry/gps"\n'
        f'  lidarFrame: "{ranging.frame}"\n  baselinkFrame: "{frame}"\n'
        '  odometryFrame: "odom"\n  mapFrame: "map"\n'
        f"  sensor: {kind}\n  N_SCAN: {len(rays)}\n  Horizon_SCAN: {max(rays)}\n"
        f"  downsampleRate: 1\n{lines}"
        f"  extrinsicTrans: {_list(p_li)}\n  extrinsicRot: {_list(r_li)}\n"
        f"  extrinsicRPY: {_list(r_li)}\n"
    )
