# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags with random content in every form."""

from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import (
    IMU,
    ODOMETRY,
    TEMPERATURE,
    VECTOR3_STAMPED,
    ImuEncoder,
    OdometryEncoder,
    TemperatureEncoder,
    Vector3StampedEncoder,
)
from imu_sim_ros.bags.writer import BagOptions, Block

COUNT = 4500
FORMS = {
    "none.mcap": ("mcap", "none"),
    "lz4.mcap": ("mcap", "lz4"),
    "zstd.mcap": ("mcap", "zstd"),
    "folder_mcap": ("mcap", "zstd"),
    "folder_sqlite3": ("sqlite3", "none"),
    "none.bag": ("ros1", "none"),
    "lz4.bag": ("ros1", "lz4"),
    "bz2.bag": ("ros1", "bz2"),
}


class Content:
    """Random readings and states; the states lie between the readings in time."""

    def __init__(self, count: int = COUNT, seed: int = 7) -> None:
        rng = np.random.default_rng(seed)
        self.t_ns = 10**9 + 5_000_000 * np.arange(count)
        self.truth_t_ns = self.t_ns + 2_500_000
        self.gyro, self.accel, self.position = rng.standard_normal((3, count, 3))
        q_wb = rng.standard_normal((count, 4))
        self.q_wb = q_wb / np.linalg.norm(q_wb, axis=1, keepdims=True)
        self.temperature = rng.uniform(-20.0, 60.0, count)

    def write(self, writer, block_size: int = 2500) -> None:
        """Write everything into a bag."""
        imu = ImuEncoder("imu_link", writer.encoding, 1e-4, (1.0, 2.0, 3.0))
        odometry = OdometryEncoder("world", "base_link", writer.encoding)
        thermometer = TemperatureEncoder("imu_link", writer.encoding)
        vectors = Vector3StampedEncoder("imu_link", writer.encoding)
        topics = [
            writer.add_topic(name, type_name)
            for name, type_name in (
                ("/imu/data_raw", IMU),
                ("/ground_truth/odom", ODOMETRY),
                ("/imu/temperature", TEMPERATURE),
                ("/vector", VECTOR3_STAMPED),
            )
        ]
        for start in range(0, len(self.t_ns), block_size):
            s = slice(start, start + block_size)
            t, later = self.t_ns[s], self.truth_t_ns[s]
            payloads = [
                imu.encode(t, self.gyro[s], self.accel[s]),
                odometry.encode(later, self.position[s], self.q_wb[s], self.gyro[s], self.accel[s]),
                thermometer.encode(t, self.temperature[s]),
                vectors.encode(later, self.accel[s]),
            ]
            times = [t, later, t, later]
            writer.write_blocks(
                [Block(*block) for block in zip(topics, times, payloads, strict=True)]
            )


@pytest.fixture(scope="session")
def content() -> Content:
    return Content()


@pytest.fixture(scope="session")
def bags(tmp_path_factory, content) -> dict[str, Path]:
    """Return the paths of bags with the same content in each form, by name."""
    folder = tmp_path_factory.mktemp("bags")
    for name, (storage, compression) in FORMS.items():
        with open_writer(folder / name, BagOptions(storage, compression)) as writer:
            content.write(writer)
    return {name: folder / name for name in FORMS}


@pytest.fixture(params=list(FORMS))
def form(request) -> str:
    return request.param
