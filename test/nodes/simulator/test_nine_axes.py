# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Live readings of a nine-axis board equal those of the simulation, bit for bit."""

from typing import Any

import numpy as np
import pytest
from ros_messages import stamps_ns

from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

pytestmark = pytest.mark.ros

PARAMETERS: dict[str, Any] = {
    "imu.preset": "mpu9250",
    "trajectory.type": "figure_eight",
    "rate": 200.0,
    "duration": 1.5,
    "start_time": 1234.5,
    "seed": 7,
    "imu.latency": 0.02,
    "imu.latency_jitter": 0.005,
    "imu.jitter": 2e-4,
    "imu.magnetometer_rate": 70.0,
    "imu.magnetometer_time_offset": 0.003,
    "imu.magnetometer_noise_density": 1e-8,
    "imu.magnetometer_bias_instability": 1e-8,
    "imu.barometer_preset": "bmp280",
    "imu.orientation_source": "filter",
    "imu.orientation_rate": 100.0,
}
SENSORS = ("magnetic_field", "pressure", "orientation")


def test_live_samples_are_those_of_the_simulation(start: Any, listener: Any) -> None:
    from geometry_msgs.msg import Vector3Stamped
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import FluidPressure, Imu, MagneticField

    kinds = {
        "imu/data_raw": Imu,
        "imu/data": Imu,
        "ground_truth/odom": Odometry,
        "imu/mag": MagneticField,
        "ground_truth/mag": MagneticField,
        "ground_truth/magnetometer_bias": Vector3Stamped,
        "imu/pressure": FluidPressure,
        "ground_truth/pressure": FluidPressure,
        "ground_truth/barometer_bias": FluidPressure,
    }
    for topic, kind in kinds.items():
        listener.listen(topic, kind)
    chosen = {name.replace(".", "__"): value for name, value in PARAMETERS.items()}
    truths = [f"ground_truth_{name}" for name in SENSORS[:2]]
    published = {f"publish__{name}": True for name in (*SENSORS, *truths, "biases")}
    node = start(
        "simulator",
        **chosen,
        **published,
        block_duration=0.05,
        wait_for_subscribers=1,
        wait_for_truth_subscribers=1,
    )
    assert listener.wait_for_end(node) == 0, node.output
    block = Body(load_simulation(PARAMETERS), sensors=SENSORS).next(10**6)
    assert stamps_ns(listener.messages("imu/data_raw")) == block["imu"].t_ns.tolist()
    same_field(listener, block)
    same_pressure(listener, block)
    same_orientation(listener, block)


def same_field(listener: Any, block: dict[str, Any]) -> None:
    field = block["magnetic_field"]
    assert field is not None
    field_messages = listener.messages("imu/mag")
    assert stamps_ns(field_messages) == field.t_ns.tolist()
    values = [[getattr(m.magnetic_field, axis) for axis in "xyz"] for m in field_messages]
    assert np.array_equal(values, field.field)
    assert stamps_ns(listener.messages("ground_truth/mag")) == field.true_t_ns.tolist()
    truth = [m.vector for m in listener.messages("ground_truth/magnetometer_bias")]
    assert np.array_equal([[v.x, v.y, v.z] for v in truth], field.bias)


def same_pressure(listener: Any, block: dict[str, Any]) -> None:
    air = block["pressure"]
    assert air is not None
    pressure_messages = listener.messages("imu/pressure")
    assert stamps_ns(pressure_messages) == air.t_ns.tolist()
    assert [m.fluid_pressure for m in pressure_messages] == air.pressure.tolist()
    still = listener.messages("ground_truth/pressure")
    assert [m.fluid_pressure for m in still] == air.ideal_pressure.tolist()
    truth = listener.messages("ground_truth/barometer_bias")
    assert [m.fluid_pressure for m in truth] == air.bias.tolist()


def same_orientation(listener: Any, block: dict[str, Any]) -> None:
    stated = block["orientation"]
    assert stated is not None
    imu_messages = listener.messages("imu/data")
    assert stamps_ns(imu_messages) == stated.t_ns.tolist()
    q = [[getattr(m.orientation, part) for part in "wxyz"] for m in imu_messages]
    assert np.array_equal(q, stated.q_wi)


def test_a_fault_of_a_sensor_that_is_not_published_is_refused(start: Any) -> None:
    node = start("simulator", inject__kind="dropout", inject__triad="magnetometer")
    assert node.status() == 2
    assert (
        "inject.triad = magnetometer: needs publish.magnetic_field, which is false" in node.output
    )
