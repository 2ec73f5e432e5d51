# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics on which some messages lack a triad: zeros beside a covariance of -1 are no readings."""

import numpy as np
import pytest

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.read import read_imu
from imu_sim_ros.bags.writer import BagOptions
from imu_sim_ros.commands import add_errors
from imu_sim_ros.core.errors import InputError

COUNT = 200
BOTH, GYROSCOPE, ACCELEROMETER = (0.0, 0.0), (0.0, -1.0), (-1.0, 0.0)


def bag(path, kinds):
    """Write a message of each kind: the first numbers of both covariances."""
    t_ns = 10**9 + 5_000_000 * np.arange(len(kinds))
    with open_writer(path, BagOptions()) as writer:
        topic = writer.add_topic("/imu", IMU)
        for stamp_ns, (gyro, accel) in zip(t_ns, kinds, strict=True):
            encoder = ImuEncoder("imu_link", writer.encoding, gyro, accel)
            gravity = [[0.0, 0.0, 9.81 if accel == 0.0 else 0.0]]
            stamp = np.array([stamp_ns])
            writer.write(topic, stamp, encoder.encode(stamp, np.zeros((1, 3)), gravity))
    return path


@pytest.mark.parametrize("name", ["a.mcap", "a.bag"])
@pytest.mark.parametrize(
    ("kinds", "line", "missing"),
    [
        (
            [GYROSCOPE, ACCELEROMETER] * (COUNT // 2),
            r"message \d has the (\w+) alone \(covariance -1\), most messages have the (\w+) alone",
            COUNT // 2,
        ),
        (
            [BOTH] * 180 + [GYROSCOPE] * 20,
            "message 180 has the gyroscope alone .*most messages have both triads",
            20,
        ),
        (
            [ACCELEROMETER, *[BOTH] * 199],
            "message 0 has the accelerometer alone .*most messages have both triads",
            1,
        ),
    ],
)
def test_messages_without_a_triad_among_others_are_refused_or_left_out(
    tmp_path, capsys, name, kinds, line, missing
):
    path = bag(tmp_path / name, kinds)
    with pytest.raises(InputError, match=line):
        read_imu(path)
    skipped = []
    assert len(read_imu(path, skipped=skipped.append)) == COUNT - missing
    assert sum(skipped) == missing
    out = ["-o", str(tmp_path / "out.mcap"), "--quiet"]
    assert add_errors.main([str(path), "--imu", "mpu6000", *out]) == 2
    assert "(covariance -1), most messages have" in capsys.readouterr().err
