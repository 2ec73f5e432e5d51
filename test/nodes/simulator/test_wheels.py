# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Wheels live: what the simulation gives, bit for bit."""

from typing import Any

import numpy as np
import pytest

from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

pytestmark = pytest.mark.ros

GIVEN: dict[str, Any] = {
    "trajectory.type": "circle",
    "duration": 2.0,
    "start_time": 1234.5,
    "seed": 7,
    "wheels.preset": "turtlebot3_burger",
}


def test_live_odometry_is_that_of_the_simulation(start: Any, listener: Any) -> None:
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, JointState

    kinds = {"imu/data_raw": Imu, "ground_truth/odom": Odometry, "wheel/odom": Odometry}
    kinds |= {"joint_states": JointState, "ground_truth/wheel_odom": Odometry}
    for topic, kind in kinds.items():
        listener.listen(topic, kind)
    chosen = {name.replace(".", "__"): value for name, value in GIVEN.items()}
    waiting = {"wait_for_subscribers": 1, "wait_for_truth_subscribers": 1}
    node = start("simulator", "--sensors", "[wheels]", "--ros-args", **chosen, **waiting)
    assert listener.wait_for_end(node) == 0, node.output
    run = Body(load_simulation({**GIVEN, "sensors": ["wheels"]}), sensors={"wheels"})
    wheel_block = run.next(10**6)["wheels"]
    odometry, joints = listener.messages("wheel/odom"), listener.messages("joint_states")
    assert len(odometry) == len(joints) == len(wheel_block.t_ns) == 40
    twists = [m.twist.twist for m in odometry]
    assert np.array_equal(
        [[t.linear.x, t.linear.y, t.angular.z] for t in twists], wheel_block.twist
    )
    assert np.array_equal(
        [m.twist.covariance[0] for m in odometry], wheel_block.covariance[:, 0, 0]
    )
    assert np.array_equal([m.position for m in joints], wheel_block.angle)
    assert np.array_equal([m.velocity for m in joints], wheel_block.speed)
    assert list(joints[0].name) == ["wheel_left_joint", "wheel_right_joint"]
    truth = listener.messages("ground_truth/wheel_odom")
    places = [[m.pose.pose.position.x, m.pose.pose.position.y] for m in truth]
    assert np.array_equal(places, wheel_block.true_pose[:, :2])
