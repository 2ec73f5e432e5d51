# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A GNSS receiver live: what the simulation gives, bit for bit, and where its antenna is."""

from typing import Any

import numpy as np
import pytest

from imu_sim_ros.simulation.engine import Simulation
from imu_sim_ros.simulation.parameters import load_simulation

pytestmark = pytest.mark.ros

GIVEN: dict[str, Any] = {
    "trajectory.type": "figure_eight",
    "duration": 2.0,
    "start_time": 1234.5,
    "seed": 7,
    "latitude_deg": 48.0,
    "gnss.preset": "zed_f9p",
    "gnss.lever_arm": [0.3, 0.0, 0.1],
    "gnss.outages": [1.0, 0.35],
    "gnss.latency": 0.05,
}


def test_live_fixes_are_those_of_the_simulation(start: Any, listener: Any) -> None:
    from geometry_msgs.msg import TwistWithCovarianceStamped
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, NavSatFix

    kinds = {"imu/data_raw": Imu, "ground_truth/odom": Odometry, "gps/fix": NavSatFix}
    for topic, kind in {**kinds, "gps/velocity": TwistWithCovarianceStamped}.items():
        listener.listen(topic, kind)
    listener.listen("ground_truth/gps_fix", NavSatFix)
    chosen = {name.replace(".", "__"): value for name, value in GIVEN.items()}
    waiting = {"wait_for_subscribers": 1, "wait_for_truth_subscribers": 1}
    node = start("simulator", "--sensors", "[gnss]", "--ros-args", **chosen, **waiting)
    assert listener.wait_for_end(node) == 0, node.output
    run = Simulation(load_simulation({**GIVEN, "sensors": ["gnss"]}), sensors={"gnss"})
    read = run.next_block(10**6).auxiliary["gnss"]
    fixes, rows = listener.messages("gps/fix"), read.delivered
    assert len(fixes) == len(rows) == 16
    places = [[m.latitude, m.longitude, m.altitude] for m in fixes]
    assert np.array_equal(places, read.geodetic[rows])
    assert {(m.header.frame_id, m.status.status) for m in fixes} == {("gps_link", 2)}
    assert np.array_equal([m.position_covariance[::4] for m in fixes], read.variance[rows])
    velocity = [m.twist.twist.linear for m in listener.messages("gps/velocity")]
    assert np.array_equal([[v.x, v.y, v.z] for v in velocity], read.velocity[rows])
    assert len(listener.messages("ground_truth/gps_fix")) == 20
