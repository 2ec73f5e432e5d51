# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The error model as a real process: its readings are a simulation's, whatever arrives."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from ros_messages import stamps_ns
from sensor_msgs.msg import FluidPressure, Imu, MagneticField, Temperature
from std_srvs.srv import Trigger

import imu_sim_ros as ims
from imu_sim_ros.bags.messages.encode import (
    FluidPressureEncoder,
    ImuEncoder,
    MagneticFieldEncoder,
    OdometryEncoder,
)
from imu_sim_ros.core.rotation import rotate_inverse
from imu_sim_ros.nodes.error_model.node import ErrorModelNode

pytestmark = pytest.mark.ros
SEED, RATE = 3, 500.0


@pytest.fixture(scope="module")
def flight() -> ims.Flight:
    return ims.simulate(imu="mpu6000", trajectory="figure_eight", rate=RATE, duration=2, seed=SEED)


class Source:
    """Publishes messages as a simulator would."""

    def __init__(self, listener, kind, topic: str) -> None:
        self._listener = listener
        self._publisher = listener.node.create_publisher(kind, topic, QoSProfile(depth=5000))
        listener.wait_until(self._publisher.get_subscription_count, f"a subscriber of {topic}")
        listener.spin(0.3)  # it may still have to learn of this publisher

    def send(self, messages, at_once: int = 20) -> None:
        for k, message in enumerate(messages):
            self._publisher.publish(message)
            if k % at_once == at_once - 1:
                self._listener.spin(0.001)


def ideal(flight: ims.Flight, q_wb=None) -> list[bytes]:
    truth = flight.truth
    encoder = ImuEncoder("imu_link")
    if q_wb is None:
        rows = encoder.encode(truth.t_ns, truth.gyro, truth.accel)
    else:
        rows = encoder.encode(truth.t_ns, truth.gyro, truth.accel, q_wb)
    return [row.tobytes() for row in rows]


def vectors(messages, name: str) -> np.ndarray:
    rows = [getattr(message, name) for message in messages]
    return np.array([[row.x, row.y, row.z] for row in rows])


def test_live_readings_are_those_of_the_simulation(start, listener, flight):
    names = {
        "imu/data_raw": Imu,
        "ground_truth/imu": Imu,
        "ground_truth/gyroscope_bias": Vector3Stamped,
        "ground_truth/accelerometer_bias": Vector3Stamped,
        "imu/temperature": Temperature,
        "/diagnostics": DiagnosticArray,
    }
    for topic, kind in names.items():
        listener.listen(topic, kind)
    node = start(
        "error_model",
        *("--imu", "mpu6000", "--rate", "500", "--seed", "3", "--publish.biases", "true"),
        *("--publish.ground_truth_imu", "true", "--publish.temperature", "true"),
    )
    source = Source(listener, Imu, "imu/ideal")
    source.send(ideal(flight))
    for topic in [*names][:-1]:
        listener.wait_for(topic, len(flight))
    imu_messages = listener.messages("imu/data_raw")
    assert np.array_equal(stamps_ns(imu_messages), flight.t_ns)
    assert np.array_equal(vectors(imu_messages, "angular_velocity"), flight.gyro)
    assert np.array_equal(vectors(imu_messages, "linear_acceleration"), flight.accel)
    bias = listener.messages("ground_truth/accelerometer_bias")
    assert np.array_equal(vectors(bias, "vector"), flight.truth.accel_bias)
    true = listener.messages("ground_truth/imu")
    assert np.array_equal(vectors(true, "linear_acceleration"), flight.truth.accel)
    assert {message.header.frame_id for message in imu_messages} == {"imu_link"}

    def running():
        messages = listener.messages("/diagnostics")
        values = [{v.key: v.value for v in m.status[0].values} for m in messages]
        return any(v.get("readings") == str(len(flight)) for v in values)

    listener.wait_until(running, "diagnostics")
    assert node.end() == 0
    assert f"error_model: received {len(flight)} messages on imu/ideal" in node.output
    assert f"error_model: published {len(flight)} messages on imu/data_raw" in node.output


def test_noise_that_would_be_added_twice_is_told(start, listener):
    listener.listen("/diagnostics", DiagnosticArray)
    node = start("error_model", "--imu", "mpu6000", "--rate", "500", "--seed", "4")
    noisy = ims.simulate(imu="mpu6000", rate=RATE, duration=2.1, seed=SEED)
    rows = ImuEncoder("imu_link").encode(noisy.t_ns, noisy.gyro, noisy.accel)
    Source(listener, Imu, "imu/ideal").send([row.tobytes() for row in rows])
    line = "input: the gyroscope has white noise of "

    def told():
        return any(line in m.status[0].message for m in listener.messages("/diagnostics"))

    listener.wait_until(told, "diagnostics")
    assert node.end() == 0
    assert node.output.count(line) == 1
    assert node.output.count("input: the accelerometer has white noise of ") == 1


def test_magnetometer_and_barometer_are_those_of_the_simulation(start, listener):
    imu_settings = {"preset": "mpu9250", "barometer_preset": "bmp388", "barometer_rate": 50.0}
    sensors = ["magnetic_field", "pressure"]
    run = {
        "imu": imu_settings,
        "rate": RATE,
        "seed": SEED,
        "trajectory": "figure_eight",
        "duration": 2,
    }
    flight = ims.simulate(sensors=sensors, **run)
    magnetic_and_pressure = flight.magnetic_field, flight.pressure
    listener.listen("imu/mag", MagneticField)
    listener.listen("ground_truth/magnetometer_bias", Vector3Stamped)
    listener.listen("imu/pressure", FluidPressure)
    listener.listen("ground_truth/faults", DiagnosticArray)
    node = start(
        "error_model",
        *("--imu", "mpu9250", "--rate", "500", "--seed", "3", "--publish.biases", "true"),
        *("--publish.magnetic_field", "true", "--publish.pressure", "true"),
        *("--imu.barometer_preset", "bmp388", "--imu.barometer_rate", "50"),
    )
    fields = Source(listener, MagneticField, "imu/mag/ideal")
    airs = Source(listener, FluidPressure, "imu/pressure/ideal")
    rows = MagneticFieldEncoder("imu_link").encode(
        magnetic_and_pressure[0].true_t_ns, magnetic_and_pressure[0].ideal_field
    )
    messages = [row.tobytes() for row in rows]
    nan = messages[0].replace(
        magnetic_and_pressure[0].ideal_field[0, 0].tobytes(), np.float64(np.nan).tobytes()
    )
    fields.send([nan, *messages])
    rows = FluidPressureEncoder("imu_link").encode(
        magnetic_and_pressure[1].true_t_ns, magnetic_and_pressure[1].ideal_pressure
    )
    airs.send([row.tobytes() for row in rows])
    listener.wait_for("imu/mag", len(magnetic_and_pressure[0]))
    listener.wait_for("ground_truth/magnetometer_bias", len(magnetic_and_pressure[0]))
    listener.wait_for("imu/pressure", len(magnetic_and_pressure[1]))
    field_messages = listener.messages("imu/mag")
    assert np.array_equal(vectors(field_messages, "magnetic_field"), magnetic_and_pressure[0].field)
    density = np.array(
        [field_message.magnetic_field_covariance[0] for field_message in field_messages]
    )
    assert (density > 0.0).all()  # the resolution's
    bias = listener.messages("ground_truth/magnetometer_bias")
    assert np.array_equal(vectors(bias, "vector"), magnetic_and_pressure[0].bias)
    air = [message.fluid_pressure for message in listener.messages("imu/pressure")]
    assert np.array_equal(air, magnetic_and_pressure[1].pressure)
    result = listener.set("error_model", inject__kind="stuck", inject__triad="magnetometer")
    assert result.successful, result.reason
    listener.wait_for("ground_truth/faults", 1)
    assert node.end() == 0
    assert f"received {len(magnetic_and_pressure[0]) + 1} messages on imu/mag/ideal" in node.output
    assert "imu/mag/ideal: refused" in node.output


def test_changes_faults_reset_and_bad_messages(start, listener):
    listener.listen("imu/data_raw", Imu)
    listener.listen("ground_truth/faults", DiagnosticArray)
    node = start("error_model", "--imu", "perfect", "--rate", "100")
    source = Source(listener, Imu, "imu/ideal")
    encoder = ImuEncoder("x")

    def rows(first_index: int, count: int) -> list[bytes]:
        t_ns = (first_index + np.arange(count)) * 10_000_000 + 10**9
        level = np.tile([0.0, 0.0, 9.81], (count, 1))
        return [row.tobytes() for row in encoder.encode(t_ns, np.zeros((count, 3)), level)]

    source.send(rows(0, 10))
    listener.wait_for("imu/data_raw", 10)
    good = rows(10, 2)
    nan = good[0].replace(np.float64(9.81).tobytes(), np.float64(np.nan).tobytes())
    source.send([nan, good[1], b"\0\1\0\0", good[0][:40], *rows(12, 8)])
    listener.wait_for("imu/data_raw", 19)
    result = listener.set(
        "error_model",
        inject__kind="bias_jump",
        inject__value=[0.5, 0.0, 0.0],
        inject__duration=0.05,
    )
    assert result.successful, result.reason
    assert listener.set("error_model", imu__gyroscope_bias=[0.0, 0.25, 0.0]).successful
    assert not listener.set("error_model", imu__gyroscope_bandwidth=[9.0] * 3).successful
    refused = listener.set("error_model", inject__kind="stuck", inject__triad="magnetometer")
    assert "has no magnetometer" in refused.reason
    source.send(rows(20, 100))
    listener.wait_for("imu/data_raw", 119)
    angular_rates = vectors(listener.messages("imu/data_raw"), "angular_velocity")
    # Reading 10 is missing: row k - 1 is sample k; the fault lasts 5 of them.
    assert np.flatnonzero(angular_rates[:, 0]).tolist() == [19, 20, 21, 22, 23]
    assert np.flatnonzero(angular_rates[:, 1])[0] == 64 - 1
    frames = {message.header.frame_id for message in listener.messages("imu/data_raw")}
    assert frames == {"x"}  # that of the input
    fault = listener.messages("ground_truth/faults")[0]
    assert (fault.header.stamp.sec, fault.header.stamp.nanosec) == (1, 200_000_000)
    assert listener.call("error_model/reset", Trigger).success
    source.send(rows(0, 5))
    listener.wait_for("imu/data_raw", 124)
    assert node.end() == 0
    assert "refused: stamp 1.100000000 s: a value that is not finite" in node.output


def test_a_simulator_that_is_reset_and_two_nodes_in_namespaces(start, listener, flight):
    for name in ("left", "right"):
        listener.listen(f"/{name}/imu/data_raw", Imu)
    nodes = [
        start(
            "error_model",
            *("--imu", "mpu6000", "--rate", "500", "--seed", str(seed)),
            *("--input.restart", "next_seed", "--ros-args", "-r", f"__ns:=/{name}"),
            *("-r", "imu/ideal:=/shared/imu"),
        )
        for name, seed in (("left", 3), ("right", 4))
    ]
    source = Source(listener, Imu, "/shared/imu")
    listener.wait_until(lambda: source._publisher.get_subscription_count() == 2, "both nodes")
    listener.spin(0.3)
    messages = ideal(flight)
    source.send(messages)
    source.send(messages)
    for name in ("left", "right"):
        listener.wait_for(f"/{name}/imu/data_raw", 2 * len(flight))
    left_accel, right_accel = (
        vectors(listener.messages(f"/{name}/imu/data_raw"), "linear_acceleration")
        for name in ("left", "right")
    )
    assert np.array_equal(left_accel[: len(flight)], flight.accel)
    assert np.array_equal(left_accel[len(flight) :], right_accel[: len(flight)])  # seed 4 of both
    for node in nodes:
        assert node.end() == 0
    assert "jump back" in nodes[0].output


def test_several_in_one_process_know_nothing_of_each_other(listener, flight, capfd):
    """Own seeds, parameters and faults, from one source; each ends for itself."""
    sensors = {"left": ("mpu6000", SEED), "right": ("mpu6000", SEED), "tail": ("perfect", 1)}
    nodes = {}
    for name, (imu, seed) in sensors.items():
        listener.listen(f"/{name}/imu/data_raw", Imu)
        values = {"imu.preset": imu, "rate": RATE, "seed": seed}
        nodes[name] = ErrorModelNode(
            context=listener.context,
            namespace=f"/{name}",
            parameter_overrides=[Parameter(key, value=value) for key, value in values.items()],
            cli_args=["--ros-args", "-r", "imu/ideal:=/shared/imu"],
            use_global_arguments=False,
        )
        listener.host(nodes[name])
    source = Source(listener, Imu, "/shared/imu")
    listener.wait_until(lambda: source._publisher.get_subscription_count() == 3, "three nodes")
    listener.spin(0.3)
    messages, half = ideal(flight), len(flight) // 2
    source.send(messages[:half])
    for name in sensors:
        listener.wait_for(f"/{name}/imu/data_raw", half)
    faulty = listener.set(
        "/left/error_model",
        inject__kind="stuck",
        inject__triad="gyroscope",
        inject__duration=0.2,
    )
    assert faulty.successful, faulty.reason
    assert listener.set("/right/error_model", imu__accelerometer_bias=[0.0, 0.0, 1.0]).successful
    nodes["tail"].close()
    nodes["tail"].destroy_node()
    listener.wait_until(lambda: source._publisher.get_subscription_count() == 2, "two nodes")
    source.send(messages[half:])
    for name in ("left", "right"):
        listener.wait_for(f"/{name}/imu/data_raw", len(flight))
    left_messages, right_messages, tail_messages = (
        listener.messages(f"/{name}/imu/data_raw") for name in sensors
    )
    gyro, accel = (
        vectors(left_messages, "angular_velocity"),
        vectors(left_messages, "linear_acceleration"),
    )
    assert np.array_equal(gyro[:half], flight.gyro[:half])
    stuck = round(0.2 * RATE)
    assert (gyro[half : half + stuck] == flight.gyro[half - 1]).all()
    assert np.array_equal(gyro[half + stuck :], flight.gyro[half + stuck :])
    assert np.array_equal(accel, flight.accel)
    assert np.array_equal(vectors(right_messages, "angular_velocity"), flight.gyro)
    changed = vectors(right_messages, "linear_acceleration") - flight.accel
    first_changed = half + -half % 64  # live changes begin with a multiple of 64 samples
    assert not changed[:first_changed].any()
    # The bias comes before the steps of mpu6000, 1 / 2048 g: up to a step more or less.
    assert np.abs(changed[first_changed:] - [0.0, 0.0, 1.0]).max() <= 9.80665 / 2048.0 + 1e-12
    assert np.array_equal(vectors(tail_messages, "linear_acceleration"), flight.truth.accel[:half])
    for name in ("left", "right"):
        nodes[name].close()
        nodes[name].destroy_node()
    console_text = capfd.readouterr().out
    assert console_text.count(f"error_model: received {len(flight)} messages on imu/ideal") == 2
    assert f"error_model: received {half} messages on imu/ideal" in console_text


def test_odometry_and_an_orientation(start, listener, flight):
    listener.listen("imu/data_raw", Imu)
    listener.listen("imu/data", Imu)
    start(
        "error_model",
        *("--imu", "perfect", "--rate", "500", "--odometry", "true"),
        *("--publish.orientation", "true"),
    )
    source = Source(listener, Odometry, "odom/ideal")
    truth = flight.truth
    velocity_b = rotate_inverse(truth.q_wb, truth.velocity)
    rows = OdometryEncoder("world", "base_link").encode(
        truth.t_ns, truth.position, truth.q_wb, velocity_b, truth.angular_velocity
    )
    source.send([row.tobytes() for row in rows])
    listener.wait_for("imu/data", len(flight) - 2)
    specific_force = vectors(listener.messages("imu/data_raw"), "linear_acceleration")
    # A message late, off by h^2 / 6 of the third derivative of the velocity, some 40 m/s^4.
    assert np.abs(specific_force - truth.accel[1:-1]).max() < 4e-6 / 6.0 * 40.0
    stated = [message.orientation for message in listener.messages("imu/data")]
    q = np.array(
        [[quaternion.w, quaternion.x, quaternion.y, quaternion.z] for quaternion in stated]
    )
    assert np.allclose(np.abs(np.sum(q * truth.q_wb[1:-1], axis=1)), 1.0, atol=1e-12)


def test_the_latency_of_the_sensor(start, listener):
    listener.listen("imu/data_raw", Imu)
    node = start("error_model", "--imu", "perfect", "--rate", "100", "--imu.latency", "0.5")
    source = Source(listener, Imu, "imu/ideal")
    level = np.array([[0.0, 0.0, 9.81]])
    encoder = ImuEncoder("x")
    for k in range(3):
        row = encoder.encode(np.array([10**9 + k * 10**7]), np.zeros((1, 3)), level)
        source.send([row.tobytes()])
    listener.spin(0.2)
    early = len(listener.raw["imu/data_raw"])
    listener.wait_for("imu/data_raw", 3)
    assert early == 0
    assert node.end() == 0


def test_bad_arguments_are_a_line(refused):
    calls = {
        "input.axes": ["--input.axes", "ned"],
        "needs input.rate above the rate": ["--imu.sampling", "averaged"],
        "none.sdf": ["--imu", "none.sdf"],
        "rat: ": ["--publish.ground_truth", "1", "--rat", "3"],
    }
    for error_text, lines in zip(calls, refused("error_model", [*calls.values()]), strict=True):
        assert any(error_text in line for line in lines)
        assert all(line.startswith("error_model: ") for line in lines)


def test_a_twist_in_the_axes_of_the_world_is_told_within_a_second(start, listener, flight):
    node = start(
        "error_model", "--imu", "perfect", "--rate", "500", "--odometry", "true", "--seed", "1"
    )
    source = Source(listener, Odometry, "odom/ideal")
    truth = flight.truth.between(0.0, 1.0)
    rows = OdometryEncoder("world", "base_link").encode(
        truth.t_ns, truth.position, truth.q_wb, truth.velocity, truth.angular_velocity
    )
    source.send([row.tobytes() for row in rows])
    line = "twist_frame:=world (add_errors), or parameter input.twist_frame"
    listener.wait_until(lambda: line in node.output, "the finding")
    assert node.end() == 0
    assert node.output.count("velocities differ from those of the poses") == 1
