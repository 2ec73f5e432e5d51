# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sonar of examples/own_sensor.py in the live node, found by its entry point."""

from pathlib import Path
from typing import Any

import own_package
import pytest
from ros_messages import stamps_ns

pytestmark = pytest.mark.ros


def test_it_is_published_with_its_truth(start: Any, listener: Any, tmp_path: Path) -> None:
    """Live samples are those of Python, bit for bit; a fault of it is taken."""
    from geometry_msgs.msg import Vector3Stamped
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu

    kinds = {"imu/data_raw": Imu, "ground_truth/odom": Odometry, "sonar/beam": Vector3Stamped}
    for topic, kind in {**kinds, "ground_truth/sonar": Vector3Stamped}.items():
        listener.listen(topic, kind)
    sonar_settings = {"sonar__rate": 12.5, "sonar__noise": 0.05}
    common_settings: dict[str, Any] = {"duration": 2.0, "start_time": 1234.5, "seed": 7}
    node = start(
        "simulator",
        *("--sensors", "[sonar]", "--trajectory", "figure_eight", "--ros-args"),
        installed=own_package.install(tmp_path),
        **sonar_settings,
        **common_settings,
        wait_for_subscribers=1,
        wait_for_truth_subscribers=1,
        inject__kind="bias_jump",
        inject__triad="sonar",
        inject__value=100.0,
        inject__delay=1.0,
    )
    assert listener.wait_for_end(node) == 0, node.output
    beams = listener.messages("sonar/beam")
    stamps = stamps_ns(beams)
    assert stamps == [1_234_500_000_000 + k * 80_000_000 for k in range(25)]
    assert beams[0].header.frame_id == "base_link"
    truth = [-m.vector.z for m in listener.messages("ground_truth/sonar")]
    errors = [-m.vector.z - true for m, true in zip(beams, truth, strict=True)]
    # White noise of 0.05 m: beyond eight sigma there is nothing but the fault, from 1 s on.
    assert [abs(error) > 0.4 for error in errors] == [False] * 13 + [True] * 12


def test_a_fault_of_a_sensor_that_is_not_there_is_refused(start: Any, tmp_path: Path) -> None:
    node = start(
        "simulator",
        installed=own_package.install(tmp_path),
        inject__kind="dropout",
        inject__triad="sonar",
    )
    assert node.status() == 2
    assert "inject.triad = 'sonar': must be one of gyroscope" in node.output
