# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A data set for a VIO stack: the same flight as a ROS 1 bag, an MCAP file and EuRoC's folder.

Feature tracks and images come from `generate --camera euroc_cam0 --format tracks`.

    python examples/vio_dataset.py [FOLDER]
"""

import sys
from pathlib import Path

import imu_sim_ros as ims

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
# Two seconds of rest and a jerk come first: OpenVINS initialises from them.
motion = {"type": "excitation", "lead_in": {"rest": 2.0}}
flight = ims.simulate(imu="adis16448", trajectory=motion, duration=30, rate=200, seed=7)
print(flight)

names = {"imu/data_raw": "/imu0", "ground_truth/odom": "/odom"}
bag = flight.save(folder / "flight.bag", rename=names)  # VINS-Mono, kalibr, rosbag play
flight.save(folder / "flight.mcap", rename=names)  # VINS-Fusion and OpenVINS on ROS 2
flight.save(folder / "mav0", format="euroc")  # ORB_SLAM3, Basalt
print("readings:", ims.read_imu(bag, "/imu0"))
print("truth:", ims.read_odometry(bag, "/odom"))

# The sensor's noise for the estimator, in kalibr's format.
rest = ims.simulate(imu="adis16448", trajectory="static", duration="10min", rate=200, seed=7)
print("kalibr:", ims.allan(rest).save(folder / "imu.yaml", topic="/imu0").name)
flight.plot().savefig(folder / "vio_dataset.png", dpi=120)
