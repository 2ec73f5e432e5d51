# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps as people have them, sent through one start of the nodes, give the results of a file."""

import struct
import warnings

import numpy as np
import pytest
from ros_messages import stamps_ns
from std_srvs.srv import Trigger

import imu_sim_ros as ims
from imu_sim_ros.bags.messages.encode import ImuEncoder
from imu_sim_ros.core.records import Readings

pytestmark = pytest.mark.ros

ODOMETRY = "dead_reckoned/odom"
ERRORS = "imu/with_errors"
COUNT = 280
T0 = 1_700_000_000_000_000_000
HOUR = 3_600_000_000_000


def even(rate: float, count: int = COUNT) -> np.ndarray:
    return T0 + np.round(np.arange(count) * 1e9 / rate).astype(np.int64)


def milliseconds(rate: float) -> np.ndarray:
    return even(rate) // 1_000_000 * 1_000_000


def stray(row: int, t_ns: int) -> np.ndarray:
    stamps = even(200.0)
    stamps[row] = t_ns
    return stamps


def shifted(step_ns: int) -> np.ndarray:
    stamps = even(200.0)
    stamps[COUNT // 2 :] += step_ns
    return stamps


K = np.arange(COUNT)
KINDS = {
    "even": even(200.0),
    "ms at 50 Hz": milliseconds(50.0),
    "ms at 400.1 Hz": milliseconds(400.1),
    "ms at 997 Hz": milliseconds(997.0),
    "ms at 2 kHz": milliseconds(2000.0),
    "batches": even(400.0)[K // 8 * 8],
    "bunches": even(400.0)[K // 8 * 8] + K % 8 * 50_000,
    "first stamp 0": stray(0, 0),
    "a stamp 0": stray(100, 0),
    "an hour ahead": stray(150, T0 + HOUR),
    "0.3 s ahead": stray(150, T0 + 1_050_000_000),
    "an hour back": stray(150, T0 - HOUR),
    "pause of an hour": shifted(HOUR),
    "boot to UTC": np.r_[even(200.0)[: COUNT // 2] - T0 + 10**9, even(200.0)[COUNT // 2 :]],
}
PAUSES = ("pause of an hour", "boot to UTC")
REFUSED = {
    "microseconds": (even(200.0) // 1000, "they are in us: 200 Hz"),
    "milliseconds": (even(200.0) // 1_000_000, "they are in ms: 200 Hz"),
    "all equal": (np.full(1400, 0), "stamps are 0 ns"),
}


def moving(t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return readings (n, 3) of which no two are equal."""
    k = np.arange(len(t_ns))
    gyro = 0.05 * np.column_stack([np.sin(0.05 * k), np.cos(0.03 * k), np.sin(0.02 * k)])
    accel = np.column_stack([np.cos(0.04 * k), np.sin(0.06 * k), np.full(len(k), 9.81)])
    return gyro, accel


def messages(t_ns: np.ndarray) -> list[bytes]:
    return [row.tobytes() for row in ImuEncoder("imu_link").encode(t_ns, *moving(t_ns))]


def position(row) -> list[float]:
    point = row.pose.pose.position
    return [point.x, point.y, point.z]


def offline_position(name: str, t_ns: np.ndarray, row: int) -> np.ndarray:
    """Return the position of dead reckoning of a file after a number of its readings in order.

    Not across a pause: behind it the position is integrated from the one before it.
    """
    gyro, accel = moving(t_ns)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return ims.dead_reckon(Readings(t_ns, gyro, accel), initial="parameters").position[row]


def wait_for_line(listener, node, text: str) -> None:
    listener.wait_until(lambda: text in node.output, text)


@pytest.fixture
def nodes(node, listener):
    """Return both nodes, what sends readings to them, and what begins again."""
    from nav_msgs.msg import Odometry
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    remap = ("--ros-args", "-r", "imu/data_raw:=imu/ideal")
    integrator = node("integrator", "--imu", "perfect", *remap)
    arguments = ("--imu", "mpu6000", "--rate", "200", "--seed", "3", "--input.check", "false")
    errors = node("error_model", *arguments, "--ros-args", "-r", f"imu/data_raw:={ERRORS}")
    listener.listen(ODOMETRY, Odometry)
    listener.listen(ERRORS, Imu)
    publisher = listener.node.create_publisher(Imu, "imu/ideal", QoSProfile(depth=5000))
    listener.wait_until(lambda: publisher.get_subscription_count() == 2, "both nodes")
    listener.spin(0.3)

    def send(t_ns: np.ndarray) -> None:
        for payloads in listener.raw.values():
            payloads.clear()
        for name in ("integrator", "error_model"):
            listener.call(f"{name}/reset", Trigger)
        for k, message in enumerate(messages(t_ns)):
            publisher.publish(message)
            if k % 50 == 49:
                listener.spin(0.001)

    return integrator, errors, publisher, send


def test_stamps_as_people_have_them_give_the_result_of_a_file(nodes, listener):
    integrator, errors, publisher, send = nodes
    for name, t_ns in KINDS.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            expected = ims.add_errors(
                t_ns,
                *moving(t_ns),
                imu="mpu6000",
                rate=200.0,
                seed=3,
                input={"check": False},
            )
        send(t_ns)
        strays = name.endswith(("0", "ahead", "back"))
        # The rest of the latest batch waits for the next stamp.
        rest = {"batches": 7, "bunches": 7, "ms at 2 kHz": 1}.get(name, 0)
        listener.wait_for(ERRORS, len(expected))
        listener.wait_for(ODOMETRY, COUNT - strays - rest)
        rows = listener.messages(ERRORS)
        assert stamps_ns(rows) == expected.t_ns.tolist(), name
        force = [row.linear_acceleration for row in rows]
        assert np.array_equal([[a.x, a.y, a.z] for a in force], expected.accel), name
        rows = listener.messages(ODOMETRY)
        assert len(rows) == COUNT - strays - rest, name
        if name in PAUSES:  # not integrated over
            np.testing.assert_allclose(position(rows[-1]), 0.0, atol=1.0)
            continue
        # Live, stamps are wrong by up to 1 ms, and those of the first 64 readings in bunches by
        # 17.5 ms. At 0.3 m/s and 1.42 m/s^2 the position is wrong by:
        late = 0.001 if name.startswith("ms") else 0.0175 if name == "bunches" else 0.0
        tolerance = 1e-9 + late * (0.3 + 1.42 * (t_ns[-1] - t_ns[0]) * 1e-9)
        offline = offline_position(name, t_ns, len(rows) - 1)
        np.testing.assert_allclose(position(rows[-1]), offline, atol=tolerance, err_msg=name)

    assert "a gap of 3600.005000 s, not integrated across" in integrator.output
    for t_ns, line in REFUSED.values():
        send(t_ns)
        wait_for_line(listener, integrator, line)
        wait_for_line(listener, errors, line)
    send(even(200.0))
    broken = bytearray(messages(even(200.0)[-1:] + 5_000_000)[0])
    broken[8:12] = struct.pack("<I", 1_000_000_000)
    publisher.publish(bytes(broken))
    listener.wait_for(ERRORS, COUNT)
    listener.wait_for(ODOMETRY, COUNT)
    for node in (integrator, errors):
        wait_for_line(listener, node, "nanosec")
        assert node.end() == 0
