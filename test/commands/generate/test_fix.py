# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The truth as latitude, longitude and height, in every kind of bag."""

from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from imu_sim_ros.commands import generate

FLIGHT: dict[str, Any] = {
    "imu.preset": "perfect",
    "gravity_model": "wgs84",
    "latitude_deg": 48.0,
    "longitude_deg": 179.999,
    "height": 100.0,
    "rate": 50.0,
    "duration": 2.0,
    "trajectory.type": "harmonic",
    "trajectory.x.polynomial": [0.0, 200.0],
    "trajectory.y.polynomial": [0.0, -30.0],
    "trajectory.z.polynomial": [0.0, 5.0],
}


def fixes(path: Path, *options: str, **overrides: Any) -> dict[str, list[Any]]:
    """Generate a bag and return its messages by topic."""
    argv = [w for k, v in {**FLIGHT, **overrides}.items() for w in ("--set", f"{k}={v}")]
    assert generate.main(["-o", str(path), "--quiet", *options, *argv]) == 0
    messages: dict[str, list[Any]] = {}
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            messages.setdefault(connection.topic, []).append(
                reader.deserialize(raw, connection.msgtype)
            )
    return messages


@pytest.mark.parametrize(
    ("name", "options"),
    [("x.bag", ()), ("x.mcap", ()), ("folder", ("--storage", "sqlite3"))],
)
def test_fixes_are_the_places_on_the_ellipsoid(
    tmp_path: Path, name: str, options: tuple[str, ...]
) -> None:
    messages = fixes(tmp_path / name, "--topics", "ground_truth/fix,ground_truth/odom", *options)
    fixes_of_truth, poses = messages["/ground_truth/fix"], messages["/ground_truth/odom"]
    assert len(fixes_of_truth) == len(poses) == 100
    last_fix, pose = fixes_of_truth[-1], poses[-1].pose.pose.position
    pymap3d = pytest.importorskip("pymap3d")
    place = pymap3d.enu2geodetic(pose.x, pose.y, pose.z, 48.0, 179.999, 100.0)
    assert last_fix.latitude == pytest.approx(place[0], abs=1e-12)
    assert last_fix.longitude == pytest.approx((place[1] + 180.0) % 360.0 - 180.0, abs=1e-11)
    assert last_fix.altitude == pytest.approx(place[2], abs=1e-6)
    assert last_fix.header.frame_id == "base_link"
    assert last_fix.header.stamp.sec == poses[-1].header.stamp.sec
    assert (last_fix.status.status, last_fix.position_covariance_type) == (0, 3)


def test_several_imus_have_one_body(tmp_path: Path) -> None:
    topics = ["--topics", "imu/data_raw,ground_truth/fix"]
    messages = fixes(tmp_path / "two.mcap", *topics, imus="[left, right]")
    assert {t: len(m) for t, m in messages.items()} == {
        "/left/imu/data_raw": 100,
        "/right/imu/data_raw": 100,
        "/ground_truth/fix": 100,
    }
