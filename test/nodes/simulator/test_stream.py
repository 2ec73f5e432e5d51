# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A subscriber in another process receives the samples of stream.py, bit for bit."""

from typing import Any

import numpy as np
import pytest
from ros_messages import stamps_ns

from imu_sim_ros.core.rotation import rotate_inverse
from imu_sim_ros.sensors.gravity import geodetic
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

pytestmark = pytest.mark.ros

IMU, TRUTH = "imu/data_raw", "ground_truth/odom"
READY = {"wait_for_subscribers": 1, "wait_for_truth_subscribers": 1}


def xyz(vectors: list[Any]) -> np.ndarray:
    return np.array([[v.x, v.y, v.z] for v in vectors])


def hear(listener: Any, *extra_topics: Any) -> None:
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu

    listener.listen(IMU, Imu)
    listener.listen(TRUTH, Odometry)
    for topic, kind in extra_topics:
        listener.listen(topic, kind)


@pytest.mark.parametrize(
    ("rate", "settings"),
    [
        (200.0, {"imu__preset": "lecture"}),
        (333.3, {"imu__jitter": 2e-4, "imu__stamp_offset": 0.01, "imu__clock_skew_ppm": 30}),
        (1000.0, {"imu__dropout_probability": 0.05, "imu__duplicate_probability": 0.02}),
        (500.0, {"imu__latency": 0.02, "imu__latency_jitter": 0.005, "block_duration": 0.03}),
    ],
)
def test_readings_equal_those_of_the_stream(
    start: Any, listener: Any, rate: float, settings: dict[str, Any]
) -> None:
    hear(listener)
    chosen = {"rate": rate, "seed": 7, "duration": 0.7, "start_time": 1234.5, **settings}
    node = start("simulator", **chosen, **READY)
    assert listener.wait_for_end(node) == 0, node.output

    stream_settings = {key.replace("__", "."): value for key, value in chosen.items()}
    stream_settings.pop("block_duration", None)
    parameters = load_simulation(stream_settings)
    block = Body(parameters).next(10**6)["imu"]
    rows = block.delivered
    readings = listener.messages(IMU)
    assert stamps_ns(readings) == block.t_ns[rows].tolist()
    np.testing.assert_array_equal(xyz([m.angular_velocity for m in readings]), block.gyro[rows])
    np.testing.assert_array_equal(xyz([m.linear_acceleration for m in readings]), block.accel[rows])
    truth = listener.messages(TRUTH)
    assert stamps_ns(truth) == block.true_t_ns.tolist()
    motion = block.motion
    np.testing.assert_array_equal(xyz([m.pose.pose.position for m in truth]), motion.position)
    np.testing.assert_array_equal(
        xyz([m.twist.twist.linear for m in truth]), rotate_inverse(motion.q_wb, motion.velocity)
    )
    np.testing.assert_array_equal(
        xyz([m.twist.twist.angular for m in truth]), motion.angular_velocity
    )
    quaternions = [m.pose.pose.orientation for m in truth]
    np.testing.assert_array_equal([[q.w, q.x, q.y, q.z] for q in quaternions], motion.q_wb)
    assert f"published {len(rows)} messages on {IMU}" in node.output


def test_frames_covariances_and_the_truth_beside_the_readings(start: Any, listener: Any) -> None:
    from geometry_msgs.msg import Vector3Stamped
    from sensor_msgs.msg import Imu, NavSatFix, Temperature

    bias, scale = "ground_truth/gyroscope_bias", "ground_truth/accelerometer_scale"
    hear(
        listener,
        (bias, Vector3Stamped),
        (scale, Vector3Stamped),
        ("ground_truth/imu", Imu),
        ("imu/temperature", Temperature),
        ("ground_truth/fix", NavSatFix),
    )
    chosen = {"rate": 100, "duration": 1, "seed": 3, "imu__gyroscope_bias": [0.1, 0, -0.1]}
    chosen |= {"imu__accelerometer_ageing_scale": [0.01, 0.02, 0.03], "imu__age_days": 9}
    names = ("biases", "errors", "ground_truth_imu", "temperature", "ground_truth_fix")
    topics = dict.fromkeys(names, True)
    publish_settings = {f"publish__{name}": value for name, value in topics.items()}
    node = start("simulator", imu_frame="sensor", **chosen, **publish_settings, **READY)
    assert listener.wait_for_end(node) == 0, node.output
    (imu_message, *_), (true_message, *_) = listener.messages(IMU), listener.messages(TRUTH)
    assert np.diff(stamps_ns(listener.messages(IMU))).tolist() == [10_000_000] * 99
    assert imu_message.header.frame_id == "sensor"
    assert imu_message.orientation_covariance[0] == -1.0
    assert (true_message.header.frame_id, true_message.child_frame_id) == ("world", "base_link")
    # The lecture's densities squared, times the rate.
    gyro, accel = 0.015**2 * 100, 0.019**2 * 100
    np.testing.assert_allclose(imu_message.angular_velocity_covariance, np.eye(3).ravel() * gyro)
    np.testing.assert_allclose(
        imu_message.linear_acceleration_covariance, np.eye(3).ravel() * accel
    )
    parameters = load_simulation({key.replace("__", "."): v for key, v in chosen.items()})
    block = Body(parameters).next(100)["imu"]
    np.testing.assert_array_equal(xyz([m.vector for m in listener.messages(bias)]), block.gyro_bias)
    scales = xyz([m.vector for m in listener.messages(scale)])
    np.testing.assert_array_equal(scales, block.accel_scale)
    np.testing.assert_allclose(scales[0], [1.01, 1.02, 1.03], rtol=1e-15)  # 10 days
    np.testing.assert_array_equal(
        xyz([m.angular_velocity for m in listener.messages("ground_truth/imu")]), block.ideal_gyro
    )
    temperatures = [m.temperature for m in listener.messages("imu/temperature")]
    assert temperatures == block.temperature.tolist()
    fixes = [(m.latitude, m.longitude, m.altitude) for m in listener.messages("ground_truth/fix")]
    expected = geodetic(parameters, block.motion.position)
    np.testing.assert_array_equal(fixes, np.column_stack(expected))


def test_increments_are_those_of_the_stream_in_whole_steps(start: Any, listener: Any) -> None:
    """Delta angles and velocities of a counter of pulses, and the true ones, next to the rates."""
    from geometry_msgs.msg import Vector3Stamped

    names = ("delta_angle", "delta_velocity")
    topics = [f"{room}/{name}" for room in ("imu", "ground_truth") for name in names]
    hear(listener, *((topic, Vector3Stamped) for topic in topics))
    step = 1e-4
    chosen = {
        "rate": 100,
        "duration": 1,
        "seed": 3,
        "start_time": 10.0,
        "trajectory__type": "lecture",
        "imu__sampling": "averaged",
        "imu__gyroscope_noise_density": 1e-3,
        "imu__gyroscope_increment_resolution": step,
    }
    publish_settings = {"publish__increments": True, "publish__ground_truth_increments": True}
    node = start("simulator", **chosen, **publish_settings, **READY)
    assert listener.wait_for_end(node) == 0, node.output
    parameters = load_simulation({key.replace("__", "."): v for key, v in chosen.items()})
    block = Body(parameters).next(100)["imu"]
    for topic, means in zip(
        topics, (block.gyro, block.accel, block.ideal_gyro, block.ideal_accel), strict=True
    ):
        heard = listener.messages(topic)
        np.testing.assert_array_equal(xyz([m.vector for m in heard]), means * 0.01)
        assert {m.header.frame_id for m in heard} == {"imu_link"}
        assert stamps_ns(heard) == (block.t_ns if topic in topics[:2] else block.true_t_ns).tolist()
    counted = xyz([m.vector for m in listener.messages(topics[0])]) / step
    assert np.ptp(counted) > 10.0
    np.testing.assert_allclose(counted, np.round(counted), atol=1e-9)


def test_several_imus_share_one_truth(start: Any, listener: Any) -> None:
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu

    for topic in ("left/imu/data_raw", "right/imu/data_raw"):
        listener.listen(topic, Imu)
    listener.listen(TRUTH, Odometry)
    quarter_turn = [0.0, -1, 0, 1, 0, 0, 0, 0, 1]
    imu_settings = {
        "left.rate": 400,
        "left.imu.lever_arm": [0.0, 0.1, 0],
        "right.imu.preset": "perfect",
        "right.imu.mounting": quarter_turn,
    }
    common = {"rate": 200, "duration": 1.0, "seed": 5, "start_time": 10.0}
    node = start("simulator", imus="[left, right]", **common, **imu_settings, **READY)
    assert listener.wait_for_end(node) == 0, node.output
    left_simulation = load_simulation(
        common, {"rate": 400, "imu.lever_arm": [0.0, 0.1, 0], "imu_frame": "left_imu_link"}
    )
    right_simulation = load_simulation(
        common, {"seed": 6, "imu.preset": "perfect", "imu.mounting": quarter_turn}
    )
    for name, parameters in (("left", left_simulation), ("right", right_simulation)):
        block = Body(parameters).next(1000)["imu"]
        messages = listener.messages(f"{name}/imu/data_raw")
        np.testing.assert_array_equal(xyz([m.linear_acceleration for m in messages]), block.accel)
        assert stamps_ns(messages) == block.t_ns.tolist()
        assert messages[0].header.frame_id == f"{name}_imu_link"
    truth = listener.messages(TRUTH)
    block = Body(load_simulation(common)).next(1000)["imu"]
    np.testing.assert_array_equal(xyz([m.pose.pose.position for m in truth]), block.motion.position)
    assert stamps_ns(truth) == block.t_ns.tolist()


def test_namespaces_and_domains_do_not_mix(
    start: Any, listener_on: Any, domains: tuple[int, int]
) -> None:
    from sensor_msgs.msg import Imu

    first_listener, second_listener = listener_on(domains[0]), listener_on(domains[1])
    first_listener.listen("a/imu/data_raw", Imu)
    first_listener.listen("b/imu/data_raw", Imu)
    second_listener.listen("a/imu/data_raw", Imu)
    chosen = {"duration": 0.5, "wait_for_subscribers": 1, "start_time": 1}
    nodes = [
        start("simulator", "--ros-args", "-r", f"__ns:=/{name}", domain=domain, seed=seed, **chosen)
        for name, domain, seed in (("a", domains[0], 1), ("b", domains[0], 2), ("a", domains[1], 3))
    ]
    for node, listener in zip(
        nodes, (first_listener, first_listener, second_listener), strict=True
    ):
        assert listener.wait_for_end(node) == 0, node.output
    for listener, topic, seed in (
        (first_listener, "a/imu/data_raw", 1),
        (first_listener, "b/imu/data_raw", 2),
        (second_listener, "a/imu/data_raw", 3),
    ):
        block = Body(load_simulation({"duration": 0.5, "seed": seed})).next(1000)["imu"]
        received = xyz([m.angular_velocity for m in listener.messages(topic)])
        np.testing.assert_array_equal(received, block.gyro)
