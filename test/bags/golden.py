# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Makes the golden files in test/data/bags: run once, kept as they are; see the README there."""

import sys
from pathlib import Path

import numpy as np

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY, ImuEncoder, OdometryEncoder
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.writer import BagOptions, Block
from imu_sim_ros.core.records import States

COUNT = 12
K = np.arange(COUNT)
T_NS = 1_700_000_000_000_000_000 + 5_000_000 * K
GYRO = np.stack([K / 8.0, -K / 3.0, K * 1e-7], axis=1)
ACCEL = np.stack([K * 0.1, np.sqrt(K), 9.81 - K / 1024.0], axis=1)
POSITION = np.stack([K * 1.5, -K * 0.25, K * K / 7.0], axis=1)
Q_WB = np.where(K[:, None] % 2 == 0, [0.6, 0.8, 0.0, 0.0], [0.8, 0.0, -0.6, 0.0])
FORMS = {
    "golden.mcap": ("mcap", "none"),
    "golden_lz4.mcap": ("mcap", "lz4"),
    "golden_zstd.mcap": ("mcap", "zstd"),
    "golden.bag": ("ros1", "none"),
    "golden_lz4.bag": ("ros1", "lz4"),
    "golden_bz2.bag": ("ros1", "bz2"),
    "golden_sqlite3": ("sqlite3", "none"),
}


def write_bag(path: Path, storage: str, compression: str) -> None:
    """Write the golden content into a bag."""
    with open_writer(path, BagOptions(storage, compression)) as writer:
        # The files are older than the counting of header.seq: it stays the 0 of the payloads.
        imu = writer.add_topic("/imu/data_raw", IMU, keeps_seq=True)
        truth = writer.add_topic("/ground_truth/odom", ODOMETRY, keeps_seq=True)
        readings = ImuEncoder("imu_link", writer.encoding, 1e-4, 2e-4)
        states = OdometryEncoder("world", "base_link", writer.encoding)
        writer.write_blocks(
            [
                Block(imu, T_NS, readings.encode(T_NS, GYRO, ACCEL)),
                Block(truth, T_NS, states.encode(T_NS, POSITION, Q_WB, GYRO, ACCEL)),
            ]
        )


def write_text(path: Path, form: str) -> None:
    """Write the golden content as text."""
    with Dataset(path, form) as dataset:
        dataset.write_imu(T_NS, GYRO, ACCEL)
        dataset.write_states(States(T_NS, POSITION, Q_WB, GYRO), np.hstack([GYRO, ACCEL]))


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    for name, form in FORMS.items():
        write_bag(folder / name, *form)
    write_text(folder / "golden_euroc", "euroc")
    write_text(folder / "golden_csv", "csv")
