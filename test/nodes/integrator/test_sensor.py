# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The integrator takes the noise of the sensor whose readings it integrates."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_messages import stamp_ns

from imu_sim_ros.parameters.files import load
from imu_sim_ros.simulation.parameters import load_simulation

pytestmark = pytest.mark.ros

IMU, TRUTH, ODOMETRY = "imu/data_raw", "ground_truth/odom", "dead_reckoned/odom"
DESCRIPTION = "imu/data_raw/parameters"
CHI_SQUARE_3 = 16.27
"""The 99.9 % point of chi-square with three degrees of freedom."""


def position(message: Any) -> np.ndarray:
    p = message.pose.pose.position
    return np.array([p.x, p.y, p.z])


def covariance(message: Any) -> np.ndarray:
    return np.reshape(message.pose.covariance, (6, 6))[:3, :3]


def by_stamp(messages: list[Any]) -> dict[int, Any]:
    return {stamp_ns(message): message for message in messages}


def test_the_readmes_trio_is_consistent(start: Any, listener: Any) -> None:
    from nav_msgs.msg import Odometry

    for topic in (TRUTH, ODOMETRY, "told/odom"):
        listener.listen(topic, Odometry)
    sensor = ("--imu", "adis16448")
    asked = start("integrator", "--initial_state", "truth")
    renamed = ["--ros-args", "-r", f"{ODOMETRY}:=told/odom", "-r", "__node:=told"]
    second_integrator = start("integrator", *sensor, "--initial_state", "truth", *renamed)
    simulator = start(
        "simulator",
        *("--rate", "400", *sensor, "--trajectory", "figure_eight", "--duration", "1"),
        # The listener hears the truth as well.
        *("--wait_for_subscribers", "2", "--wait_for_truth_subscribers", "3"),
    )
    assert listener.wait_for_end(simulator) == 0, simulator.output
    listener.wait_for(ODOMETRY, 400)
    listener.wait_for("told/odom", 400)
    assert asked.end() == 0
    assert second_integrator.end() == 0
    assert "the sensor is adis16448, according to /imu/data_raw/parameters" in asked.output
    truth = by_stamp(listener.messages(TRUTH))
    configured_odometry, described_odometry = (
        listener.messages(ODOMETRY),
        listener.messages("told/odom"),
    )
    assert [m.pose.covariance.tolist() for m in configured_odometry] == [
        m.pose.covariance.tolist() for m in described_odometry
    ]
    final_odometry = configured_odometry[-1]
    (stamp,) = by_stamp([final_odometry])
    error = position(final_odometry) - position(truth[stamp])
    nees = error @ np.linalg.solve(covariance(final_odometry), error)
    assert nees < CHI_SQUARE_3


def test_the_description_is_a_parameter_file(start: Any, listener: Any, tmp_path: Path) -> None:
    from rclpy.qos import DurabilityPolicy
    from std_msgs.msg import String

    simulator = start("simulator", "--imu", "mpu6000", "--rate", "50")
    listener.listen(DESCRIPTION, String, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    listener.wait_for(DESCRIPTION, 1)
    density = {"imu__gyroscope_noise_density": 0.25}
    assert listener.set("simulator", **density).successful
    listener.wait_for(DESCRIPTION, 2)
    assert simulator.end() == 0
    first_description, second_description = (
        message.data for message in listener.messages(DESCRIPTION)
    )
    file = tmp_path / "sensor.yaml"
    file.write_text(first_description)
    assert load_simulation(load(file)).imu == load_simulation({"imu.preset": "mpu6000"}).imu
    file.write_text(second_description)
    assert load_simulation(load(file)).imu.gyroscope.noise_density == (0.25, 0.25, 0.25)


def test_several_imus_describe_themselves_each(start: Any, listener: Any) -> None:
    from rcl_interfaces.srv import GetParameters

    ramp = ("--right.imu.accelerometer_rate_ramp", "0.001")
    start("simulator", "--imus", "[left, right]", "--right.imu.preset", "vn100", *ramp)
    remap = ["--ros-args", "-r", f"{IMU}:=right/{IMU}"]
    integrator = start("integrator", *remap)
    response = None
    while response is None or response.values[0].string_value == "lecture":
        response = listener.call("integrator/get_parameters", GetParameters, names=["imu.preset"])
    assert response.values[0].string_value == "vn100"
    assert integrator.end() == 0
    assert f"according to /right/{DESCRIPTION}" in integrator.output
    assert "the covariance does not include imu.accelerometer_rate_ramp\n" in integrator.output


def test_the_mounted_one_of_two_imus_starts_at_the_truth_of_the_body(
    start: Any, listener: Any
) -> None:
    """The second IMU has a lever arm and is turned by 90 degrees; ignoring both costs 171 m in 6 s.

    The midpoint method is off by 2e-5 m on this motion at 200 Hz, also for an IMU of the body.
    """
    from diagnostic_msgs.msg import DiagnosticArray
    from nav_msgs.msg import Odometry

    listener.listen(ODOMETRY, Odometry)
    listener.listen("/diagnostics", DiagnosticArray)
    remap = ["--ros-args", "-r", f"{IMU}:=right/{IMU}"]
    integrator = start("integrator", "--initial_state", "truth", "--error", "true", *remap)
    mount = ("--right.imu.lever_arm", "[0.3, -0.2, 0.1]")
    mount += ("--right.imu.mounting", "[1, 0, 0, 0, 0, -1, 0, 1, 0]")
    simulator = start(
        *("simulator", "--imus", "[left, right]", "--imu", "perfect", *mount, "--duration", "2"),
        *("--trajectory", "figure_eight", "--world_frame", "map", "--body_frame", "drone"),
        *("--right.rate", "200", "--wait_for_subscribers", "0"),
        *("--wait_for_truth_subscribers", "1"),
    )
    assert listener.wait_for_end(simulator) == 0, simulator.output
    listener.wait_for(ODOMETRY, 400)

    def values() -> dict[str, str]:
        statuses = [m.status[0] for m in listener.messages("/diagnostics")]
        mine = [s.values for s in statuses if s.name == "integrator: dead reckoning"]
        return {entry.key: entry.value for entry in (mine[-1] if mine else [])}

    whole = "400 of 400"
    listener.wait_until(lambda: values().get("estimates with a truth") == whole, whole)
    status_values = values()
    assert integrator.end() == 0
    frames = {(m.header.frame_id, m.child_frame_id) for m in listener.messages(ODOMETRY)}
    assert frames == {("map", "drone")}
    assert float(status_values["position error [m]"]) < 1e-4
    assert float(status_values["rms position error [m]"]) < 1e-4
    assert float(status_values["attitude error [rad]"]) < 1e-5


def test_without_a_description_it_says_so_and_goes_on(start: Any, listener: Any) -> None:
    from nav_msgs.msg import Odometry

    listener.listen(ODOMETRY, Odometry)
    # A driver without a description: the simulator's readings under another name than it thinks.
    integrator = start("integrator", "--ros-args", "-r", "imu/data_raw:=ground_truth/imu")
    start("simulator", "--publish.ground_truth_imu", "true", "--wait_for_subscribers", "0")
    listener.wait_for(ODOMETRY, 100)
    assert integrator.end() == 0
    assert (
        "no sensor description on /ground_truth/imu/parameters: "
        "the covariance uses the noise of imu.preset lecture" in integrator.output
    )
    stamps = list(by_stamp(listener.messages(ODOMETRY)))
    assert np.diff(stamps).tolist() == [5_000_000] * (len(stamps) - 1)


def test_a_bad_description_is_refused(start: Any, listener: Any) -> None:
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from std_msgs.msg import String

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = listener.node.create_publisher(String, DESCRIPTION, latched)
    integrator = start("integrator")

    def said() -> list[str]:
        return [line for line in integrator.output.splitlines() if "cannot be used" in line]

    no_file = "that is not a parameter file in JSON"
    imu = '{"/**": {"ros__parameters": {"imu": %s}}}'
    for count, (text, error_text) in enumerate(
        (
            ("rubbish", no_file),
            ("[" * 10000, no_file),
            (imu % '{"gyroscope_noise_density": -1}', "at least 0"),
            (imu % '{"gyroscope_noise_density": NaN}', "finite"),
            (imu % "[1]", no_file),
        )
    ):
        publisher.publish(String(data=text))
        listener.wait_until(lambda count=count: len(said()) > count, error_text)
        assert error_text in said()[-1]
    assert integrator.end() == 0
    assert "Traceback" not in integrator.output
